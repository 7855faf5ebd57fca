"""Judging how often the pictures that the robot sent were named rightly: accuracy, confusion, and every picture.

It compares words only; what a picture shows was recorded when it was taken, or is told by the assignment.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from service.grading.answers import NOTHING, Answers, as_text, at_path, parsed
from service.grading.grade import Accuracy, Evidence, Sight, TrialResult
from service.grading.outcome import quoted
from sim.backgrounds import floor, names
from sim.recording import Image, Line, Recording
from submissions.assignment import Assignment
from submissions.criteria import Classification

#: Stands for the truth of a picture that was never sent, where the assignment does not tell it.
NO_PICTURE = "(no picture)"
_Z95 = 1.959963984540054
_LONGEST_ANSWER = 10_000


@dataclass(frozen=True, slots=True)
class Naming:
    """One picture that counts, or the lack of one: what it shows, what it was taken for, and why that is."""

    trial: int  # index into the grade's trials
    image: Image | None
    truth: str
    answer: str | None
    words: str  # what happened, for a sentence

    @property
    def right(self) -> bool:
        return self.answer == self.truth


@dataclass(frozen=True, slots=True)
class Classified:
    """What a classification criterion found in its trials."""

    namings: tuple[Naming, ...]
    accuracy: Accuracy
    sights: tuple[Sight, ...]
    evidence: tuple[Evidence, ...]


def classify(
    criterion: Classification, assignment: Assignment, trials: Sequence[tuple[int, TrialResult]]
) -> Classified:
    """Every picture of ``trials`` (with their indices in the grade) that counts, pooled."""
    truths = {index: _truths(criterion, assignment, trial) for index, trial in trials}
    spoken = [truth for told in truths.values() for _, truth in told]
    labels = _labels(criterion, assignment, spoken)
    finder = _Finder(labels, criterion.aliases)
    namings: list[Naming] = []
    for index, trial in trials:
        if not truths[index]:
            truth = _missing_truth(criterion, assignment, trial)
            namings.append(Naming(index, None, finder.canonical(truth), None, "the robot sent no picture"))
        answers = Answers(trial.recording)
        for image, truth in truths[index]:
            answer, words = _answer(criterion, trial.recording, answers, image, finder)
            namings.append(Naming(index, image, finder.canonical(truth), answer, words))
    by_index = dict(trials)
    sights = tuple(
        Sight(naming.image, naming.truth, naming.answer, by_index[naming.trial].scenario, naming.trial)
        for naming in namings
        if naming.image is not None
    )
    return Classified(
        tuple(namings), _accuracy(namings, labels), sights, tuple(_evidence(namings, index) for index, _ in trials)
    )


def wilson(right: int, count: int) -> tuple[float, float]:
    """The 95 % interval of a share (Wilson, J. Am. Stat. Assoc. 22 (1927) 209); 0 to 1 for no trials at all."""
    if count == 0:
        return 0.0, 1.0
    share = right / count
    square = _Z95 * _Z95
    middle = (share + square / (2 * count)) / (1 + square / count)
    half = _Z95 * math.sqrt(share * (1 - share) / count + square / (4 * count * count)) / (1 + square / count)
    # At the ends the interval touches them exactly; rounding must not push it past.
    low = 0.0 if right == 0 else max(middle - half, 0.0)
    high = 1.0 if right == count else min(middle + half, 1.0)
    return low, high


def _accuracy(namings: Sequence[Naming], labels: tuple[str, ...]) -> Accuracy:
    right = sum(naming.right for naming in namings)
    count = len(namings)
    low, high = wilson(right, count)
    counts = Counter((naming.truth, naming.answer) for naming in namings)
    confusion = tuple(
        (truth, answer, number)
        for (truth, answer), number in sorted(counts.items(), key=lambda item: (item[0][0], item[0][1] or ""))
    )
    known = tuple(dict.fromkeys([*labels, *(naming.truth for naming in namings)]))
    return Accuracy(right / count if count else 0.0, low, high, count, known, confusion)


def _evidence(namings: Sequence[Naming], index: int) -> Evidence:
    """The first picture of the trial that was named wrongly, else its last."""
    own = [naming for naming in namings if naming.trial == index]
    shown = next((naming for naming in own if not naming.right), own[-1])
    image = shown.image
    return Evidence(
        trial=index,
        passed=all(naming.right for naming in own),
        message=told(shown),
        t=image.t if image else None,
        pose=image.pose if image else None,
    )


def told(naming: Naming) -> str:
    """A sentence on one picture."""
    if naming.image is None:
        return (
            f"Expected {quoted(naming.truth)}, but {naming.words}."
            if naming.truth != NO_PICTURE
            else ("Expected a picture (IMG_DATA), but the robot sent none.")
        )
    if naming.right:
        return f"The picture showed {quoted(naming.truth)} and was named so."
    return f"The picture showed {quoted(naming.truth)}, but {naming.words}."


def _truths(criterion: Classification, assignment: Assignment, trial: TrialResult) -> list[tuple[Image, str]]:
    """The pictures of a trial that count, with what they show; those of unlabelled floor show nothing to name."""
    images = trial.recording.images
    if criterion.truth == "label":
        known = [(image, image.truth) for image in images if image.truth is not None]
    else:
        truth = _told_truth(criterion.truth, assignment, trial)
        known = [(image, truth) for image in images]
    match criterion.pictures:
        case "first":
            return known[:1]
        case "last":
            return known[-1:]
        case "all":
            return known


def _told_truth(truths: tuple[str, ...], assignment: Assignment, trial: TrialResult) -> str:
    """The label for the pose that the trial started from."""
    planned = next(
        planned
        for planned in assignment.trials()
        if planned.scenario.id == trial.scenario and planned.index == trial.index
    )
    return truths[planned.scenario.poses.index(planned.pose)]


def _missing_truth(criterion: Classification, assignment: Assignment, trial: TrialResult) -> str:
    if criterion.truth == "label":
        return NO_PICTURE
    return _told_truth(criterion.truth, assignment, trial)


def _labels(criterion: Classification, assignment: Assignment, truths: Iterable[str]) -> tuple[str, ...]:
    """All that can be named: as the criterion lists it, else what the floor, the aliases and the truths have."""
    if criterion.labels:
        return criterion.labels
    background = assignment.world.background
    on_floor = [label.label for label in floor(background).labels] if background in names() else []
    listed = criterion.truth if criterion.truth != "label" else ()
    return tuple(dict.fromkeys([*on_floor, *listed, *truths, *criterion.aliases]))


def _answer(
    criterion: Classification, recording: Recording, answers: Answers, image: Image, finder: _Finder
) -> tuple[str | None, str]:
    """The label that the answer to a picture names, None if it names none or two; and what happened, in words."""
    if criterion.answer_from == "reply":
        reply = answers.to(image.message)
        if reply is None:
            return None, answers.silence(image.message)
        text = reply.text
        if criterion.answer is not None:
            value = at_path(parsed(text), criterion.answer)
            text = text if value is NOTHING else as_text(value)
    else:
        heard = _between(recording, image, criterion.answer_from == "speech")
        if not heard:
            said = "said" if criterion.answer_from == "speech" else "printed"
            return None, f"the robot {said} nothing after it"
        text = " | ".join(line.text for line in heard)
    found = finder.labels_in(text)
    if not found:
        return None, f"the answer names no label: {quoted(text)}"
    if len(found) > 1:
        return None, f"the answer names more than one label: {' and '.join(map(quoted, found))}"
    return found[0], f"it was taken for {quoted(found[0])}"


def _between(recording: Recording, image: Image, speech: bool) -> Sequence[Line]:
    """What the robot said or printed after this picture and before the next."""
    following = bisect_right(recording.images, image.message, key=lambda other: other.message)
    end = recording.images[following].t if following < len(recording.images) else math.inf
    lines = recording.spoken if speech else recording.printed
    return lines[bisect_left(lines, image.t, key=_time) : bisect_left(lines, end, key=_time)]


def _time(line: Line) -> float:
    return line.t


class _Finder:
    """Finds labels and their other names in a text, the longest first, as whole words."""

    def __init__(self, labels: Iterable[str], aliases: Mapping[str, Sequence[str]]) -> None:
        self._names: dict[str, str] = {}
        for label in labels:
            self._names[_words(label)] = label
        for label, others in aliases.items():
            for name in (label, *others):
                self._names.setdefault(_words(name), self.canonical(label))
        longest_first = sorted((name for name in self._names if name), key=len, reverse=True)
        alternatives = "|".join(map(re.escape, longest_first))
        self._pattern = re.compile(rf"(?<!\w)(?:{alternatives})(?!\w)") if alternatives else None

    def canonical(self, label: str) -> str:
        """The label as the criterion spells it."""
        return self._names.get(_words(label), label)

    def labels_in(self, text: str) -> list[str]:
        """The different labels that a text names, in the order in which it names them."""
        if self._pattern is None:
            return []
        found = self._pattern.findall(_words(text[:_LONGEST_ANSWER]))
        return list(dict.fromkeys(self._names[name] for name in found))


def _words(text: str) -> str:
    """Without case, hyphens, underscores and extra spaces."""
    return " ".join(re.sub(r"[-‐-―_]", " ", text).casefold().split())
