"""Judging of classification accuracy: the marks for it.

``recognition.py`` finds the class that each image was assigned to.
"""

from __future__ import annotations

from fractions import Fraction

from service.grading.grade import CriterionResult
from service.grading.judging.judges import Case, Indexed, has_hidden, judges_case
from service.grading.judging.outcome import in_steps, share_of_accuracy, share_of_steps
from service.grading.judging.recognition import Classified, classify, pooled, recognised
from service.grading.judging.sweeps import curves_of
from submissions.criteria.classification import Classification


@judges_case(Classification)
def judge_classification(criterion: Classification, case: Case) -> CriterionResult:
    """Return the fraction of images identified correctly over all trials, and the marks for it."""

    def judged(trials: Indexed) -> CriterionResult:
        found = classify(criterion, case.assignment, trials)
        share = _share(criterion, found, has_hidden(trials))
        words = _what_marks_need(criterion) if share < 1 else ""
        return recognised(criterion, found, share, words, curves_of(found.samples, dict(trials)), dict(trials))

    return pooled(case.looked_at_by(criterion), judged)


def _share(criterion: Classification, found: Classified, hidden: bool) -> Fraction:
    right, count = found.right, found.accuracy.n
    if criterion.steps:
        return share_of_steps(right, count, criterion.steps, criterion.marks)
    share = share_of_accuracy(right, count, criterion.at_least, criterion.over)
    return in_steps(share) if hidden else share


def _what_marks_need(criterion: Classification) -> str:
    if criterion.at_least is not None:
        return f" Full marks need an accuracy of {criterion.at_least:g}."
    if criterion.steps:
        return " Marks: " + ", ".join(f"{marks:g} from {accuracy:g}" for accuracy, marks in criterion.steps) + "."
    return ""
