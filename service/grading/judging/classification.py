"""Judging of classification accuracy: the marks for it.

``recognition.py`` finds the class that each image was assigned to.
"""

from __future__ import annotations

from fractions import Fraction

from service.grading.grade import CriterionResult
from service.grading.judging.accuracy_curves import compute_curves
from service.grading.judging.judge_declaration import Case, IndexedTrials, declare_case_judge, has_hidden
from service.grading.judging.marks import compute_accuracy_share, compute_steps_share, round_to_steps
from service.grading.judging.message_parts import join_with_commas
from service.grading.judging.recognition import ClassificationResult, build_recognition_result, classify, judge_pooled
from sim.sentences import Sentence
from submissions.criteria.classification import Classification


@declare_case_judge(Classification)
def judge_classification(criterion: Classification, case: Case) -> CriterionResult:
    """Return the fraction of images identified correctly over all trials, and the marks for it."""

    def judge_trials(trials: IndexedTrials) -> CriterionResult:
        classification = classify(criterion, case.assignment, trials)
        share = _compute_share(criterion, classification, has_hidden(trials))
        conditions = _describe_mark_conditions(criterion) if share < 1 else ""
        return build_recognition_result(
            criterion,
            classification,
            share,
            conditions,
            compute_curves(classification.samples, dict(trials)),
            dict(trials),
        )

    return judge_pooled(case.list_trials(criterion), judge_trials)


def _compute_share(criterion: Classification, classification: ClassificationResult, hidden: bool) -> Fraction:
    correct_count, count = classification.correct_count, classification.accuracy.n
    if criterion.steps:
        return compute_steps_share(correct_count, count, criterion.steps, criterion.marks)
    share = compute_accuracy_share(correct_count, count, criterion.at_least, criterion.over)
    return round_to_steps(share) if hidden else share


def _describe_mark_conditions(criterion: Classification) -> str:
    if criterion.at_least is not None:
        return Sentence("Full marks need an accuracy of %(accuracy)g.", accuracy=criterion.at_least)
    if criterion.steps:
        steps = [
            Sentence("%(marks)g from %(accuracy)g", marks=marks, accuracy=accuracy)
            for accuracy, marks in criterion.steps
        ]
        return Sentence("Marks: %(steps)s.", steps=join_with_commas(steps))
    return ""
