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
from service.grading.judging.marks import round_to_steps
from service.grading.judging.message_parts import join_with_commas
from service.grading.judging.recognition import build_recognition_result, classify, judge_pooled
from service.language import translatable
from sim.sentences import Sentence, join_sentences
from submissions.assignment.scenario import CONDITIONS
from submissions.criteria.robustness import Robustness

_MAX_LISTED_LEVELS = 12
#: The names and units in ``CONDITIONS``, marked for translation.
CONDITION_WORDS = frozenset(
    {
        translatable("start offset in x"),
        translatable("start offset in y"),
        translatable("heading offset"),
        translatable("light noise"),
        translatable("motor noise"),
        translatable("message loss"),
        translatable("message delay"),
        translatable("mm"),
        translatable("degrees"),
        translatable("grey levels"),
        translatable("degrees per second"),
        translatable("share of messages"),
        translatable("s"),
    }
)


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
    name, unit = Sentence(condition.words), Sentence(condition.unit)
    levels = curve.levels
    if not levels:
        return Sentence("No trial was swept over %(condition)s.", condition=name)
    values: list[str] = [
        Sentence("%(accuracy).2f at %(level)g", accuracy=level.value, level=level.at)
        for level in levels[:_MAX_LISTED_LEVELS]
    ]
    if len(levels) > _MAX_LISTED_LEVELS:
        values.append("...")
    summary = Sentence(
        "By %(condition)s (%(unit)s): %(values)s.", condition=name, unit=unit, values=join_with_commas(values)
    )
    if criterion.level is None:
        return join_sentences(summary, Sentence("Mean over the sweep: %(mean).2f.", mean=float(compute_area(levels))))
    level_range = find_range_above(levels, criterion.level)
    if level_range is None:
        below = Sentence("It is below %(level)g even at the easiest level.", level=criterion.level)
        return join_sentences(summary, below)
    first, last = (level.at for level in level_range)
    template = (
        translatable("It is at least %(level)g only at %(first)g %(unit)s.")
        if first == last
        else translatable("It is at least %(level)g from %(first)g to %(last)g %(unit)s.")
    )
    return join_sentences(summary, Sentence(template, level=criterion.level, first=first, last=last, unit=unit))
