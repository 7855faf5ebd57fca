"""Judging of recognition under a swept condition: the marks for the accuracy curve.

``recognition.py`` classifies the images, and ``accuracy_curves.py`` makes the curves.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from service.grading.grade import AccuracyCurve, CriterionResult
from service.grading.judging.accuracy_curves import (
    compute_area,
    compute_curve,
    compute_curves,
    compute_share_above,
    find_levels,
    find_range_above,
)
from service.grading.judging.judge_declaration import Case, IndexedTrials, declare_case_judge, has_hidden
from service.grading.judging.outcome import round_to_steps
from service.grading.judging.recognition import build_recognition_result, classify, judge_pooled
from submissions.criteria.robustness import Robustness
from submissions.sweep import CONDITIONS

_MAX_LISTED_LEVELS = 12


@declare_case_judge(Robustness)
def judge_robustness(criterion: Robustness, case: Case) -> CriterionResult:
    """Judge the accuracy curve along the swept condition."""

    def judged(trials: IndexedTrials) -> CriterionResult:
        levels = find_levels(criterion.along, dict(trials))
        swept = {index: trial for index, trial in trials if index in levels}
        found = classify(criterion, case.assignment, list(swept.items()))
        curve = compute_curve(criterion.along, found.samples, swept)
        others = (other for other in compute_curves(found.samples, swept) if other.along != criterion.along)
        curves = (replace(curve, asked=criterion.level), *others)
        share = _compute_share(criterion, curve)
        share = round_to_steps(share) if has_hidden(trials) else share
        return build_recognition_result(criterion, found, share, _describe_curve(criterion, curve), curves, swept)

    return judge_pooled(case.list_trials(criterion), judged)


def _compute_share(criterion: Robustness, curve: AccuracyCurve) -> Fraction:
    """Return the fraction of the marks for the curve."""
    reached = (
        compute_area(curve.levels) if criterion.level is None else compute_share_above(curve.levels, criterion.level)
    )
    if criterion.at_least is None:
        return reached
    enough = Fraction(str(criterion.at_least))
    if reached >= enough:
        return Fraction(1)
    return Fraction(0) if criterion.over == "all" else reached / enough


def _describe_curve(criterion: Robustness, curve: AccuracyCurve) -> str:
    about = CONDITIONS[criterion.along]
    levels = curve.levels
    if not levels:
        return f" No trial was swept over {about.words}."
    each = ", ".join(f"{level.value:.2f} at {level.at:g}" for level in levels[:_MAX_LISTED_LEVELS])
    more = ", ..." if len(levels) > _MAX_LISTED_LEVELS else ""
    words = f" By {about.words} ({about.unit}): {each}{more}."
    if criterion.level is None:
        return f"{words} Mean over the sweep: {float(compute_area(levels)):.2f}."
    held = find_range_above(levels, criterion.level)
    if held is None:
        return f"{words} It is below {criterion.level:g} even at the easiest level."
    where = f"only at {held[0].at:g}" if held[0].at == held[1].at else f"from {held[0].at:g} to {held[1].at:g}"
    return f"{words} It is at least {criterion.level:g} {where} {about.unit}."
