"""Likely mistakes, as sentences that quote the code with its line and state what was expected.

The hints are a pure function of the submission, the visible trials and the assignment. Marks don't depend on them. If
all visible criteria have full marks, they only report what was accepted although it differs from the description: other
words, or missing keys.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence

from responders.message_format import JSON
from service.grading.grade import CriterionResult, TrialResult
from service.grading.hint_answers import (
    of_answer_values,
    of_image_command,
    of_missing_key,
    of_none_answers,
    of_other_keys,
    of_shifted_numbers,
    of_swapped_values,
    of_text_numbers,
)
from service.grading.hint_braces import of_braces
from service.grading.hint_clues import LONGEST_TEXT, Clues, clues_of
from service.grading.hint_errors import of_cell_errors, of_errors, of_other_cell_errors
from service.grading.hint_files import of_ignored_magic, of_redefined, of_several_programs, of_starter, of_swapped_parts
from service.grading.hint_formulas import of_division, of_gain, of_gyro_direction, of_radius, of_reversed_distance
from service.grading.hint_functions import of_functions, of_narrow_except, of_no_return, of_returned_values
from service.grading.hint_loops import of_limits
from service.grading.hint_moments import of_loops_that_never_run, of_moments
from service.grading.hint_motion import (
    of_curves,
    of_distances,
    of_loops_that_end_at_once,
    of_speeds,
    of_stillness,
    of_turns,
    of_units,
)
from service.grading.hint_places import of_places
from service.grading.hint_recognition import of_recognition
from service.grading.hint_repeats import (
    of_exact_reading,
    of_inner_loop,
    of_last_number,
    of_single_round,
    of_words_in_loop,
)
from service.grading.hint_responder import (
    of_double_json,
    of_misnamed_function,
    of_missing_responder,
    of_printed_answers,
    of_replaced_prefix,
    of_single_colon,
    of_uncallable_responder,
    of_unqueued_answers,
    of_unreadable_answers,
)
from service.grading.hint_rules import (
    RETURNS,
    of_answers,
    of_empty_parts,
    of_image_log,
    of_images,
    of_magics,
    of_messages,
    of_missing_files,
    of_quoted_names,
    where_returned,
)
from service.grading.hint_signatures import of_signatures
from service.grading.hint_slips import of_short_list, of_slips
from service.grading.hint_steps import (
    of_count_from_one,
    of_first_message,
    of_first_value,
    of_mirrored_end,
    of_no_way_back,
    of_other_step,
    of_spoken_name,
    of_unused_parameter,
)
from service.grading.hint_structure import (
    of_no_effect,
    of_replaced,
    of_single_look,
    of_stop_in_loop,
    of_unbracketed,
    of_uncalled,
    of_unindented,
)
from service.grading.hint_texts import Wanted, is_near, of_sent_texts, of_texts, of_unlogged, of_unspoken, where_written
from service.grading.hint_thresholds import of_joined_colours, of_thresholds
from service.grading.hint_timing import of_overlapping_speech, of_seldom_looks, of_short_waits
from service.grading.hint_unused import (
    of_few_images,
    of_few_samples,
    of_partial_reading,
    of_swallowed_flags,
    of_swapped_atan2,
    of_swapped_ports,
    of_unread,
)
from service.grading.hint_what_if import of_what_if
from service.grading.judging.bounded import sentences_within
from service.grading.judging.message_parts import quoted
from service.grading.run_plan import RunPlan
from submissions.submission import Part, Submission

_MOST = 5
Rule = Callable[[Clues], Iterator[str]]
#: Problems that prevent everything else.
_OF_FILES: Sequence[Rule] = (of_missing_files, of_empty_parts, of_starter, of_swapped_parts)
#: Rules that explain an error better than its message. The message is used if none of them applies.
_OF_ERRORS: Sequence[Rule] = (
    of_magics,
    of_cell_errors,
    of_misnamed_function,
    of_missing_responder,
    of_uncallable_responder,
    of_printed_answers,
    of_unreadable_answers,
    of_no_return,
    of_missing_key,
    of_unqueued_answers,
    of_signatures,
    of_short_list,
)
#: Rules for the causes of errors.
_OF_MESSAGES: Sequence[Rule] = (
    of_messages,
    of_quoted_names,
    of_braces,
    of_images,
    of_image_log,
    of_double_json,
    of_single_colon,
    of_replaced_prefix,
    of_answers,
    of_sent_texts,
    of_other_keys,
    of_text_numbers,
)
#: Rules for programs that finished but did too little, the most certain first.
_OF_STRUCTURE: Sequence[Rule] = (
    of_ignored_magic,
    of_unbracketed,
    of_replaced,
    of_redefined,
    of_uncalled,
    of_single_look,
    of_loops_that_end_at_once,
    of_no_effect,
    of_unindented,
)
_OF_RESULTS: Sequence[Rule] = (
    of_spoken_name,
    of_first_message,
    of_overlapping_speech,
    of_short_waits,
    of_functions,
    of_division,
    of_image_command,
    of_none_answers,
    of_shifted_numbers,
    of_swapped_values,
    of_texts,
    of_unspoken,
    of_unlogged,
    of_recognition,
    of_units,
    of_turns,
    of_curves,
    of_speeds,
    of_distances,
    of_count_from_one,
    of_other_step,
    of_unused_parameter,
    of_no_way_back,
    of_mirrored_end,
    of_gain,
    of_reversed_distance,
    of_first_value,
    of_radius,
    of_joined_colours,
    of_partial_reading,
    of_thresholds,
    of_seldom_looks,
    of_swallowed_flags,
    of_swapped_ports,
    of_swapped_atan2,
    of_words_in_loop,
    of_inner_loop,
    of_last_number,
    of_exact_reading,
    of_few_samples,
    of_few_images,
    of_single_round,
    of_unread,
)
#: Rules for failures without a known mistake. The first that applies is used.
_IF_NOTHING_ELSE: Sequence[Rule] = (
    of_other_cell_errors,
    of_several_programs,
    of_loops_that_never_run,
    of_answer_values,
    of_returned_values,
    of_narrow_except,
    of_what_if,
    of_moments,
    of_places,
)
_QUOTED = re.compile(r'"([^"]{6,60})"')
_KEY = re.compile(r'"(\w+)"\s*:')
_VARIES = re.compile(r"\d|[{}<>:]")


def hints_for(
    submission: Submission,
    plan: RunPlan,
    trials: Sequence[TrialResult],
    results: Sequence[CriterionResult],
    heartbeat: Callable[[], None] = lambda: None,
) -> tuple[str, ...]:
    """Return hints, the most useful first. With full visible marks, return accepted differences instead.

    Returns None if it takes too long.

    Raises:
        Exception: Whatever ``sentences_within`` raises.
    """
    shown = [result for result in results if result.visibility == "visible"]
    rules = accepted_differences if all(result.marks >= result.max_marks for result in shown) else _near_and_accepted
    return sentences_within(trials, lambda: rules(clues_of(submission, plan, trials, results)), heartbeat)


def _near_and_accepted(clues: Clues) -> tuple[str, ...]:
    return (*near_misses(clues), *accepted_differences(clues))[:_MOST]


def near_misses(clues: Clues) -> tuple[str, ...]:
    """Return everything that the rules find, regardless of marks. Problems that prevent everything else come first."""
    explained = _found(_OF_ERRORS, clues)
    errors = explained or tuple(of_errors(clues))
    sent = _found(_OF_MESSAGES, clues)
    slips = () if errors else tuple(of_slips(clues))
    limits = () if errors or slips else (*of_stop_in_loop(clues), *of_gyro_direction(clues), *of_limits(clues))
    structure = () if errors else _found(_OF_STRUCTURE, clues)
    still = () if errors or slips or limits or structure else tuple(of_stillness(clues))
    first = (*explained, *sent) if explained else (*sent, *errors)
    found = (*_found(_OF_FILES, clues), *first, *slips, *limits, *structure, *still, *_found(_OF_RESULTS, clues))
    found = found or next(filter(None, (tuple(rule(clues)) for rule in _IF_NOTHING_ELSE)), ())
    return tuple(dict.fromkeys(found))[:_MOST]


def _found(rules: Sequence[Rule], clues: Clues) -> tuple[str, ...]:
    return tuple(sentence for rule in rules for sentence in rule(clues))


def accepted_differences(clues: Clues) -> tuple[str, ...]:
    """Return one sentence each on words and on keys that differ from the description. Empty if none do."""
    task = " ".join(clues.task.split())
    return (*_other_words(task, clues), *_missing_keys(task, clues))


def _other_words(task: str, clues: Clues) -> Iterator[str]:
    texts: Sequence[tuple[Part, str, Sequence[str]]] = (
        ("program", "says", clues.spoken),
        ("program", "prints", clues.printed),
        ("responder", "answers", clues.answers),
    )
    for asked in _QUOTED.findall(task):
        begin = asked.partition("...")[0].strip()
        if len(begin.split()) < 2 or _VARIES.search(begin):
            continue
        wanted = Wanted(begin, "contains")
        if any(wanted.is_met_by(text, ignore_case=True) for _, _, found in texts for text in found):
            continue
        for part, verb, found in texts:
            near = next((text for text in found if is_near(wanted, text)), None)
            if near is not None:
                where = where_written(clues, part, near)
                yield f"{where} {verb} {quoted(near)}; the assignment asks for {quoted(begin)}"
                return


def _missing_keys(task: str, clues: Clues) -> Iterator[str]:
    asked = list(dict.fromkeys(key for form in _forms(task) for key in _KEY.findall(form)))
    answers = [text for text in clues.answers if text.startswith(JSON) and len(text) < LONGEST_TEXT]
    given = {key for text in answers for key in _KEY.findall(text)}
    missing = [key for key in asked if key not in given]
    if missing and given:
        where = where_returned(answers[0], clues, RETURNS)
        keys = " and ".join(map(quoted, missing[:3]))
        yield f"{where}: the answer is {quoted(answers[0])}, without {keys}, which the assignment asks for"


def _forms(task: str) -> Iterator[str]:
    """Yield each object after ``JSON::``, up to its closing bracket."""
    for piece in task.split(JSON)[1:]:
        depth = 0
        for place, letter in enumerate(piece):
            depth += (letter == "{") - (letter == "}")
            if depth == 0:
                yield piece[: place + 1]
                break
