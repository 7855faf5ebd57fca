"""What probably went wrong, in sentences that quote it, with its line, and say what was expected.

A pure function of the submission, what happened in the trials that its student may see, and what is asked. No mark
depends on it, and where nothing that is shown is missing it says nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from service.grading.grade import CriterionResult, TrialResult
from service.grading.hint_clues import Clues, clues_of
from service.grading.hint_rules import (
    of_answers,
    of_errors,
    of_images,
    of_magics,
    of_messages,
    of_missing_files,
    of_printed_answers,
    of_responder_names,
    of_stillness,
)
from service.grading.hint_texts import of_texts, of_unspoken
from service.grading.judging.bounded import sentences_within
from service.grading.run_plan import RunPlan
from submissions.submission import Submission

_MOST = 5
Rule = Callable[[Clues], Iterator[str]]
#: What explains an error better than its own words do; those are told where none of these does.
_OF_ERRORS: Sequence[Rule] = (of_magics, of_responder_names, of_printed_answers)
#: What errors come of.
_OF_MESSAGES: Sequence[Rule] = (of_messages, of_images, of_answers)


def hints_for(
    submission: Submission,
    plan: RunPlan,
    trials: Sequence[TrialResult],
    results: Sequence[CriterionResult],
    heartbeat: Callable[[], None] = lambda: None,
) -> tuple[str, ...]:
    """The most telling first; none where every criterion that is shown has full marks, or if it takes too long.

    Raises what ``sentences_within`` raises.
    """
    shown = [result for result in results if result.visibility == "visible"]
    if all(result.marks >= result.max_marks for result in shown):
        return ()
    return sentences_within(trials, lambda: near_misses(clues_of(submission, plan, trials, results)), heartbeat)


def near_misses(clues: Clues) -> tuple[str, ...]:
    """All that the rules find, whatever the marks; what keeps everything else from happening first."""
    explained = _found(_OF_ERRORS, clues)
    errors = () if explained else tuple(of_errors(clues))
    still = () if explained or errors else tuple(of_stillness(clues))
    told = (*_found(_OF_MESSAGES, clues), *errors, *still, *of_texts(clues), *of_unspoken(clues))
    found = (*of_missing_files(clues), *explained, *told)
    return tuple(dict.fromkeys(found))[:_MOST]


def _found(rules: Sequence[Rule], clues: Clues) -> tuple[str, ...]:
    return tuple(sentence for rule in rules for sentence in rule(clues))
