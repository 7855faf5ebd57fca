"""Judging of image recognition: the answer to each image, which answers count, and how many are correct.

``truths.py`` finds the true labels. ``classification.py`` and ``robustness.py`` decide the marks.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from statistics import fmean
from typing import Literal

from models.intervals import wilson
from responders.faults import is_no_text
from service.grading.grade import (
    Accuracy,
    AccuracyCurve,
    Confidence,
    Counts,
    CriterionResult,
    Evidence,
    Prediction,
    Shown,
    TrialResult,
)
from service.grading.judging.answers import NOTHING, Answers, as_text, at_path, parsed
from service.grading.judging.geometry import Side
from service.grading.judging.judges import Indexed
from service.grading.judging.message_parts import early_end, place_words, quoted, shown_words
from service.grading.judging.outcome import earned
from service.grading.judging.patterns import Sample, by_pattern
from service.grading.judging.text_tokens import LabelFinder
from service.grading.judging.truths import NO_IMAGE, missing_truth, nameable, shown_in
from sim.recording import Image, Line, Message, Recording
from submissions.assignment.definition import Assignment
from submissions.criteria.recognition import Recognition

ReplyStatus = Literal["answered", "late", "malformed", "unanswered"]
_BEST_FIRST: tuple[ReplyStatus, ...] = ("answered", "late", "malformed", "unanswered")


@dataclass(frozen=True, slots=True)
class Reply:
    """The reply to one image. ``text`` is the answer that counts; ``words`` says why there is none."""

    status: ReplyStatus
    text: str | None
    words: str
    duplicates: int = 0  # answers after the one that counts


def reply_to(recording: Recording, answers: Answers, number: int) -> Reply:
    """Return the reply to image ``number`` of the recording.

    An answer is late if it arrived after the next image was sent, or was in transit when the program ended. A lost
    answer does not count. Of several answers, the first that arrived in time counts.
    """
    image = recording.images[number]
    following = recording.images[number + 1].t if number + 1 < len(recording.images) else None
    came = answers.all_to(image.message)
    statuses = [(_status(message, following), message) for message in came]
    arrived = [pair for pair in statuses if pair[0] != "unanswered"]
    if not arrived:
        return _silence(recording, answers, image.message, came)
    status, message = min(arrived, key=_precedence)
    text = message.text
    duplicates = len(arrived) - 1
    if status == "malformed":
        return Reply(status, None, "the answer begins with JSON:: but is not JSON", duplicates)
    return Reply(status, text, "", duplicates)


def _precedence(arrived: tuple[ReplyStatus, Message]) -> tuple[int, float]:
    """Return the sort key of answers: by status, then by arrival. Answers in transit at the end come last."""
    status, message = arrived
    return _BEST_FIRST.index(status), math.inf if message.delivered is None else message.delivered


def _status(message: Message, following: float | None) -> ReplyStatus:
    if message.note == "malformed":
        return "malformed"
    if message.delivered is None:
        return "unanswered" if message.note == "lost" else "late"
    return "late" if following is not None and message.delivered > following else "answered"


def _silence(recording: Recording, answers: Answers, question: int, came: Sequence[Message]) -> Reply:
    """Return the reply if nothing arrived: image or answer was lost, the answer was not a text, or none was given."""
    if came:
        return Reply("unanswered", None, "the answer was lost on its way")
    sent = recording.messages[question] if question < len(recording.messages) else None
    if sent is not None and sent.note == "lost":
        return Reply("unanswered", None, "the image was lost on its way")
    fault = answers.fault_after(question)
    if fault is not None and is_no_text(fault):
        return Reply("malformed", None, answers.silence(question))
    return Reply("unanswered", None, answers.silence(question))


#: An image taken this close to an earlier one shows the same again, mm.
_SAME_PLACE = 1.0


@dataclass(frozen=True, slots=True)
class Classified:
    """The result of a recognition criterion: a sample for each image or, if it says so, each pattern."""

    samples: tuple[Sample, ...]
    accuracy: Accuracy
    predictions: tuple[Prediction, ...]
    evidence: tuple[Evidence, ...]

    @property
    def right(self) -> int:
        """The number of samples identified correctly."""
        return sum(sample.right for sample in self.samples)


def classify(criterion: Recognition, assignment: Assignment, trials: Indexed) -> Classified:
    """Classify every image of ``trials`` (with their indices in the grade) that counts, over all trials."""
    shown = shown_in(criterion, trials)
    truths = [truth for told_truths in shown.values() for _, truth in told_truths]
    labels = nameable(criterion, assignment, truths)
    finder = LabelFinder(labels, criterion.aliases)
    images: list[Sample] = []
    samples: list[Sample] = []
    statuses: Counter[ReplyStatus] = Counter()
    duplicates = 0
    for index, trial in trials:
        recording = trial.recording
        replies = _replies(criterion, recording)
        statuses.update(reply.status for reply in replies)
        duplicates += sum(reply.duplicates for reply in replies)
        own = []
        for number, truth in shown[index]:
            answer, words, confidence = _answer(criterion, replies[number], finder)
            image = recording.images[number]
            own.append(Sample(index, image, finder.canonical(truth), answer, words, confidence))
        images += own
        samples += _that_count(criterion, index, trial, own, finder)
    by_index = dict(trials)
    of_trial: dict[int, list[Sample]] = {index: [] for index in by_index}
    for sample in samples:
        of_trial[sample.trial].append(sample)
    predictions = tuple(
        Prediction(sample.image, sample.truth, sample.answer, by_index[sample.trial].scenario, sample.trial)
        for sample in images
        if sample.image is not None
    )
    missing = sum(sample.image is None for sample in samples)
    counts = Counts(
        sum(statuses.values()),
        statuses["answered"],
        statuses["late"],
        statuses["malformed"],
        statuses["unanswered"],
        duplicates,
        len(samples) - missing,
        missing,
        "images" if criterion.each_pattern is None else "patterns",
    )
    return Classified(
        tuple(samples),
        _accuracy(samples, labels, counts),
        predictions,
        tuple(_evidence(index, own) for index, own in of_trial.items()),
    )


def pooled(trials: Indexed, judged: Callable[[Indexed], CriterionResult]) -> CriterionResult:
    """Return the result over all trials. If some are hidden, also the feedback from the visible ones alone."""
    result = judged(trials)
    visible = [(index, trial) for index, trial in trials if trial.visibility == "visible"]
    if len(visible) == len(trials):
        return result
    if not visible:
        return replace(result, shown=Shown(shown_words("")))
    alone = judged(visible)
    return replace(result, shown=Shown(shown_words(alone.message), alone.accuracy, alone.curves))


def recognised(
    criterion: Recognition,
    found: Classified,
    share: Fraction,
    words: str,
    curves: tuple[AccuracyCurve, ...],
    trials: Mapping[int, TrialResult],
) -> CriterionResult:
    """Return the result for ``share`` of the marks. ``words`` gives the reason, after the tally."""
    return CriterionResult(
        id=criterion.id,
        title=criterion.title,
        marks=earned(criterion.marks, share),
        max_marks=criterion.marks,
        message=_tally(criterion, found) + words + _first_wrong(found.samples, trials),
        visibility=criterion.visibility,
        evidence=found.evidence,
        accuracy=found.accuracy,
        predictions=found.predictions,
        curves=curves,
    )


def told(sample: Sample) -> str:
    """Return a sentence on one image."""
    if sample.image is None:
        if sample.truth == NO_IMAGE:
            return f"Expected an image (IMG_DATA), but {sample.words}."
        return f"Expected {quoted(sample.truth)}, but {sample.words}."
    if sample.right:
        return f"The image showed {quoted(sample.truth)} and was identified correctly."
    return f"The image showed {quoted(sample.truth)}, but {sample.words}."


def _that_count(
    criterion: Recognition,
    index: int,
    trial: TrialResult,
    own: list[Sample],
    finder: LabelFinder,
) -> Sequence[Sample]:
    """Return a trial's images or patterns. Missing ones are replaced by wrong answers."""
    if criterion.each_pattern is None:
        # Near the start there is one thing to see. Otherwise a robot could send more images of what it is sure of.
        apart = max(_SAME_PLACE, 2 * (criterion.near_start or 0.0))
        counted = by_pattern(own, trial.recording, "majority", apart)
    else:
        # Grey patches are read by the right sensor.
        side: Side = "right" if criterion.truth == "grey" else "left"
        apart = max(30.0, 2 * criterion.within)
        counted = by_pattern(own, trial.recording, criterion.each_pattern, apart, side)
    if counted and len(counted) >= criterion.patterns:
        return counted
    if not counted and criterion.patterns <= 1:
        truth = missing_truth(criterion, trial)
        sent = "the robot sent none" if truth == NO_IMAGE else "the robot sent no image"
        if criterion.near_start is not None and trial.recording.images:
            sent += f" from within {criterion.near_start:g} mm of where it started"
        return [Sample(index, None, finder.canonical(truth), None, sent)]
    words = f"the robot sent images of {len(counted)} patterns, and {criterion.patterns} were expected"
    lacking = Sample(index, None, NO_IMAGE, None, words)
    return [*counted, *[lacking] * (criterion.patterns - len(counted))]


