"""Judging: from an assignment and what happened in its trials to one result a criterion.

How each kind is judged is in the module of the kind; here they are gathered, marked, and put into words for
a student.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from service.grading.classification import Classified, classify, told
from service.grading.ending import judge_finishes, judge_pose
from service.grading.grade import CriterionResult, Evidence, TrialResult
from service.grading.marks import earned, share_of, share_of_accuracy
from service.grading.outcome import Outcome, cut, fault_words
from service.grading.replies import judge_replies
from service.grading.texts import judge_messages, judge_prints, judge_says
from sim.errors import HostError
from sim.recording import Verdict
from submissions.assignment import Assignment
from submissions.criteria import (
    Classification,
    Criterion,
    EndPose,
    Finishes,
    Messages,
    Prints,
    Replies,
    Says,
)

#: How each kind of criterion is judged in one trial; classification, which pools its trials, is apart.
_JUDGES: Mapping[type, Callable[[Any, TrialResult], Outcome]] = MappingProxyType(
    {
        Finishes: judge_finishes,
        Prints: judge_prints,
        Says: judge_says,
        Messages: judge_messages,
        Replies: judge_replies,
        EndPose: judge_pose,
    }
)

_Indexed = Sequence[tuple[int, TrialResult]]


def judge(assignment: Assignment, trials: tuple[TrialResult, ...]) -> tuple[CriterionResult, ...]:
    """One result for each criterion of the assignment, in its order.

    A trial that was cut short is judged by what was reached. Raises HostError for a trial that this machine
    spoilt, because such a trial must be run again, not marked.
    """
    if any(trial.verdict is Verdict.HOST_ERROR for trial in trials):
        raise HostError("A trial that failed on this machine cannot be marked; it has to be run again.")
    return tuple(_judge_one(criterion, assignment, trials) for criterion in assignment.criteria)


def _judge_one(criterion: Criterion, assignment: Assignment, trials: Sequence[TrialResult]) -> CriterionResult:
    own = [
        (index, trial)
        for index, trial in enumerate(trials)
        if not criterion.scenarios or trial.scenario in criterion.scenarios
    ]
    if isinstance(criterion, Classification):
        return _classified(criterion, classify(criterion, assignment, own), own)
    outcomes = [_JUDGES[type(criterion)](criterion, trial) for _, trial in own]
    return CriterionResult(
        id=criterion.id,
        title=criterion.title,
        marks=earned(criterion.marks, share_of(outcomes, criterion.over)),
        max_marks=criterion.marks,
        message=_summary(own, outcomes),
        visibility=criterion.visibility,
        evidence=tuple(
            Evidence(index, outcome.passed, outcome.message, outcome.t, outcome.pose, outcome.measures)
            for (index, _), outcome in zip(own, outcomes, strict=True)
        ),
    )


def _classified(criterion: Classification, found: Classified, trials: _Indexed) -> CriterionResult:
    accuracy = found.accuracy
    right = sum(naming.right for naming in found.namings)
    by_index = dict(trials)
    wrong = [naming for naming in found.namings if not naming.right]
    first = next((naming for naming in wrong if by_index[naming.trial].visibility == "visible"), None)
    message = (
        f"{right} of {accuracy.n} pictures named rightly: accuracy {accuracy.value:.2f} "
        f"(95 % interval {accuracy.low:.2f} to {accuracy.high:.2f})."
    )
    if criterion.at_least is not None and wrong:
        message += f" All marks are given from {criterion.at_least:g} on."
    if first is not None:
        trial = by_index[first.trial]
        t = first.image.t if first.image else None
        message += f" {_place(trial, t)}: {told(first)}{_early_end(trial)}"
    return CriterionResult(
        id=criterion.id,
        title=criterion.title,
        marks=earned(criterion.marks, share_of_accuracy(right, accuracy.n, criterion.at_least, criterion.over)),
        max_marks=criterion.marks,
        message=message,
        visibility=criterion.visibility,
        evidence=found.evidence,
        accuracy=accuracy,
        sights=found.sights,
    )


def _summary(trials: _Indexed, outcomes: Sequence[Outcome]) -> str:
    """What to tell the student: how many trials went well, and what happened in the first that did not.

    Of trials that are not shown to students it tells only how many went wrong.
    """
    count = len(outcomes)
    passes = sum(outcome.passed for outcome in outcomes)
    if count and passes == count:
        shown = count == 1 and trials[0][1].visibility == "visible"
        return outcomes[0].message if shown else f"As expected in all {count} trials."
    tally = f"{passes} of {count} trials went as expected. " if count != 1 else ""
    for (_, trial), outcome in zip(trials, outcomes, strict=True):
        if not outcome.passed and trial.visibility == "visible":
            return f"{tally}{_place(trial, outcome.t)}: {outcome.message}{_early_end(trial, outcome)}"
    return f"{tally}What went wrong happened in a scenario that is not shown."


def _place(trial: TrialResult, t: float | None) -> str:
    """``In scenario line, from (100, 800) facing 0°, with light noise 32, at 3.00 s``."""
    start = trial.recording.start
    words = [f"In scenario {trial.scenario}, from ({start.x:g}, {start.y:g}) facing {start.heading:g}°"]
    if trial.light_noise:
        words.append(f"with light noise {trial.light_noise:g}")
    if trial.motor_noise:
        words.append(f"with motor noise {trial.motor_noise:g}")
    if t is not None:
        words.append(f"at {t:.2f} s")
    return ", ".join(words)


def _early_end(trial: TrialResult, outcome: Outcome | None = None) -> str:
    """Why the run ended before its time, unless the outcome tells already."""
    fault = cut(trial.recording)
    if fault is None or (outcome is not None and fault_words(fault) in outcome.message):
        return ""
    return f" The run ended early, at {fault.t:.2f} s."
