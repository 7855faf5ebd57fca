"""Recognition figures of a report: image counts, and each class's precision and recall.

Plain texts for a template. All counts come from the grading.
"""

from __future__ import annotations

from dataclasses import dataclass

from service.grading.grade import Accuracy, CriterionResult
from service.language import ENGLISH, Language
from service.reports.display_text import to_one_line
from service.reports.verdict_sentences import count_correct


@dataclass(frozen=True, slots=True)
class ClassScore:
    """One class: how many images showed it, how often it was answered, and how often both.

    ``precision`` is right / answered and ``recall`` right / shown; None if the divisor is 0.
    """

    label: str
    shown: int
    answered: int
    right: int

    @property
    def precision(self) -> float | None:
        """The fraction of the images identified as this class that show it, 0 to 1."""
        return self.right / self.answered if self.answered else None

    @property
    def recall(self) -> float | None:
        """The fraction of the images of this class that were identified correctly, 0 to 1."""
        return self.right / self.shown if self.shown else None


def compute_class_scores(accuracy: Accuracy) -> tuple[ClassScore, ...]:
    """Return a score for every label, in order; empty if the counts are withheld."""
    if not accuracy.confusion:
        return ()
    return tuple(
        ClassScore(
            label,
            sum(count for truth, _, count in accuracy.confusion if truth == label),
            sum(count for _, answer, count in accuracy.confusion if answer == label),
            sum(count for truth, answer, count in accuracy.confusion if truth == answer == label),
        )
        for label in accuracy.labels
    )


@dataclass(frozen=True, slots=True)
class ClassLine:
    """One class: images that show it, images identified as it, images with both, precision and recall."""

    label: str
    shown: int
    answered: int
    right: int
    precision: str
    recall: str


@dataclass(frozen=True, slots=True)
class RecognitionTable:
    """One criterion's figures. ``sums`` is a sentence whose numbers add up."""

    title: str
    accuracy: str
    sums: str
    confidence: str
    classes: tuple[ClassLine, ...]


def build_recognition_table(result: CriterionResult, language: Language = ENGLISH) -> RecognitionTable:
    """Return the figures of a criterion that measured an accuracy."""
    accuracy = result.accuracy
    assert accuracy is not None
    return RecognitionTable(
        title=to_one_line(result.title, 200),
        accuracy=language.say(
            "Accuracy %(value)s, 95 %% interval %(low)s to %(high)s, n = %(n)s %(of)s.",
            value=f"{accuracy.value:.3f}",
            low=f"{accuracy.low:.3f}",
            high=f"{accuracy.high:.3f}",
            n=accuracy.n,
            of=count_correct(accuracy, language)[1],
        ),
        sums=_describe_counts(accuracy, language),
        confidence=_describe_confidence(accuracy, language),
        classes=tuple(
            ClassLine(
                to_one_line(score.label, 60),
                score.shown,
                score.answered,
                score.right,
                _format_share(score.precision),
                _format_share(score.recall),
            )
            for score in compute_class_scores(accuracy)
            if score.shown or score.answered
        ),
    )


def _describe_counts(accuracy: Accuracy, language: Language) -> str:
    counts = accuracy.counts
    if counts is None:
        return ""
    sent_text = language.say(
        "Images sent: %(sent)s = %(answered)s answered + %(late)s late + %(malformed)s malformed + "
        "%(unanswered)s unanswered; duplicate answers: %(duplicates)s.",
        sent=counts.sent,
        answered=counts.answered,
        late=counts.late,
        malformed=counts.malformed,
        unanswered=counts.unanswered,
        duplicates=counts.duplicates,
    )
    unit = count_correct(accuracy, language)[1]
    counted_text = language.say("Counted: %(counted)s %(of)s.", counted=counts.counted, of=unit)
    if counts.missing:
        counted_text = language.say(
            "Counted: %(counted)s %(of)s, and %(missing)s that were missing, each a wrong answer.",
            counted=counts.counted,
            of=unit,
            missing=counts.missing,
        )
    return f"{sent_text} {counted_text}"


def _describe_confidence(accuracy: Accuracy, language: Language) -> str:
    confidence = accuracy.confidence
    if confidence is None:
        return ""
    means = []
    if confidence.right is not None:
        means.append(
            language.say("%(mean)s when correct (n = %(n)s)", mean=f"{confidence.right:.2f}", n=confidence.n_right)
        )
    if confidence.wrong is not None:
        means.append(
            language.say("%(mean)s when wrong (n = %(n)s)", mean=f"{confidence.wrong:.2f}", n=confidence.n_wrong)
        )
    return language.say("Mean confidence %(means)s.", means=language.say(" and ").join(means))


def _format_share(value: float | None) -> str:
    return "\N{EN DASH}" if value is None else f"{value:.2f}"