def _accuracy(samples: Sequence[Sample], labels: tuple[str, ...], counts: Counts) -> Accuracy:
    right = sum(sample.right for sample in samples)
    count = len(samples)
    low, high = wilson(right, count)
    cells = Counter((sample.truth, sample.answer) for sample in samples)
    confusion = tuple(
        (truth, answer, number)
        for (truth, answer), number in sorted(cells.items(), key=lambda item: (item[0][0], item[0][1] or ""))
    )
    known = tuple(dict.fromkeys([*labels, *(sample.truth for sample in samples)]))
    return Accuracy(right / count if count else 0.0, low, high, count, known, confusion, counts, _confidence(samples))


def _confidence(samples: Sequence[Sample]) -> Confidence | None:
    """Return the mean confidence of correct and wrong answers; None if no answer had one."""
    right = [sample.confidence for sample in samples if sample.right and sample.confidence is not None]
    wrong = [sample.confidence for sample in samples if not sample.right and sample.confidence is not None]
    if not right and not wrong:
        return None
    return Confidence(fmean(right) if right else None, len(right), fmean(wrong) if wrong else None, len(wrong))


def _evidence(index: int, own: Sequence[Sample]) -> Evidence:
    """Return the first image of the trial that was misidentified, otherwise its last."""
    shown = next((sample for sample in own if not sample.right), own[-1])
    image = shown.image
    return Evidence(
        trial=index,
        passed=all(sample.right for sample in own),
        message=told(shown),
        t=image.t if image else None,
        pose=image.pose if image else None,
    )


