"""Judging of durations, and of values that another criterion measured.

All times are simulated, so the speed of the machine makes no difference.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from types import MappingProxyType

import numpy as np

from service.grading.grade import CriterionResult, Evidence, Measure, TrialResult
from service.grading.judging.judge_declaration import Case, declare_case_judge, declare_judge, judge_by_trial
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from service.grading.judging.text_tokens import compute_speech_ends
from service.language import translatable
from sim.recording import Recording
from sim.recording_values import tick_to_seconds
from sim.sentences import Sentence
from submissions.criteria.timing import Ranking, Timing

_MAX_STILL_CHANGE = 1e-6  # mm or degrees per tick
#: By what is measured: the messages for a duration that is as expected, and for one that is not.
_MESSAGES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "program": (
            translatable("The program took %(seconds).2f s."),
            translatable("Expected the program to take from %(least)g to %(most)g s, but it took %(seconds).2f s."),
        ),
        "moving": (
            translatable("The movement took %(seconds).2f s."),
            translatable("Expected the movement to take from %(least)g to %(most)g s, but it took %(seconds).2f s."),
        ),
        "speech": (
            translatable("The speech took %(seconds).2f s."),
            translatable("Expected the speech to take from %(least)g to %(most)g s, but it took %(seconds).2f s."),
        ),
    }
)


@declare_judge(Timing)
def judge_timing(criterion: Timing, trial: TrialResult) -> Outcome:
    """Judge the duration in simulated seconds. The bounds are included."""
    recording = trial.recording
    seconds = _measure_seconds(criterion, recording)
    minimum, maximum = criterion.between
    success, failure = _MESSAGES[criterion.of]
    measures = (Measure(Sentence("time"), seconds, "s"),)
    if minimum - 1e-9 <= seconds <= maximum + 1e-9:
        return pass_with(Sentence(success, seconds=seconds), recording.end_t, recording.end, measures)
    message = Sentence(failure, least=minimum, most=maximum, seconds=seconds)
    return fail_with(message, recording.end_t, recording.end, measures=measures)


@declare_case_judge(Ranking)
def judge_ranking(criterion: Ranking, case: Case) -> CriterionResult:
    """Judge the value that another criterion measured in each trial."""
    ranked_result = case.results.get(criterion.of)
    return judge_by_trial(criterion, case, lambda index, _: _judge_rank(criterion, index, ranked_result))


def _judge_rank(criterion: Ranking, trial_index: int, ranked_result: CriterionResult | None) -> Outcome:
    """Return the outcome for the value of trial ``trial_index``; no marks if the other criterion failed."""
    evidence = (
        next((each for each in ranked_result.evidence if each.trial == trial_index), None) if ranked_result else None
    )
    measure = _find_measure(criterion, evidence)
    if evidence is None or measure is None:
        return fail_with(Sentence("Expected a %(measure)s, but none was measured.", measure=criterion.measure))
    unit = f" {measure.unit}" if measure.unit else ""
    amount = f"{measure.value:.2f}{unit}"
    if not evidence.passed:
        # Values that don't count are left out of the ranking.
        message = Sentence(
            "The %(measure)s: %(amount)s does not count: %(reason)s",
            measure=measure.name,
            amount=amount,
            reason=evidence.message,
        )
        return fail_with(message, evidence.t, evidence.pose)
    share = _compute_share(criterion, measure.value)
    best = criterion.steps[0][0]
    if share == 1:
        message = Sentence("The %(measure)s: %(amount)s.", measure=measure.name, amount=amount)
        return pass_with(message, evidence.t, evidence.pose, (measure,))
    template = (
        translatable(
            "The %(measure)s: %(amount)s is worth %(percent)g%% of the marks; all are given for at least %(limit)s."
        )
        if criterion.highest
        else translatable(
            "The %(measure)s: %(amount)s is worth %(percent)g%% of the marks; all are given for at most %(limit)s."
        )
    )
    # The instructor defined the share, so it is not capped like a measured score.
    return Outcome(
        False,
        share,
        Sentence(template, measure=measure.name, amount=amount, percent=float(share) * 100, limit=f"{best:g}{unit}"),
        evidence.t,
        evidence.pose,
        (measure,),
    )


def _compute_share(criterion: Ranking, value: float) -> Fraction:
    for limit, share in criterion.steps:
        if (value >= limit - 1e-9) if criterion.highest else (value <= limit + 1e-9):
            return Fraction(str(share))
    return Fraction(0)


def _find_measure(criterion: Ranking, evidence: Evidence | None) -> Measure | None:
    measures = evidence.measures if evidence is not None else ()
    return next((measure for measure in measures if measure.name == criterion.measure), None)


def _measure_seconds(criterion: Timing, recording: Recording) -> float:
    match criterion.of:
        case "program":
            return recording.end_t
        case "moving":
            return _measure_moving_seconds(recording)
        case "speech":
            return max(compute_speech_ends(recording.spoken), default=0.0)


def _measure_moving_seconds(recording: Recording) -> float:
    ticks = recording.ticks
    if not len(ticks):
        return 0.0
    start = recording.start
    columns = ((start.x, ticks.x), (start.y, ticks.y), (start.heading, ticks.heading))
    changes = [np.abs(np.diff(column, prepend=first)) > _MAX_STILL_CHANGE for first, column in columns]
    return tick_to_seconds(recording, int(np.logical_or.reduce(changes).sum()))
