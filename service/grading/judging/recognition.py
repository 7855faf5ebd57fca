"""Judging of image recognition: the label in the answer to each image, and how many are correct.

``image_replies.py`` finds the answers, ``true_labels.py`` the true labels. ``classification.py`` and ``robustness.py``
decide the marks.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from statistics import fmean

from models.intervals import compute_wilson_interval
from service.grading.findings import Finding, UnnamedLabel
from service.grading.grade import (
    Accuracy,
    AccuracyCurve,
    Confidence,
    Counts,
    CriterionResult,
    Evidence,
    Prediction,
    TrialResult,
    VisibleFeedback,
)
from service.grading.judging.answers import as_text, find_at_path, parse_json_answer
from service.grading.judging.geometry import Side
from service.grading.judging.image_replies import Reply, ReplyStatus, collect_replies
from service.grading.judging.judge_declaration import IndexedTrials
from service.grading.judging.marks import compute_marks
from service.grading.judging.message_parts import (
    add_hidden_note,
    add_place,
    describe_early_end,
    describe_place,
    quote_text,
)
from service.grading.judging.patterns import Sample, group_by_pattern
from service.grading.judging.text_tokens import LabelFinder
from service.grading.judging.true_labels import NO_IMAGE, collect_labels, find_counted_images, find_missing_label
from service.language import translatable
from sim.sentences import Sentence, join_sentences, join_with_and
from submissions.assignment.definition import Assignment
from submissions.criteria.recognition import Recognition

#: Images taken within this distance show the same pattern, mm.
_SAME_PLACE_MM = 1.0


@dataclass(frozen=True, slots=True)
class ClassificationResult:
    """The result of a recognition criterion: a sample for each image or, if it says so, each pattern."""

    samples: tuple[Sample, ...]
    accuracy: Accuracy
    predictions: tuple[Prediction, ...]
    evidence: tuple[Evidence, ...]
    findings: Mapping[int | None, tuple[Finding, ...]]

    @property
    def correct_count(self) -> int:
        """The number of samples identified correctly."""
        return sum(sample.is_correct for sample in self.samples)


def classify(criterion: Recognition, assignment: Assignment, trials: IndexedTrials) -> ClassificationResult:
    """Classify every image of ``trials`` (with their indices in the grade) that counts, over all trials."""
    truths_by_trial = find_counted_images(criterion, trials)
    truths = [truth for told_truths in truths_by_trial.values() for _, truth in told_truths]
    labels = collect_labels(criterion, assignment, truths)
    finder = LabelFinder(labels, criterion.aliases)
    images: list[Sample] = []
    samples: list[Sample] = []
    statuses: Counter[ReplyStatus] = Counter()
    duplicates = 0
    for index, trial in trials:
        recording = trial.recording
        replies = collect_replies(criterion, recording)
        statuses.update(reply.status for reply in replies)
        duplicates += sum(reply.duplicates for reply in replies)
        trial_images = []
        for number, truth in truths_by_trial[index]:
            answer, description, confidence, unnamed = _read_answer(criterion, replies[number], finder)
            image = recording.images[number]
            trial_images.append(
                Sample(index, image, finder.to_canonical(truth), answer, description, confidence, unnamed)
            )
        images += trial_images
        samples += _collect_counted_samples(criterion, index, trial, trial_images, finder)
    trials_by_index = dict(trials)
    samples_by_trial: dict[int, list[Sample]] = {index: [] for index in trials_by_index}
    for sample in samples:
        samples_by_trial[sample.trial].append(sample)
    predictions = tuple(
        Prediction(sample.image, sample.truth, sample.answer, trials_by_index[sample.trial].scenario, sample.trial)
        for sample in images
        if sample.image is not None
    )
    missing_count = sum(sample.image is None for sample in samples)
    counts = Counts(
        sum(statuses.values()),
        statuses["answered"],
        statuses["late"],
        statuses["malformed"],
        statuses["unanswered"],
        duplicates,
        len(samples) - missing_count,
        missing_count,
        "images" if criterion.each_pattern is None else "patterns",
    )
    return ClassificationResult(
        tuple(samples),
        _compute_accuracy(samples, labels, counts),
        predictions,
        tuple(_build_evidence(index, own) for index, own in samples_by_trial.items()),
        {
            index: (UnnamedLabel(example.unnamed),)
            for index, own in samples_by_trial.items()
            if (example := _choose_example(own)).unnamed is not None
        },
    )


def judge_pooled(trials: IndexedTrials, judge_trials: Callable[[IndexedTrials], CriterionResult]) -> CriterionResult:
    """Return the result over all trials. If some are hidden, also the feedback from the visible ones alone."""
    result = judge_trials(trials)
    visible = [(index, trial) for index, trial in trials if trial.visibility == "visible"]
    if len(visible) == len(trials):
        return result
    if not visible:
        return replace(result, shown=VisibleFeedback(add_hidden_note("")))
    visible_result = judge_trials(visible)
    return replace(
        result,
        shown=VisibleFeedback(add_hidden_note(visible_result.message), visible_result.accuracy, visible_result.curves),
    )


def build_recognition_result(
    criterion: Recognition,
    classification: ClassificationResult,
    share: Fraction,
    reason: str,
    curves: tuple[AccuracyCurve, ...],
    trials: Mapping[int, TrialResult],
) -> CriterionResult:
    """Return the result for ``share`` of the marks. ``reason`` is a sentence on it, or empty."""
    return CriterionResult(
        id=criterion.id,
        title=criterion.title,
        marks=compute_marks(criterion.marks, share),
        max_marks=criterion.marks,
        message=join_sentences(
            _describe_tally(criterion, classification),
            reason,
            _describe_first_mistake(classification.samples, trials),
        ),
        visibility=criterion.visibility,
        evidence=classification.evidence,
        accuracy=classification.accuracy,
        predictions=classification.predictions,
        curves=curves,
        findings=classification.findings,
    )


def describe_sample(sample: Sample) -> str:
    """Return a sentence on one image."""
    if sample.image is None:
        if sample.truth == NO_IMAGE:
            return Sentence("Expected an image (IMG_DATA), but %(problem)s.", problem=sample.words)
        return Sentence("Expected %(label)s, but %(problem)s.", label=quote_text(sample.truth), problem=sample.words)
    if sample.is_correct:
        return Sentence("The image showed %(label)s and was identified correctly.", label=quote_text(sample.truth))
    return Sentence(
        "The image showed %(label)s, but %(problem)s.", label=quote_text(sample.truth), problem=sample.words
    )


def _collect_counted_samples(
    criterion: Recognition,
    index: int,
    trial: TrialResult,
    trial_images: list[Sample],
    finder: LabelFinder,
) -> Sequence[Sample]:
    """Return a trial's images or patterns. Missing ones are replaced by wrong answers."""
    if criterion.each_pattern is None:
        # Near the start there is only one pattern. Otherwise a robot could send more images of an easy pattern.
        radius = max(_SAME_PLACE_MM, 2 * (criterion.near_start or 0.0))
        counted_samples = group_by_pattern(trial_images, trial.recording, "majority", radius)
    else:
        # Grey patches are read by the right sensor.
        side: Side = "right" if criterion.truth == "grey" else "left"
        radius = max(30.0, 2 * criterion.within)
        counted_samples = group_by_pattern(trial_images, trial.recording, criterion.each_pattern, radius, side)
    if counted_samples and len(counted_samples) >= criterion.patterns:
        return counted_samples
    if not counted_samples and criterion.patterns <= 1:
        truth = find_missing_label(criterion, trial)
        problem = Sentence("the robot sent none") if truth == NO_IMAGE else Sentence("the robot sent no image")
        if criterion.near_start is not None and trial.recording.images:
            problem = Sentence(
                "%(problem)s from within %(distance)g mm of where it started",
                problem=problem,
                distance=criterion.near_start,
            )
        return [Sample(index, None, finder.to_canonical(truth), None, problem)]
    description = Sentence(
        "the robot sent images of %(count)s patterns, and %(expected)s were expected",
        count=len(counted_samples),
        expected=criterion.patterns,
    )
    missing_sample = Sample(index, None, NO_IMAGE, None, description)
    return [*counted_samples, *[missing_sample] * (criterion.patterns - len(counted_samples))]


