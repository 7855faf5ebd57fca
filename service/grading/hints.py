"""Likely mistakes, as sentences that quote the code with its line and state what was expected.

The hints are a pure function of the submission, the visible trials and the assignment. Marks don't depend on them. If
all visible criteria have full marks, they only report what was accepted although it differs from the description: other
words, or missing keys.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence

from service.grading.grade import CriterionResult, TrialResult
from service.grading.hint_accepted import hint_about_missing_keys, hint_about_other_words
from service.grading.hint_agents import hint_about_silent_agent, hint_about_text_of_agent, hint_about_unasked_agent
from service.grading.hint_answer_forms import hint_about_missing_frame, hint_about_quoted_values
from service.grading.hint_answers import (
    hint_about_answer_values,
    hint_about_image_command,
    hint_about_missing_key,
    hint_about_none_answers,
    hint_about_other_keys,
    hint_about_quoted_object,
    hint_about_returned_pair,
    hint_about_shifted_numbers,
    hint_about_swapped_values,
    hint_about_text_numbers,
)
from service.grading.hint_braces import hint_about_braces
from service.grading.hint_cause_lines import hint_about_cause_line
from service.grading.hint_clues import Clues, collect_clues
from service.grading.hint_counterfactuals import hint_about_wrong_number
from service.grading.hint_errors import hint_about_cell_errors, hint_about_errors, hint_about_failed_cell
from service.grading.hint_failure_lines import hint_about_failure_line, hint_about_unentered_loop
from service.grading.hint_files import (
    hint_about_ignored_magic,
    hint_about_redefined_functions,
    hint_about_several_programs,
    hint_about_starter_files,
    hint_about_swapped_parts,
)
from service.grading.hint_formats import (
    hint_about_answers,
    hint_about_empty_parts,
    hint_about_image_log,
    hint_about_images,
    hint_about_magics,
    hint_about_messages,
    hint_about_missing_files,
    hint_about_quoted_names,
)
from service.grading.hint_formulas import (
    hint_about_division,
    hint_about_gain,
    hint_about_gyro_direction,
    hint_about_radius,
    hint_about_reversed_distance,
)
from service.grading.hint_functions import (
    hint_about_functions,
    hint_about_hidden_prefix,
    hint_about_missing_return,
    hint_about_narrow_except,
    hint_about_returned_values,
)
from service.grading.hint_logic import (
    hint_about_first_message,
    hint_about_first_value,
    hint_about_large_step,
    hint_about_mirrored_end,
    hint_about_missing_reverse,
    hint_about_range_start,
    hint_about_range_step,
    hint_about_spoken_name,
    hint_about_unused_parameter,
)
from service.grading.hint_loops import hint_about_limits
from service.grading.hint_motion import (
    hint_about_curves,
    hint_about_distances,
    hint_about_missing_turn,
    hint_about_raw_light,
    hint_about_speeds,
    hint_about_stillness,
    hint_about_turns,
    hint_about_units,
)
from service.grading.hint_outputs import hint_about_missing_else, hint_about_printed_object, hint_about_swapped_sides
from service.grading.hint_passes import (
    hint_about_added_factor,
    hint_about_hasty_resending,
    hint_about_kept_value,
    hint_about_short_loop,
    hint_about_stale_twin,
    hint_about_zero_pass,
)
from service.grading.hint_recognition import hint_about_pixel_step, hint_about_recognition
from service.grading.hint_repetition import (
    hint_about_early_output,
    hint_about_exact_reading,
    hint_about_inner_loop,
    hint_about_last_number,
    hint_about_repeated_words,
    hint_about_single_reaction,
)
from service.grading.hint_responder import (
    hint_about_called_responder,
    hint_about_double_json,
    hint_about_misnamed_function,
    hint_about_missing_responder,
    hint_about_single_colon,
    hint_about_uncallable_responder,
    hint_about_unqueued_answers,
    hint_about_unreadable_answers,
    hint_about_unreturned_answers,
    hint_about_wrong_prefix,
)
from service.grading.hint_scale import hint_about_raw_report, hint_about_wrong_scale
from service.grading.hint_signatures import hint_about_signatures
from service.grading.hint_skipped_loops import hint_about_skipped_loop
from service.grading.hint_slips import hint_about_missing_comma, hint_about_slips
from service.grading.hint_structure import (
    hint_about_discarded_value,
    hint_about_missing_brackets,
    hint_about_output_below_loop,
    hint_about_replaced_function,
    hint_about_single_reading,
    hint_about_stop_in_loop,
    hint_about_uncalled_function,
    hint_about_unindented_statement,
)
from service.grading.hint_texts import (
    hint_about_missing_series,
    hint_about_sent_texts,
    hint_about_texts,
    hint_about_unspoken_text,
)
from service.grading.hint_thresholds import hint_about_joined_colours, hint_about_thresholds
from service.grading.hint_timing import hint_about_overlapping_speech, hint_about_rare_readings, hint_about_short_waits
from service.grading.hint_values import (
    hint_about_few_images,
    hint_about_few_samples,
    hint_about_partial_reading,
    hint_about_swallowed_flags,
    hint_about_swapped_atan2,
    hint_about_swapped_ports,
    hint_about_unused_value,
)
from service.grading.judging.limited_judging import collect_within_limits
from service.grading.run_plan import RunPlan
from submissions.submission import Submission

_log = logging.getLogger(__name__)

_MAX_HINTS = 5
Rule = Callable[[Clues], Iterator[str]]
#: Problems that prevent everything else.
_FILE_RULES: Sequence[Rule] = (
    hint_about_missing_files,
    hint_about_empty_parts,
    hint_about_starter_files,
    hint_about_swapped_parts,
)
#: Rules that explain an error better than its message. The message is used if none of them applies.
_ERROR_RULES: Sequence[Rule] = (
    hint_about_magics,
    hint_about_cell_errors,
    hint_about_misnamed_function,
    hint_about_missing_responder,
    hint_about_uncallable_responder,
    hint_about_unreturned_answers,
    hint_about_unreadable_answers,
    hint_about_missing_return,
    hint_about_missing_key,
    hint_about_unqueued_answers,
    hint_about_signatures,
    hint_about_missing_comma,
)
#: Rules for the causes of errors.
_MESSAGE_RULES: Sequence[Rule] = (
    hint_about_messages,
    hint_about_quoted_names,
    hint_about_braces,
    hint_about_images,
    hint_about_image_log,
    hint_about_double_json,
    hint_about_single_colon,
    hint_about_wrong_prefix,
    hint_about_answers,
    hint_about_sent_texts,
    hint_about_other_keys,
    hint_about_text_numbers,
)
#: Rules for programs that ran into a limit.
_LIMIT_RULES: Sequence[Rule] = (hint_about_stop_in_loop, hint_about_gyro_direction, hint_about_limits)
#: Rules for programs that finished but did too little, the most certain first.
_STRUCTURE_RULES: Sequence[Rule] = (
    hint_about_ignored_magic,
    hint_about_missing_brackets,
    hint_about_replaced_function,
    hint_about_redefined_functions,
    hint_about_uncalled_function,
    hint_about_single_reading,
    hint_about_skipped_loop,
    hint_about_discarded_value,
    hint_about_unindented_statement,
    hint_about_output_below_loop,
    hint_about_stale_twin,
    hint_about_kept_value,
)
_RESULT_RULES: Sequence[Rule] = (
    hint_about_silent_agent,
    hint_about_unasked_agent,
    hint_about_text_of_agent,
    hint_about_printed_object,
    hint_about_missing_else,
    hint_about_swapped_sides,
    hint_about_missing_frame,
    hint_about_quoted_values,
    hint_about_returned_pair,
    hint_about_quoted_object,
    hint_about_large_step,
    hint_about_raw_light,
    hint_about_raw_report,
    hint_about_wrong_scale,
    hint_about_pixel_step,
    hint_about_hasty_resending,
    hint_about_zero_pass,
    hint_about_added_factor,
    hint_about_spoken_name,
    hint_about_first_message,
    hint_about_overlapping_speech,
    hint_about_short_waits,
    hint_about_functions,
    hint_about_hidden_prefix,
    hint_about_division,
    hint_about_image_command,
    hint_about_none_answers,
    hint_about_shifted_numbers,
    hint_about_swapped_values,
    hint_about_texts,
    hint_about_unspoken_text,
    hint_about_missing_series,
    hint_about_recognition,
    hint_about_units,
    hint_about_turns,
    hint_about_missing_turn,
    hint_about_curves,
    hint_about_speeds,
    hint_about_distances,
    hint_about_range_start,
    hint_about_range_step,
    hint_about_unused_parameter,
    hint_about_missing_reverse,
    hint_about_mirrored_end,
    hint_about_gain,
    hint_about_reversed_distance,
    hint_about_first_value,
    hint_about_radius,
    hint_about_joined_colours,
    hint_about_partial_reading,
    hint_about_thresholds,
    hint_about_rare_readings,
    hint_about_swallowed_flags,
    hint_about_swapped_ports,
    hint_about_swapped_atan2,
    hint_about_repeated_words,
    hint_about_inner_loop,
    hint_about_last_number,
    hint_about_early_output,
    hint_about_exact_reading,
    hint_about_few_samples,
    hint_about_few_images,
    hint_about_short_loop,
    hint_about_single_reaction,
    hint_about_unused_value,
)
#: Rules for failures without a known mistake. The first that applies is used.
_FALLBACK_RULES: Sequence[Rule] = (
    hint_about_failed_cell,
    hint_about_several_programs,
    hint_about_unentered_loop,
    hint_about_answer_values,
    hint_about_returned_values,
    hint_about_narrow_except,
    hint_about_wrong_number,
    hint_about_failure_line,
    hint_about_cause_line,
)


def collect_hints(
    submission: Submission,
    plan: RunPlan,
    trials: Sequence[TrialResult],
    results: Sequence[CriterionResult],
    heartbeat: Callable[[], None] = lambda: None,
) -> tuple[str, ...]:
    """Return hints, the most useful first. With full visible marks, return accepted differences instead.

    Returns None if it takes too long.

    Raises:
        Exception: Whatever ``collect_within_limits`` raises.
    """
    visible_results = [result for result in results if result.visibility == "visible"]
    rules = (
        collect_accepted_differences
        if all(result.marks >= result.max_marks for result in visible_results)
        else _collect_all_hints
    )
    return collect_within_limits(trials, lambda: rules(collect_clues(submission, plan, trials, results)), heartbeat)


def _collect_all_hints(clues: Clues) -> tuple[str, ...]:
    return (*collect_near_misses(clues), *collect_accepted_differences(clues))[:_MAX_HINTS]


def collect_near_misses(clues: Clues) -> tuple[str, ...]:
    """Return everything that the rules find, regardless of marks. Problems that prevent everything else come first."""
    explained_errors = _apply_rules(_ERROR_RULES, clues)
    errors = explained_errors or _apply_rules((hint_about_errors,), clues)
    message_hints = _apply_rules(_MESSAGE_RULES, clues)
    slips = () if errors else _apply_rules((hint_about_slips,), clues)
    limits = () if errors or slips else _apply_rules(_LIMIT_RULES, clues)
    structure = () if errors else _apply_rules(_STRUCTURE_RULES, clues)
    stillness = () if errors or slips or limits or structure else _apply_rules((hint_about_stillness,), clues)
    leading_hints = (*explained_errors, *message_hints) if explained_errors else (*message_hints, *errors)
    all_hints = (
        *_apply_rules(_FILE_RULES, clues),
        *leading_hints,
        *slips,
        *limits,
        *structure,
        *stillness,
        *_apply_rules(_RESULT_RULES, clues),
    )
    all_hints = all_hints or next(filter(None, (_apply_rules((rule,), clues) for rule in _FALLBACK_RULES)), ())
    return tuple(dict.fromkeys(all_hints))[:_MAX_HINTS]


def _apply_rules(rules: Sequence[Rule], clues: Clues) -> tuple[str, ...]:
    return tuple(sentence for rule in rules for sentence in _apply_rule(rule, clues))


def _apply_rule(rule: Rule, clues: Clues) -> tuple[str, ...]:
    """Return the hints of one rule. A rule that fails is logged and gives none, and the others still apply."""
    try:
        return tuple(rule(clues))
    except MemoryError:
        raise  # the search for hints has exceeded its limits
    except Exception:
        _log.warning("%s failed, so it gives no hint", rule.__name__, exc_info=True)
        return ()


def collect_accepted_differences(clues: Clues) -> tuple[str, ...]:
    """Return one sentence each on words and on keys that differ from the description. Empty if none do."""
    return _apply_rules((hint_about_other_words, hint_about_missing_keys, hint_about_called_responder), clues)
