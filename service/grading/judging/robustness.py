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

    def judge_trials(trials: IndexedTrials) -> CriterionResult:
        levels = find_levels(criterion.along, dict(trials))
        swept_trials = {index: trial for index, trial in trials if index in levels}
        classification = classify(criterion, case.assignment, list(swept_trials.items()))
        curve = compute_curve(criterion.along, classification.samples, swept_trials)
        other_curves = (
            other for other in compute_curves(classification.samples, swept_trials) if other.along != criterion.along
        )
        curves = (replace(curve, asked=criterion.level), *other_curves)
        share = _compute_share(criterion, curve)
        share = round_to_steps(share) if has_hidden(trials) else share
        return build_recognition_result(
            criterion, classification, share, _describe_curve(criterion, curve), curves, swept_trials
        )

    return judge_pooled(case.list_trials(criterion), judge_trials)


def _compute_share(criterion: Robustness, curve: AccuracyCurve) -> Fraction:
    """Return the fraction of the marks for the curve."""
    score = (
        compute_area(curve.levels) if criterion.level is None else compute_share_above(curve.levels, criterion.level)
    )
    if criterion.at_least is None:
        return score
    required_score = Fraction(str(criterion.at_least))
    if score >= required_score:
        return Fraction(1)
    return Fraction(0) if criterion.over == "all" else score / required_score


def _describe_curve(criterion: Robustness, curve: AccuracyCurve) -> str:
    condition = CONDITIONS[criterion.along]
    levels = curve.levels
    if not levels:
        return f"No trial was swept over {condition.words}."
    values_text = ", ".join(f"{level.value:.2f} at {level.at:g}" for level in levels[:_MAX_LISTED_LEVELS])
    ellipsis = ", ..." if len(levels) > _MAX_LISTED_LEVELS else ""
    text = f"By {condition.words} ({condition.unit}): {values_text}{ellipsis}."
    if criterion.level is None:
        return f"{text} Mean over the sweep: {float(compute_area(levels)):.2f}."
    level_range = find_range_above(levels, criterion.level)
    if level_range is None:
        return f"{text} It is below {criterion.level:g} even at the easiest level."
    range_text = (
        f"only at {level_range[0].at:g}"
        if level_range[0].at == level_range[1].at
        else f"from {level_range[0].at:g} to {level_range[1].at:g}"
    )
    return f"{text} It is at least {criterion.level:g} {range_text} {condition.unit}."
