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
from service.grading.judging.geometry import locate_footprint, locate_part
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.label_patches import GREYS, decode_label
from service.grading.judging.message_parts import quote_text
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from sim.floors import list_label_names
from sim.recording import Image, Recording
from sim.recording_values import get_pose_after, rebuild_floor, tick_to_seconds
from submissions.criteria.collecting import Collects

_REMAINDER_SHARE = Fraction(1, 2)


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


@declare_judge(Collects)
def judge_collects(criterion: Collects, trial: TrialResult) -> Outcome:
    """Judge the labelled image pairs: count them by class, without repetitions, and compare with the requirement."""
    recording = trial.recording
    found = collect_pairs(recording, criterion.source, trial.light_noise)
    classes = criterion.classes or list_label_names(recording.background)
    usable = [pair for pair in found if pair.label in classes]
    counts = Counter(pair.label for pair in _drop_repeated_pairs(usable, recording))
    repeated = len(found) - len(_drop_repeated_pairs(found, recording))
    measures = (
        Measure("pairs", float(len(found))),
        Measure("usable", float(len(usable))),
        Measure("duplicates", float(repeated)),
        *(Measure(f"different: {label}", float(counts[label])) for label in classes),
    )
    where = found[-1].image if found else None
    wanted = criterion.each * len(classes)
    reached = Fraction(sum(min(counts[label], criterion.each) for label in classes), wanted) if wanted else Fraction(0)
    checks = list(_build_checks(criterion, classes, counts, found, len(usable), repeated))
    wrong = next((words for holds, words in checks if not holds), None)
    if wrong is None:
        counted = ", ".join(f"{counts[label]} of {quote_text(label)}" for label in classes)
        return pass_with(
            f"Of {len(found)} pairs of images {len(usable)} are usable, {repeated} repeat an earlier one: {counted}.",
            where.t if where else None,
            where.pose if where else None,
            measures,
        )
    if reached == 1:
        reached = 1 - _REMAINDER_SHARE * Fraction(sum(not holds for holds, _ in checks), len(checks))
    return fail_with(f"{wrong}.", where.t if where else None, where.pose if where else None, reached, measures)


def _drop_repeated_pairs(found: Sequence[ImagePair], recording: Recording) -> list[ImagePair]:
    """Return the pairs whose left image shows a new window of the floor and differs from all earlier ones."""
    known: set[object] = set()
    fresh = []
    for pair in found:
        where = locate_footprint(recording, "left", pair.image.pose)
        own: set[object] = {pair.image.left, (where.column, where.row)}
        if own.isdisjoint(known):
            fresh.append(pair)
        known |= own
    return fresh


def collect_pairs(recording: Recording, source: str, light_noise: float = 0.0) -> list[ImagePair]:
    """Return the image pairs of a recording: the logged ones (``log``) or those sent as ``IMG_DATA`` (``sent``)."""
    images = recording.images if source == "sent" else tuple(_pair_logged_images(recording))
    greys = GREYS.get(recording.background, {})
    return [
        ImagePair(image, _find_true_label(recording, image), decode_label(image, greys, light_noise))
        for image in images
    ]


def _pair_logged_images(recording: Recording) -> Iterator[Image]:
    """Yield each logged left image, with the right one if it follows, like ``get_sensor_image_pair``."""
    log = recording.image_log
    for (side, left, tick), (other, right, _) in pairwise((*log, ("", "", 0))):
        if side == "left":
            t = tick_to_seconds(recording, tick)
            pixels = _parse_bytes(left)
            beside = _parse_bytes(right) if other == "right" else b""
            yield Image(
                t, tick, get_pose_after(recording, tick), pixels, beside, -1, side=round((len(pixels) / 4) ** 0.5)
            )


def _parse_bytes(csv: str) -> bytes:
    return bytes(map(int, csv.split(",")))


def _find_true_label(recording: Recording, image: Image) -> str | None:
    """Return the floor's label under the left sensor at the position of the image."""
    if image.truth is not None or image.message >= 0:
        return image.truth
    floor = rebuild_floor(recording)
    return floor.find_label(*locate_part(recording, "left", image.pose)) if floor else None


def _build_checks(
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
        f"{counts[rarest]} of {quote_text(rarest)}; {usable} of {len(found)} pairs are usable, with a pattern "
        "under the "
        "left sensor and its label patch under the right one",
    )
    if criterion.balance is not None:
        yield (
            counts[rarest] >= criterion.balance * counts[commonest],
            f"Expected the rarest class to have at least {criterion.balance:.0%} of the images of the commonest, but "
            f"there are {counts[rarest]} of {quote_text(rarest)} and {counts[commonest]} of {quote_text(commonest)}",
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
