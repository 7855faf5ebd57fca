"""Likely mistakes, as sentences that quote the code with its line and state what was expected.

The hints are a pure function of the submission, the visible trials and the assignment. Marks don't depend on them. If
all visible criteria have full marks, they only report what was accepted although it differs from the description: other
words, or missing keys.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence

from service.grading import (
    hint_accepted,
    hint_agents,
    hint_answer_forms,
    hint_answers,
    hint_braces,
    hint_cause_lines,
    hint_colours,
    hint_counterfactuals,
    hint_counting,
    hint_driving,
    hint_errors,
    hint_exchanges,
    hint_failure_lines,
    hint_files,
    hint_formats,
    hint_formulas,
    hint_functions,
    hint_logic,
    hint_loops,
    hint_motion,
    hint_outputs,
    hint_passes,
    hint_recognition,
    hint_repetition,
    hint_responder,
    hint_rules,
    hint_scale,
    hint_signatures,
    hint_skipped_loops,
    hint_slips,
    hint_structure,
    hint_texts,
    hint_thresholds,
    hint_timing,
    hint_values,
)
from service.grading.grade import CriterionResult, TrialResult
from service.grading.hint_clues import Clues, collect_clues
from service.grading.judging.limited_judging import collect_within_limits
from service.grading.run_plan import RunPlan
from submissions.submission import Submission

_log = logging.getLogger(__name__)

_MAX_HINTS = 5
Rule = Callable[[Clues], Iterator[str]]
#: Problems that prevent everything else.
_FILE_RULES: Sequence[Rule] = (
    hint_formats.hint_about_missing_files,
    hint_formats.hint_about_empty_parts,
    hint_files.hint_about_starter_files,
    hint_files.hint_about_swapped_parts,
)
#: Rules that explain an error better than its message. The message is used if none of them applies.
_ERROR_RULES: Sequence[Rule] = (
    hint_responder.hint_about_helper_as_responder,
    hint_formats.hint_about_magics,
    hint_errors.hint_about_cell_errors,
    hint_responder.hint_about_misnamed_function,
    hint_responder.hint_about_missing_responder,
    hint_responder.hint_about_uncallable_responder,
    hint_responder.hint_about_unreturned_answers,
    hint_responder.hint_about_unreadable_answers,
    hint_functions.hint_about_missing_return,
    hint_answers.hint_about_missing_key,
    hint_responder.hint_about_unqueued_answers,
    hint_signatures.hint_about_signatures,
    hint_slips.hint_about_missing_comma,
    hint_exchanges.hint_about_all_channels,
)
#: Rules for the causes of errors.
_MESSAGE_RULES: Sequence[Rule] = (
    hint_formats.hint_about_messages,
    hint_formats.hint_about_quoted_names,
    hint_braces.hint_about_braces,
    hint_formats.hint_about_images,
    hint_formats.hint_about_image_log,
    hint_responder.hint_about_double_json,
    hint_responder.hint_about_single_colon,
    hint_responder.hint_about_wrong_prefix,
    hint_formats.hint_about_answers,
    hint_texts.hint_about_sent_texts,
    hint_answers.hint_about_other_keys,
    hint_answers.hint_about_text_numbers,
)
#: Rules for programs that ran into a limit.
_LIMIT_RULES: Sequence[Rule] = (
    hint_structure.hint_about_stop_in_loop,
    hint_formulas.hint_about_gyro_direction,
    hint_driving.hint_about_stop_before_loop,
    hint_loops.hint_about_limits,
)
#: Rules for programs that finished but did too little, the most certain first.
_STRUCTURE_RULES: Sequence[Rule] = (
    hint_files.hint_about_ignored_magic,
    hint_structure.hint_about_missing_brackets,
    hint_structure.hint_about_replaced_function,
    hint_files.hint_about_redefined_functions,
    hint_structure.hint_about_uncalled_function,
    hint_driving.hint_about_unwaited_move,
    hint_structure.hint_about_single_reading,
    hint_colours.hint_about_opposite_condition,
    hint_colours.hint_about_shared_colour,
    hint_skipped_loops.hint_about_skipped_loop,
    hint_structure.hint_about_discarded_value,
    hint_structure.hint_about_unindented_statement,
    hint_structure.hint_about_output_below_loop,
    hint_passes.hint_about_stale_twin,
    hint_passes.hint_about_kept_value,
)
_RESULT_RULES: Sequence[Rule] = (
    hint_agents.hint_about_silent_agent,
    hint_agents.hint_about_unasked_agent,
    hint_agents.hint_about_text_of_agent,
    hint_outputs.hint_about_printed_object,
    hint_outputs.hint_about_missing_else,
    hint_outputs.hint_about_swapped_sides,
    hint_answer_forms.hint_about_missing_frame,
    hint_answer_forms.hint_about_quoted_values,
    hint_answers.hint_about_returned_pair,
    hint_answers.hint_about_quoted_object,
    hint_logic.hint_about_large_step,
    hint_motion.hint_about_raw_light,
    hint_scale.hint_about_raw_report,
    hint_scale.hint_about_colour_number,
    hint_scale.hint_about_wrong_scale,
    hint_recognition.hint_about_pixel_step,
    hint_exchanges.hint_about_smallest_chance,
    hint_exchanges.hint_about_exchanged_axes,
    hint_exchanges.hint_about_near_prefix,
    hint_exchanges.hint_about_counted_rest,
    hint_exchanges.hint_about_exchanged_words,
    hint_exchanges.hint_about_returned_object,
    hint_passes.hint_about_hasty_resending,
    hint_passes.hint_about_zero_pass,
    hint_passes.hint_about_added_factor,
    hint_logic.hint_about_spoken_name,
    hint_logic.hint_about_first_message,
    hint_timing.hint_about_overlapping_speech,
    hint_timing.hint_about_short_waits,
    hint_functions.hint_about_functions,
    hint_functions.hint_about_hidden_prefix,
    hint_rules.hint_about_rules,
    hint_rules.hint_about_missing_branch,
    hint_formulas.hint_about_division,
    hint_answers.hint_about_image_command,
    hint_answers.hint_about_none_answers,
    hint_answers.hint_about_shifted_numbers,
    hint_answers.hint_about_swapped_values,
    hint_texts.hint_about_texts,
    hint_texts.hint_about_unspoken_text,
    hint_texts.hint_about_missing_series,
    hint_recognition.hint_about_recognition,
    hint_motion.hint_about_units,
    hint_motion.hint_about_turns,
    hint_motion.hint_about_missing_turn,
    hint_motion.hint_about_curves,
    hint_motion.hint_about_speeds,
    hint_motion.hint_about_distances,
    hint_logic.hint_about_range_start,
    hint_logic.hint_about_range_step,
    hint_counting.hint_about_first_number,
    hint_counting.hint_about_count_step,
    hint_counting.hint_about_pass_count,
    hint_logic.hint_about_unused_parameter,
    hint_logic.hint_about_missing_reverse,
    hint_logic.hint_about_mirrored_end,
    hint_formulas.hint_about_gain,
    hint_formulas.hint_about_reversed_distance,
    hint_logic.hint_about_first_value,
    hint_formulas.hint_about_radius,
    hint_thresholds.hint_about_joined_colours,
    hint_values.hint_about_partial_reading,
    hint_thresholds.hint_about_thresholds,
    hint_timing.hint_about_rare_readings,
    hint_values.hint_about_swallowed_flags,
    hint_values.hint_about_swapped_ports,
    hint_values.hint_about_swapped_atan2,
    hint_driving.hint_about_radians,
    hint_driving.hint_about_straight_turn,
    hint_driving.hint_about_single_images,
    hint_driving.hint_about_hurried_images,
    hint_repetition.hint_about_repeated_words,
    hint_repetition.hint_about_inner_loop,
    hint_repetition.hint_about_last_number,
    hint_repetition.hint_about_early_output,
    hint_repetition.hint_about_exact_reading,
    hint_values.hint_about_few_samples,
    hint_values.hint_about_few_images,
    hint_passes.hint_about_short_loop,
    hint_repetition.hint_about_single_reaction,
    hint_values.hint_about_unused_value,
)
#: Rules for failures without a known mistake. The first that applies is used.
_FALLBACK_RULES: Sequence[Rule] = (
    hint_errors.hint_about_failed_cell,
    hint_files.hint_about_several_programs,
    hint_failure_lines.hint_about_unentered_loop,
    hint_answers.hint_about_answer_values,
    hint_functions.hint_about_returned_values,
    hint_functions.hint_about_narrow_except,
    hint_counterfactuals.hint_about_wrong_number,
    hint_failure_lines.hint_about_failure_line,
    hint_cause_lines.hint_about_cause_line,
)
#: Rules for what was accepted although it differs from the description.
_ACCEPTED_RULES: Sequence[Rule] = (
    hint_accepted.hint_about_other_words,
    hint_accepted.hint_about_missing_keys,
    hint_accepted.hint_about_called_responder,
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
    errors = explained_errors or _apply_rules((hint_errors.hint_about_errors,), clues)
    message_hints = _apply_rules(_MESSAGE_RULES, clues)
    slips = () if errors else _apply_rules((hint_slips.hint_about_slips,), clues)
    limits = () if errors or slips else _apply_rules(_LIMIT_RULES, clues)
    structure = () if errors else _apply_rules(_STRUCTURE_RULES, clues)
    has_reason = errors or slips or limits or structure
    stillness = () if has_reason else _apply_rules((hint_motion.hint_about_stillness,), clues)
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
    return _apply_rules(_ACCEPTED_RULES, clues)