def _compute_accuracy(samples: Sequence[Sample], labels: tuple[str, ...], counts: Counts) -> Accuracy:
    correct_count = sum(sample.is_correct for sample in samples)
    count = len(samples)
    low, high = compute_wilson_interval(correct_count, count)
    cells = Counter((sample.truth, sample.answer) for sample in samples)
    confusion = tuple(
        (truth, answer, number)
        for (truth, answer), number in sorted(cells.items(), key=lambda item: (item[0][0], item[0][1] or ""))
    )
    all_labels = tuple(dict.fromkeys([*labels, *(sample.truth for sample in samples)]))
    return Accuracy(
        correct_count / count if count else 0.0,
        low,
        high,
        count,
        all_labels,
        confusion,
        counts,
        _compute_confidence(samples),
    )


def _compute_confidence(samples: Sequence[Sample]) -> Confidence | None:
    """Return the mean confidence of correct and wrong answers; None if no answer had one."""
    correct_confidences = [
        sample.confidence for sample in samples if sample.is_correct and sample.confidence is not None
    ]
    wrong_confidences = [
        sample.confidence for sample in samples if not sample.is_correct and sample.confidence is not None
    ]
    if not correct_confidences and not wrong_confidences:
        return None
    return Confidence(
        fmean(correct_confidences) if correct_confidences else None,
        len(correct_confidences),
        fmean(wrong_confidences) if wrong_confidences else None,
        len(wrong_confidences),
    )


