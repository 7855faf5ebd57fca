"""Judging of training data that a robot collected: image pairs, their labels, balance and duplicates.

The images come from the simulator's recording. ``training.py`` tests whether a network learns from them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

from service.grading.grade import Measure, TrialResult
from service.grading.judging.geometry import footprint_at, part_at
from service.grading.judging.judges import judges
from service.grading.judging.label_patches import GREYS, decoded
from service.grading.judging.message_parts import quoted
from service.grading.judging.outcome import Outcome, failed, passed
from sim.floors import label_names
from sim.recorded import floor_of, pose_after, seconds_at
from sim.recording import Image, Recording
from submissions.criteria.collecting import Collects

_PART_FOR_THE_REST = Fraction(1, 2)


@dataclass(frozen=True, slots=True)
class ImagePair:
    """A left and right image of the same moment, with the label on the floor and the one coded in grey.

    ``truth`` is the floor's label under the left sensor, ``decoded`` the label of the right image's grey.
    """

    image: Image
    truth: str | None
    decoded: str | None

    @property
    def label(self) -> str | None:
        """The training label of the pair; None if its two labels differ or one is missing."""
        return self.truth if self.truth is not None and self.truth == self.decoded else None


@judges(Collects)
def judge_collects(criterion: Collects, trial: TrialResult) -> Outcome:
    """Judge the labelled image pairs: count them by class, without repetitions, and compare with the requirement."""
    recording = trial.recording
    found = pairs(recording, criterion.source, trial.light_noise)
    classes = criterion.classes or label_names(recording.background)
    usable = [pair for pair in found if pair.label in classes]
    counts = Counter(pair.label for pair in _different(usable, recording))
    repeated = len(found) - len(_different(found, recording))
    measures = (
        Measure("pairs", float(len(found))),
        Measure("usable", float(len(usable))),
        Measure("duplicates", float(repeated)),
        *(Measure(f"different: {label}", float(counts[label])) for label in classes),
    )
    where = found[-1].image if found else None
    wanted = criterion.each * len(classes)
    reached = Fraction(sum(min(counts[label], criterion.each) for label in classes), wanted) if wanted else Fraction(0)
    checks = list(_checks(criterion, classes, counts, found, len(usable), repeated))
    wrong = next((words for holds, words in checks if not holds), None)
    if wrong is None:
        counted = ", ".join(f"{counts[label]} of {quoted(label)}" for label in classes)
        return passed(
            f"Of {len(found)} pairs of images {len(usable)} are usable, {repeated} repeat an earlier one: {counted}.",
            where.t if where else None,
            where.pose if where else None,
            measures,
        )
    if reached == 1:
        reached = 1 - _PART_FOR_THE_REST * Fraction(sum(not holds for holds, _ in checks), len(checks))
    return failed(f"{wrong}.", where.t if where else None, where.pose if where else None, reached, measures)


def _different(found: Sequence[ImagePair], recording: Recording) -> list[ImagePair]:
    """Return the pairs whose left image shows a new window of the floor and differs from all earlier ones."""
    known: set[object] = set()
    fresh = []
    for pair in found:
        where = footprint_at(recording, "left", pair.image.pose)
        own: set[object] = {pair.image.left, (where.column, where.row)}
        if own.isdisjoint(known):
            fresh.append(pair)
        known |= own
    return fresh


def pairs(recording: Recording, source: str, light_noise: float = 0.0) -> list[ImagePair]:
    """Return the image pairs of a recording: the logged ones (``log``) or those sent as ``IMG_DATA`` (``sent``)."""
    images = recording.images if source == "sent" else tuple(_logged(recording))
    greys = GREYS.get(recording.background, {})
    return [ImagePair(image, _truth(recording, image), decoded(image, greys, light_noise)) for image in images]


def _logged(recording: Recording) -> Iterator[Image]:
    """Yield each logged left image, with the right one if it follows, like ``get_sensor_image_pair``."""
    log = recording.image_log
    for (side, left, tick), (other, right, _) in pairwise((*log, ("", "", 0))):
        if side == "left":
            t = seconds_at(recording, tick)
            pixels = _bytes(left)
            beside = _bytes(right) if other == "right" else b""
            yield Image(t, tick, pose_after(recording, tick), pixels, beside, -1, side=round((len(pixels) / 4) ** 0.5))


def _bytes(csv: str) -> bytes:
    return bytes(map(int, csv.split(",")))


def _truth(recording: Recording, image: Image) -> str | None:
    """Return the floor's label under the left sensor at the position of the image."""
    if image.truth is not None or image.message >= 0:
        return image.truth
    floor = floor_of(recording)
    return floor.label_at(*part_at(recording, "left", image.pose)) if floor else None


def _checks(
    criterion: Collects,
    classes: Sequence[str],
    counts: Counter[str | None],
    found: Sequence[ImagePair],
    usable: int,
    repeated: int,
) -> Iterator[tuple[bool, str]]:
    """Yield each condition with the message for the case that it fails."""
    how = "image_data both" if criterion.source == "log" else "IMG_DATA"
    yield bool(found), f"Expected pairs of images to be collected, but there are none ({how})"
    rarest = min(classes, key=lambda label: counts[label], default="")
    commonest = max(classes, key=lambda label: counts[label], default="")
    images = "image" if criterion.each == 1 else "images"
    yield (
        bool(classes) and counts[rarest] >= criterion.each,
        f"Expected at least {criterion.each} different usable {images} of each class, but there are "
        f"{counts[rarest]} of {quoted(rarest)}; {usable} of {len(found)} pairs are usable, with a pattern under the "
        "left sensor and its label patch under the right one",
    )
    if criterion.balance is not None:
        yield (
            counts[rarest] >= criterion.balance * counts[commonest],
            f"Expected the rarest class to have at least {criterion.balance:.0%} of the images of the commonest, but "
            f"there are {counts[rarest]} of {quoted(rarest)} and {counts[commonest]} of {quoted(commonest)}",
        )
    yield (
        repeated <= criterion.most_duplicates * len(found),
        f"Expected at most {criterion.most_duplicates:.0%} of the images to repeat an earlier one, but {repeated} of "
        f"{len(found)} do",
    )
    useless = len(found) - usable
    yield (
        useless <= criterion.most_unusable * len(found),
        f"Expected at most {criterion.most_unusable:.0%} of pairs to be unusable, but {useless} of {len(found)} are",
    )
