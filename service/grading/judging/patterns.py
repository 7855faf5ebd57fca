"""The class assigned to each image, and the combination of several images of one pattern.

Images belong together if they show the same thing at the same place under the sensor.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Literal

from service.grading.judging.geometry import Side, locate_part
from service.grading.judging.message_parts import quote_list
from sim.recording import Image, Recording
from sim.sentences import Sentence

CombinationRule = Literal["first", "any", "majority"]
_Place = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Sample:
    """One image that counts, or a missing one: its true label, the assigned label, and a description."""

    trial: int  # index into the grade's trials
    image: Image | None
    truth: str
    answer: str | None
    words: str  # a description, for a sentence
    confidence: float | None = None
    unnamed: str | None = None  # the answer, if it names no label

    @property
    def is_correct(self) -> bool:
        """Return whether the image was identified correctly."""
        return self.answer == self.truth


def group_by_pattern(
    images: Sequence[Sample], recording: Recording, rule: CombinationRule, radius: float, side: Side = "left"
) -> list[Sample]:
    """Return one sample per pattern of a trial's ``images``, in the order in which the robot reached them.

    Images with the same truth belong to one pattern if the sensor of that ``side`` was within ``radius`` mm of its
    position at the first of them.
    """
    groups = _PatternGroups(radius)
    for image in images:
        if image.image is not None:
            groups.add(image, locate_part(recording, side, image.image.pose))
    return [_combine_group(group, rule) for group in groups.found]


@dataclass(slots=True)
class _PatternGroups:
    """Images by pattern. The floor is divided into squares, so that only neighbours are compared."""

    apart: float
    found: list[list[Sample]] = field(default_factory=list)
    _near: dict[tuple[str, int, int], list[tuple[int, _Place]]] = field(default_factory=dict)

    def add(self, image: Sample, position: _Place) -> None:
        key = (image.truth, *self._find_square(position))
        numbers = [number for number, first in self._find_neighbours(key) if math.dist(first, position) <= self.apart]
        if numbers:
            self.found[min(numbers)].append(image)
        else:
            self._near.setdefault(key, []).append((len(self.found), position))
            self.found.append([image])

    def _find_square(self, position: _Place) -> tuple[int, int]:
        return math.floor(position[0] / self.apart), math.floor(position[1] / self.apart)

    def _find_neighbours(self, square: tuple[str, int, int]) -> Iterable[tuple[int, _Place]]:
        truth, column, row = square
        for column_step, row_step in product((-1, 0, 1), repeat=2):
            yield from self._near.get((truth, column + column_step, row + row_step), ())


def _combine_group(group: Sequence[Sample], rule: CombinationRule) -> Sample:
    if len(group) == 1:
        return group[0]
    match rule:
        case "first":
            return group[0]
        case "any":
            return next((sample for sample in group if sample.is_correct), group[0])
        case "majority":
            return _choose_majority(group)


def _choose_majority(group: Sequence[Sample]) -> Sample:
    """Return the image with the most frequent answer. Without a single most frequent one, the sample has no answer."""
    counts = Counter(sample.answer for sample in group if sample.answer is not None).most_common()
    if not counts:
        return group[0]
    top_count = counts[0][1]
    leaders = tuple(str(answer) for answer, count in counts if count == top_count)
    if len(leaders) > 1:
        description = Sentence(
            "%(labels)s were answered equally often for its %(count)s images",
            labels=quote_list(leaders),
            count=len(group),
        )
        return replace(group[0], answer=None, words=description, unnamed=None)
    majority_sample = next(sample for sample in group if sample.answer == leaders[0])
    description = Sentence(
        "it was identified as %(label)s %(count)s times in %(images)s images",
        label=quote_list(leaders),
        count=top_count,
        images=len(group),
    )
    return replace(majority_sample, words=description)
