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
)
from service.grading.hint_texts import of_texts
from service.grading.run_plan import RunPlan
from submissions.submission import Submission

_MOST = 5
#: What keeps everything else from happening comes first.
_RULES: Sequence[Callable[[Clues], Iterator[str]]] = (
    of_missing_files,
    of_magics,
    of_responder_names,
    of_errors,
    of_messages,
    of_images,
    of_printed_answers,
    of_answers,
    of_texts,
)


def hints_for(
    submission: Submission, plan: RunPlan, trials: Sequence[TrialResult], results: Sequence[CriterionResult]
) -> tuple[str, ...]:
    """The most telling first; none where every criterion that is shown has full marks."""
    shown = [result for result in results if result.visibility == "visible"]
    if all(result.marks >= result.max_marks for result in shown):
        return ()
    return near_misses(clues_of(submission, plan, trials, results))


def near_misses(clues: Clues) -> tuple[str, ...]:
    """All that the rules find, whatever the marks."""
    found = (sentence for rule in _RULES for sentence in rule(clues))
    return tuple(dict.fromkeys(found))[:_MOST]
