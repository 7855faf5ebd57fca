"""Accuracy curves along the conditions that a scenario sweeps, and their measures.

Values are exact fractions. ``robustness.py`` decides the marks.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise

from models.intervals import compute_wilson_interval
from service.grading.grade import AccuracyCurve, Level, TrialResult
from service.grading.judging.patterns import Sample
from submissions.assignment.scenario import CONDITIONS

_NOISES = ("light_noise", "motor_noise")


def compute_curves(samples: Iterable[Sample], trials: Mapping[int, TrialResult]) -> tuple[AccuracyCurve, ...]:
    """Return a curve for every condition that the trials (by index in the grade) sweep, in a fixed order."""
    samples = tuple(samples)
    return tuple(
        curve for condition in CONDITIONS if len((curve := compute_curve(condition, samples, trials)).levels) > 1
    )


def compute_curve(condition: str, samples: Iterable[Sample], trials: Mapping[int, TrialResult]) -> AccuracyCurve:
    """Return the accuracy at each level of ``condition``, without trials that don't sweep it."""
    levels = find_levels(condition, trials)
    counts: dict[float, tuple[int, int]] = {}
    for sample in samples:
        if sample.trial in levels:
            correct_count, count = counts.get(levels[sample.trial], (0, 0))
            counts[levels[sample.trial]] = correct_count + sample.is_correct, count + 1
    levels_of_curve = (
        Level(at, right, count, *compute_wilson_interval(right, count)) for at, (right, count) in sorted(counts.items())
    )
    return AccuracyCurve(condition, tuple(levels_of_curve))


def compute_area(levels: Sequence[Level]) -> Fraction:
    """Return the mean height of the piecewise linear curve between its first and last level."""
    if len(levels) < 2:
        return _compute_height(levels[0]) if levels else Fraction(0)
    area = sum(
        (
            (_to_fraction(high) - _to_fraction(low)) * (_compute_height(low) + _compute_height(high)) / 2
            for low, high in pairwise(levels)
        ),
        Fraction(0),
    )
    return area / (_to_fraction(levels[-1]) - _to_fraction(levels[0]))


def compute_share_above(levels: Sequence[Level], level: float) -> Fraction:
    """Return the fraction of the sweep around its easiest level (nearest to 0) that stays at ``level`` or above."""
    level_range = find_range_above(levels, level)
    if level_range is None:
        return Fraction(0)
    if len(levels) < 2:
        return Fraction(1)
    return (_to_fraction(level_range[1]) - _to_fraction(level_range[0])) / (
        _to_fraction(levels[-1]) - _to_fraction(levels[0])
    )


def find_range_above(levels: Sequence[Level], level: float) -> tuple[Level, Level] | None:
    """Return the first and last level of that range; None if even the easiest level is below ``level``."""
    if not levels:
        return None
    min_height = Fraction(str(level))
    first_index = last_index = min(range(len(levels)), key=lambda place: abs(levels[place].at))
    if _compute_height(levels[first_index]) < min_height:
        return None
    while first_index > 0 and _compute_height(levels[first_index - 1]) >= min_height:
        first_index -= 1
    while last_index + 1 < len(levels) and _compute_height(levels[last_index + 1]) >= min_height:
        last_index += 1
    return levels[first_index], levels[last_index]


def find_levels(condition: str, trials: Mapping[int, TrialResult]) -> dict[int, float]:
    """Return the level of each trial of the curve. Noise levels listed by a scenario count as a sweep."""
    levels = {index: dict(trial.sweep)[condition] for index, trial in trials.items() if condition in dict(trial.sweep)}
    if levels or condition not in _NOISES:
        return levels
    levels_by_scenario: dict[str, set[float]] = {}
    for trial in trials.values():
        if not trial.sweep:
            levels_by_scenario.setdefault(trial.scenario, set()).add(getattr(trial, condition))
    return {
        index: getattr(trial, condition)
        for index, trial in trials.items()
        if not trial.sweep and len(levels_by_scenario[trial.scenario]) > 1
    }


def _to_fraction(level: Level) -> Fraction:
    return Fraction(str(level.at))


def _compute_height(level: Level) -> Fraction:
    return Fraction(level.right, level.n)
