"""Luck: how much marks change if one random stream of the trials is drawn again and everything else stays.

Reruns show it. No marks change.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Literal

from service.grading.grade import Grade
from service.grading.reruns.engine import Budget, BudgetSpent, RerunEngine
from service.grading.reruns.exchanges import Exchange, OtherDraw, OtherStart, RedrawnStream, draw_other_seed
from service.grading.run_plan import plan_run
from service.grading.trial_runner import TrialRunner
from submissions.assignment.definition import Assignment, Trial
from submissions.seeds import SeedSource
from submissions.submission import Submission

Stream = Literal["start pose"] | RedrawnStream
STREAMS: tuple[Stream, ...] = ("start pose", "light noise", "motor noise", "messages")
#: The key of the sum of all criteria among the variances.
_TOTAL = ""


@dataclass(frozen=True, slots=True)
class LuckOptions:
    """How many other draws of each stream to run, and how many CPU seconds all reruns may take together."""

    draws: int = 8
    cpu_seconds: float = 300.0


@dataclass(frozen=True, slots=True)
class GradedSubmission:
    """A stored grade with its submission, assignment and seeds."""

    grade: Grade
    submission: Submission
    assignment: Assignment
    secret: SeedSource


@dataclass(frozen=True, slots=True)
class SubmissionLuck:
    """The variances of one submission's marks, by criterion and stream, over the stored and ``draws`` other draws.

    ``streams`` are the random streams that its trials have. The criterion ``""`` is the sum of all.
    """

    variances: Mapping[tuple[str, Stream], float]
    streams: tuple[Stream, ...]
    draws: int
    cpu_seconds: float


@dataclass(frozen=True, slots=True)
class StreamLuck:
    """How much one stream changes a criterion's marks: the standard deviation, and the share of the variance.

    The share is of the sum of all streams' variances; None if that is 0.
    """

    stream: Stream
    deviation: float
    share: float | None


@dataclass(frozen=True, slots=True)
class CriterionLuck:
    """The standard deviation of a criterion's marks over all streams, and each stream's part of it."""

    id: str
    title: str
    max_marks: Decimal
    deviation: float
    streams: tuple[StreamLuck, ...]


@dataclass(frozen=True, slots=True)
class LuckReport:
    """The luck in the marks of some submissions for an assignment: each figure is a mean over ``submissions``.

    ``draws`` of ``planned_draws`` were run for all submissions together; the CPU time did not allow the others.
    ``unrepeatable`` submissions cannot be run again, such as those graded with another secret.
    """

    assignment: str
    streams: tuple[Stream, ...]
    criteria: tuple[CriterionLuck, ...]
    total: CriterionLuck | None
    submissions: int
    draws: int
    planned_draws: int
    unrepeatable: int
    cpu_seconds: float


def measure_luck(
    assignment: Assignment,
    loaders: Sequence[Callable[[], GradedSubmission | None]],
    runner: TrialRunner,
    options: LuckOptions,
    heartbeat: Callable[[], None] = lambda: None,
) -> LuckReport:
    """Return the luck in the marks of submissions for an assignment.

    Args:
        assignment: The assignment, whose criteria are listed.
        loaders: One for each submission, which returns it, or None if it cannot be run again.
        runner: Runs the trials.
        options: The number of draws, and the CPU time, which the submissions share.
        heartbeat: Called several times a second. It may raise an exception to stop.

    Raises:
        HostError: The machine failed.
    """
    results: list[SubmissionLuck] = []
    unrepeatable = 0
    seconds = options.cpu_seconds
    for number, load in enumerate(loaders):
        graded = load()
        if graded is None:
            unrepeatable += 1
            continue
        share = replace(options, cpu_seconds=seconds / (len(loaders) - number))
        results.append(measure_submission_luck(graded, runner, share, heartbeat))
        seconds -= results[-1].cpu_seconds
    measured = [each for each in results if each.draws]
    streams = tuple(stream for stream in STREAMS if any(stream in each.streams for each in measured))
    criteria = tuple(
        _build_criterion_luck(each.id, each.title, each.marks, streams, measured)
        for each in assignment.criteria
        if any((each.id, stream) in result.variances for result in measured for stream in streams)
    )
    max_marks = sum((each.max_marks for each in criteria), Decimal(0))
    return LuckReport(
        assignment.id,
        streams,
        criteria,
        _build_criterion_luck(_TOTAL, "all criteria", max_marks, streams, measured) if criteria else None,
        len(measured),
        sum(each.draws for each in results),
        options.draws * len(results),
        unrepeatable,
        options.cpu_seconds - seconds,
    )


def measure_submission_luck(
    graded: GradedSubmission,
    runner: TrialRunner,
    options: LuckOptions,
    heartbeat: Callable[[], None] = lambda: None,
) -> SubmissionLuck:
    """Return the variances of a submission's marks with one stream drawn again; raises like ``RerunEngine``."""
    plan = plan_run(graded.submission, graded.assignment, graded.secret)
    runner.start_zygotes(plan.processes)
    visibilities = frozenset(trial.visibility for trial in graded.grade.trials)
    marks: dict[tuple[str, Stream], list[float]] = {}
    streams: tuple[Stream, ...] = ()
    draws, cpu_seconds = 0, 0.0
    for number in range(options.draws):
        # An engine keeps its recordings, so each draw has its own.
        engine = RerunEngine(
            runner,
            plan,
            graded.grade,
            secret=graded.secret,
            visibilities=visibilities,
            budget=Budget(10**9, options.cpu_seconds - cpu_seconds),
            heartbeat=heartbeat,
        )
        streams = list_streams(engine)
        try:
            draw = {stream: _rerun_marks(engine, stream, number) for stream in streams}
        except BudgetSpent:
            cpu_seconds += engine.spent.cpu_seconds
            break
        cpu_seconds += engine.spent.cpu_seconds
        draws += 1
        for stream, marks_by_criterion in draw.items():
            for criterion, value in marks_by_criterion.items():
                marks.setdefault((criterion, stream), []).append(value)
    return SubmissionLuck(_compute_variances(graded.grade, marks, streams, draws), streams, draws, cpu_seconds)


