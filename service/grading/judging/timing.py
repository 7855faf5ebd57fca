"""Judging of durations, and of values that another criterion measured.

All times are simulated, so the speed of the machine makes no difference.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from service.grading.grade import CriterionResult, Evidence, Measure, TrialResult
from service.grading.judging.judges import Case, by_trial, judges, judges_case
from service.grading.judging.outcome import Outcome, failed, passed
from service.grading.judging.text_tokens import spoken_until
from sim.recorded import seconds_at
from sim.recording import Recording
from submissions.criteria.timing import Ranking, Timing

_STILL = 1e-6  # mm or degrees per tick


@judges(Timing)
def judge_timing(criterion: Timing, trial: TrialResult) -> Outcome:
    """Judge the duration in simulated seconds. The bounds are included."""
    recording = trial.recording
    seconds, what = _seconds(criterion, recording)
    least, most = criterion.between
    measures = (Measure("time", seconds, "s"),)
    if least - 1e-9 <= seconds <= most + 1e-9:
        return passed(f"{what} took {seconds:.2f} s.", recording.end_t, recording.end, measures)
    return failed(
        f"Expected {what[0].lower()}{what[1:]} to take from {least:g} to {most:g} s, but it took {seconds:.2f} s.",
        recording.end_t,
        recording.end,
        measures=measures,
    )


@judges_case(Ranking)
def judge_ranking(criterion: Ranking, case: Case) -> CriterionResult:
    """Judge the value that another criterion measured in each trial."""
    other = case.results.get(criterion.of)
    return by_trial(criterion, case, lambda index, _: _ranked(criterion, index, other))


def _ranked(criterion: Ranking, place: int, other: CriterionResult | None) -> Outcome:
    """Return the outcome for the value of trial ``place``; no marks if the other criterion failed."""
    evidence = next((each for each in other.evidence if each.trial == place), None) if other else None
    measure = _measure(criterion, evidence)
    if evidence is None or measure is None:
        return failed(f"Expected a {criterion.measure}, but none was measured.")
    unit = f" {measure.unit}" if measure.unit else ""
    found = f"{criterion.measure}: {measure.value:.2f}{unit}"
    if not evidence.passed:
        # Values that don't count are left out of the ranking.
        return failed(f"The {found} does not count: {evidence.message}", evidence.t, evidence.pose)
    share = _share(criterion, measure.value)
    best = criterion.steps[0][0]
    if share == 1:
        return passed(f"The {found}.", evidence.t, evidence.pose, (measure,))
    bound = "at least" if criterion.highest else "at most"
    # The instructor defined the share, so it is not capped like a measured score.
    return Outcome(
        False,
        share,
        f"The {found} is worth {float(share) * 100:g}% of the marks; all are given for {bound} {best:g}{unit}.",
        evidence.t,
        evidence.pose,
        (measure,),
    )


def _share(criterion: Ranking, value: float) -> Fraction:
    for limit, share in criterion.steps:
        if (value >= limit - 1e-9) if criterion.highest else (value <= limit + 1e-9):
            return Fraction(str(share))
    return Fraction(0)


def _measure(criterion: Ranking, evidence: Evidence | None) -> Measure | None:
    measures = evidence.measures if evidence is not None else ()
    return next((measure for measure in measures if measure.name == criterion.measure), None)


def _seconds(criterion: Timing, recording: Recording) -> tuple[float, str]:
    match criterion.of:
        case "program":
            return recording.end_t, "The program"
        case "moving":
            return _moving(recording), "The movement"
        case "speech":
            return max(spoken_until(recording.spoken), default=0.0), "The speech"


def _moving(recording: Recording) -> float:
    ticks = recording.ticks
    if not len(ticks):
        return 0.0
    start = recording.start
    columns = ((start.x, ticks.x), (start.y, ticks.y), (start.heading, ticks.heading))
    changes = [np.abs(np.diff(column, prepend=first)) > _STILL for first, column in columns]
    return seconds_at(recording, int(np.logical_or.reduce(changes).sum()))