def _replies(criterion: Recognition, recording: Recording) -> list[Reply]:
    """Return the reply to every image of the recording, including images that don't count."""
    if criterion.answer_from == "reply":
        answers = Answers(recording)
        return [reply_to(recording, answers, number) for number in range(len(recording.images))]
    said = "said" if criterion.answer_from == "speech" else "printed"
    replies = []
    for image in recording.images:
        heard = _between(recording, image, criterion.answer_from == "speech")
        text = " | ".join(line.text for line in heard)
        silent = Reply("unanswered", None, f"the robot {said} nothing after the image")
        replies.append(Reply("answered", text, "") if heard else silent)
    return replies


def _answer(criterion: Recognition, reply: Reply, finder: LabelFinder) -> tuple[str | None, str, float | None]:
    """Return the label in the answer (None unless there is exactly one), a description, and the confidence."""
    if reply.text is None:
        return None, reply.words, None
    if reply.status == "late" and criterion.late == "wrong":
        return None, f"the answer came too late: {quoted(reply.text)}", None
    text, confidence = reply.text, None
    if criterion.answer_from == "reply":
        value = parsed(text)
        if criterion.confidence is not None:
            confidence = _probability(at_path(value, criterion.confidence))
        if criterion.answer is not None:
            picked = at_path(value, criterion.answer)
            text = text if picked is NOTHING else as_text(picked)
    found = finder.labels_in(text)
    if not found:
        return None, f"the answer names no label: {quoted(text)}", confidence
    if len(found) > 1:
        return None, f"the answer names more than one label: {' and '.join(map(quoted, found))}", confidence
    return found[0], f"it was identified as {quoted(found[0])}", confidence


def _probability(value: object) -> float | None:
    """Return a JSON number from 0 to 1; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= 1:
        return None
    return float(value)


def _between(recording: Recording, image: Image, speech: bool) -> Sequence[Line]:
    """Return what the robot said or printed after this image and before the next."""
    following = bisect_right(recording.images, image.message, key=lambda other: other.message)
    end = recording.images[following].t if following < len(recording.images) else math.inf
    lines = recording.spoken if speech else recording.printed
    return lines[bisect_left(lines, image.t, key=_time) : bisect_left(lines, end, key=_time)]


def _time(line: Line) -> float:
    return line.t


def counts_words(counts: Counts) -> str:
    """Return counts as ``9 images sent: 7 answered, 1 late, 0 malformed, 1 unanswered; 2 duplicate answers``."""
    return (
        f"{counts.sent} images sent: {counts.answered} answered, {counts.late} late, {counts.malformed} malformed, "
        f"{counts.unanswered} unanswered; {counts.duplicates} duplicate answers"
    )


def _tally(criterion: Recognition, found: Classified) -> str:
    accuracy = found.accuracy
    what = "images" if criterion.each_pattern is None else "patterns"
    words = (
        f"{found.right} of {accuracy.n} {what} identified correctly: accuracy {accuracy.value:.2f} "
        f"(95 % interval {accuracy.low:.2f} to {accuracy.high:.2f})."
    )
    counts = accuracy.counts
    if counts is not None and (counts.answered != counts.sent or counts.duplicates):
        words += f" {counts_words(counts)}."
    confidence = accuracy.confidence
    if confidence is not None:
        sure = [
            f"{mean:.2f} when {how} ({count})"
            for mean, count, how in (
                (confidence.right, confidence.n_right, "right"),
                (confidence.wrong, confidence.n_wrong, "wrong"),
            )
            if mean is not None
        ]
        words += f" Mean confidence {' and '.join(sure)}."
    return words


def _first_wrong(samples: Sequence[Sample], trials: Mapping[int, TrialResult]) -> str:
    """Return the place of the first misidentified image; empty if there is none."""
    first = next((sample for sample in samples if not sample.right), None)
    if first is None:
        return ""
    trial = trials[first.trial]
    return f" {place_words(trial, first.image.t if first.image else None)}: {told(first)}{early_end(trial)}"