def _compute_variances(
    grade: Grade, marks: Mapping[tuple[str, Stream], Sequence[float]], streams: Sequence[Stream], draws: int
) -> dict[tuple[str, Stream], float]:
    """Return the variances for the criteria that could be judged in every draw, and for their sum."""
    stored_marks = {
        result.id: float(result.marks)
        for result in grade.criteria
        if draws and all(len(marks.get((result.id, stream), ())) == draws for stream in streams)
    }
    variances: dict[tuple[str, Stream], float] = {}
    for stream in streams:
        values = {criterion: [stored, *marks[criterion, stream]] for criterion, stored in stored_marks.items()}
        if values:
            values[_TOTAL] = [sum(each) for each in zip(*values.values(), strict=True)]
        variances |= {(criterion, stream): statistics.variance(each) for criterion, each in values.items()}
    return variances


def list_streams(engine: RerunEngine) -> tuple[Stream, ...]:
    """Return the random streams that the trials of a grade have."""
    trials = engine.trials.values()
    has_messages = any(engine.results[index].recording.messages for index in engine.trials)
    present: Mapping[Stream, bool] = {
        "start pose": any(any(trial.scenario.start_jitter) for trial in trials),
        "light noise": any(trial.light_noise for trial in trials),
        "motor noise": any(trial.motor_noise for trial in trials),
        "messages": has_messages and any(map(_has_random_channel, trials)),
    }
    return tuple(stream for stream in STREAMS if present[stream])


def choose_spread(items: Sequence[str], count: int) -> tuple[str, ...]:
    """Return ``count`` of the items, or all if there are fewer: the first, the last, and evenly spaced ones between."""
    if len(items) <= count:
        return tuple(items)
    if count == 1:
        return (items[len(items) // 2],)
    return tuple(items[round(number * (len(items) - 1) / (count - 1))] for number in range(count))


def _has_random_channel(trial: Trial) -> bool:
    channel = trial.channel
    return any((channel.loss, channel.duplication, channel.reordering, channel.corruption, channel.jitter))


def _rerun_marks(engine: RerunEngine, stream: Stream, number: int) -> dict[str, float]:
    """Return the marks of each criterion with a stream drawn again. Raises BudgetSpent."""
    outcomes = engine.rerun(tuple(engine.trials), (_build_exchange(engine, stream, number),)).outcomes
    return {criterion: float(outcome.marks) for criterion, outcome in outcomes.items() if outcome.is_whole}


def _build_exchange(engine: RerunEngine, stream: Stream, number: int) -> Exchange:
    if stream != "start pose":
        return OtherDraw(stream, number)
    trials = [each.redraw_start(draw_other_seed(each.seed, stream, number)) for each in engine.trials.values()]
    return OtherStart(number, {each.seed: (each.pose, each.second_pose) for each in trials})


def _build_criterion_luck(
    criterion: str, title: str, max_marks: Decimal, streams: Sequence[Stream], results: Sequence[SubmissionLuck]
) -> CriterionLuck:
    """Return the mean over the submissions. A stream that a submission does not have changes nothing in it."""
    judged = [each for each in results if any(key == criterion for key, _ in each.variances)]
    variances = {
        stream: statistics.fmean(each.variances.get((criterion, stream), 0.0) for each in judged) if judged else 0.0
        for stream in streams
    }
    variance = sum(variances.values())
    return CriterionLuck(
        criterion,
        title,
        max_marks,
        math.sqrt(variance),
        tuple(
            StreamLuck(stream, math.sqrt(each), each / variance if variance else None)
            for stream, each in variances.items()
        ),
    )