def _build_evidence(index: int, samples: Sequence[Sample]) -> Evidence:
    example = _choose_example(samples)
    image = example.image
    return Evidence(
        trial=index,
        passed=all(sample.is_correct for sample in samples),
        message=describe_sample(example),
        t=image.t if image else None,
        pose=image.pose if image else None,
    )


def _choose_example(samples: Sequence[Sample]) -> Sample:
    """Return the first image of a trial that was misidentified, otherwise its last."""
    return next((sample for sample in samples if not sample.is_correct), samples[-1])


def _read_answer(
    criterion: Recognition, reply: Reply, finder: LabelFinder
) -> tuple[str | None, str, float | None, str | None]:
    """Return the label in the answer (None unless there is exactly one), a description, and the confidence.

    The fourth value is the answer if it names no label.
    """
    if reply.text is None:
        return None, reply.words, None, None
    if reply.status == "late" and criterion.late == "wrong":
        return None, Sentence("the answer came too late: %(answer)s", answer=quote_text(reply.text)), None, None
    text, confidence = reply.text, None
    if criterion.answer_from == "reply":
        value = parse_json_answer(text)
        if criterion.confidence is not None:
            confidence = _parse_probability(find_at_path(value, criterion.confidence))
        if criterion.answer is not None:
            answer_value = find_at_path(value, criterion.answer)
            if isinstance(answer_value, bool) or not isinstance(answer_value, str | int | float):
                problem = Sentence(
                    "the answer has no text or number at %(path)s: %(answer)s",
                    path=criterion.answer,
                    answer=quote_text(text),
                )
                return None, problem, confidence, None
            text = as_text(answer_value)
    found_labels = finder.find_labels(text)
    if not found_labels:
        return None, Sentence("the answer names no label: %(answer)s", answer=quote_text(text)), confidence, text
    quotes = join_with_and([quote_text(label) for label in found_labels])
    if len(found_labels) > 1:
        description = Sentence("the answer names more than one label: %(labels)s", labels=quotes)
        return None, description, confidence, None
    return found_labels[0], Sentence("it was identified as %(label)s", label=quotes), confidence, None


def _parse_probability(value: object) -> float | None:
    """Return a JSON number from 0 to 1; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= 1:
        return None
    return float(value)


def describe_counts(counts: Counts) -> str:
    """Return counts as ``9 images sent: 7 answered, 1 late, 0 malformed, 1 unanswered; 2 duplicate answers.``."""
    return Sentence(
        "%(sent)s images sent: %(answered)s answered, %(late)s late, %(malformed)s malformed, %(unanswered)s "
        "unanswered; %(duplicates)s duplicate answers.",
        sent=counts.sent,
        answered=counts.answered,
        late=counts.late,
        malformed=counts.malformed,
        unanswered=counts.unanswered,
        duplicates=counts.duplicates,
    )


def _describe_tally(criterion: Recognition, classification: ClassificationResult) -> str:
    accuracy = classification.accuracy
    template = (
        translatable(
            "%(correct)s of %(count)s images identified correctly: accuracy %(accuracy).2f (95 %% interval %(low).2f "
            "to %(high).2f)."
        )
        if criterion.each_pattern is None
        else translatable(
            "%(correct)s of %(count)s patterns identified correctly: accuracy %(accuracy).2f (95 %% interval %(low).2f "
            "to %(high).2f)."
        )
    )
    tally = Sentence(
        template,
        correct=classification.correct_count,
        count=accuracy.n,
        accuracy=accuracy.value,
        low=accuracy.low,
        high=accuracy.high,
    )
    counts, confidence = accuracy.counts, accuracy.confidence
    has_losses = counts is not None and (counts.answered != counts.sent or counts.duplicates)
    return join_sentences(
        tally,
        describe_counts(counts) if counts is not None and has_losses else "",
        _describe_confidence(confidence) if confidence is not None else "",
    )


def _describe_confidence(confidence: Confidence) -> str:
    means = (
        (translatable("%(mean).2f when right (%(count)s)"), confidence.right, confidence.n_right),
        (translatable("%(mean).2f when wrong (%(count)s)"), confidence.wrong, confidence.n_wrong),
    )
    texts = [Sentence(template, mean=mean, count=count) for template, mean, count in means if mean is not None]
    return Sentence("Mean confidence %(confidences)s.", confidences=join_with_and(texts))


def _describe_first_mistake(samples: Sequence[Sample], trials: Mapping[int, TrialResult]) -> str:
    """Return the place of the first misidentified image; empty if there is none."""
    mistake = next((sample for sample in samples if not sample.is_correct), None)
    if mistake is None:
        return ""
    trial = trials[mistake.trial]
    place = describe_place(trial, mistake.image.t if mistake.image else None)
    return join_sentences(add_place(place, describe_sample(mistake)), describe_early_end(trial))
