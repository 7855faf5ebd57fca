"""Judging of recognition under a swept condition: the marks for the accuracy curve.

``recognition.py`` classifies the images, and ``sweeps.py`` makes the curves.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from service.grading.grade import AccuracyCurve, CriterionResult
from service.grading.judging.judges import Case, Indexed, has_hidden, judges_case
from service.grading.judging.outcome import in_steps
from service.grading.judging.recognition import classify, pooled, recognised
from service.grading.judging.sweeps import area, curve_along, curves_of, levels_along, part_above, range_above
from submissions.criteria.robustness import Robustness
from submissions.sweep import CONDITIONS

_MOST_LEVELS_TOLD = 12


@judges_case(Robustness)
def judge_robustness(criterion: Robustness, case: Case) -> CriterionResult:
    """Judge the accuracy curve along the swept condition."""

    def judged(trials: Indexed) -> CriterionResult:
        levels = levels_along(criterion.along, dict(trials))
        swept = {index: trial for index, trial in trials if index in levels}
        found = classify(criterion, case.assignment, list(swept.items()))
        curve = curve_along(criterion.along, found.samples, swept)
        others = (other for other in curves_of(found.samples, swept) if other.along != criterion.along)
        curves = (replace(curve, asked=criterion.level), *others)
        share = _share(criterion, curve)
        share = in_steps(share) if has_hidden(trials) else share
        return recognised(criterion, found, share, _words(criterion, curve), curves, swept)

    return pooled(case.looked_at_by(criterion), judged)


def _share(criterion: Robustness, curve: AccuracyCurve) -> Fraction:
    """Return the fraction of the marks for the curve."""
    reached = area(curve.levels) if criterion.level is None else part_above(curve.levels, criterion.level)
    if criterion.at_least is None:
        return reached
    enough = Fraction(str(criterion.at_least))
    if reached >= enough:
        return Fraction(1)
    return Fraction(0) if criterion.over == "all" else reached / enough


def _words(criterion: Robustness, curve: AccuracyCurve) -> str:
    about = CONDITIONS[criterion.along]
    levels = curve.levels
    if not levels:
        return f" No trial was swept over {about.words}."
    each = ", ".join(f"{level.value:.2f} at {level.at:g}" for level in levels[:_MOST_LEVELS_TOLD])
    more = ", ..." if len(levels) > _MOST_LEVELS_TOLD else ""
    words = f" By {about.words} ({about.unit}): {each}{more}."
    if criterion.level is None:
        return f"{words} Mean over the sweep: {float(area(levels)):.2f}."
    held = range_above(levels, criterion.level)
    if held is None:
        return f"{words} It is below {criterion.level:g} even at the easiest level."
    where = f"only at {held[0].at:g}" if held[0].at == held[1].at else f"from {held[0].at:g} to {held[1].at:g}"
    return f"{words} It is at least {criterion.level:g} {where} {about.unit}."
