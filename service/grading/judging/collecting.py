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
from service.grading.judging.message_parts import join_with_commas, quote_text
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from service.language import translatable
from sim.floors import list_label_names
from sim.recording import Image, Recording
from sim.recording_values import get_pose_after, rebuild_floor, tick_to_seconds
from sim.sentences import Sentence
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
    pairs = collect_pairs(recording, criterion.source, trial.light_noise)
    classes = criterion.classes or list_label_names(recording.background)
    usable = [pair for pair in pairs if pair.label in classes]
    counts = Counter(pair.label for pair in _drop_repeated_pairs(usable, recording))
    repeated_count = len(pairs) - len(_drop_repeated_pairs(pairs, recording))
    measures = (
        Measure(Sentence("pairs"), float(len(pairs))),
        Measure(Sentence("usable"), float(len(usable))),
        Measure(Sentence("duplicates"), float(repeated_count)),
        *(Measure(Sentence("different: %(label)s", label=label), float(counts[label])) for label in classes),
    )
    last_image = pairs[-1].image if pairs else None
    required_count = criterion.each * len(classes)
    score = (
        Fraction(sum(min(counts[label], criterion.each) for label in classes), required_count)
        if required_count
        else Fraction(0)
    )
    checks = list(_build_checks(criterion, classes, counts, pairs, len(usable), repeated_count))
    problem = next((words for holds, words in checks if not holds), None)
    if problem is None:
        class_counts = [
            Sentence("%(count)s of %(label)s", count=counts[label], label=quote_text(label)) for label in classes
        ]
        return pass_with(
            Sentence(
                "Of %(pairs)s pairs of images %(usable)s are usable, %(repeated)s repeat an earlier one: %(counts)s.",
                pairs=len(pairs),
                usable=len(usable),
                repeated=repeated_count,
                counts=join_with_commas(class_counts),
            ),
            last_image.t if last_image else None,
            last_image.pose if last_image else None,
            measures,
        )
    if score == 1:
        score = 1 - _REMAINDER_SHARE * Fraction(sum(not holds for holds, _ in checks), len(checks))
    return fail_with(
        problem, last_image.t if last_image else None, last_image.pose if last_image else None, score, measures
    )


def _drop_repeated_pairs(pairs: Sequence[ImagePair], recording: Recording) -> list[ImagePair]:
    """Return the pairs whose left image shows a new window of the floor and differs from all earlier ones."""
    known_keys: set[object] = set()
    distinct_pairs = []
    for pair in pairs:
        footprint = locate_footprint(recording, "left", pair.image.pose)
        keys: set[object] = {pair.image.left, (footprint.column, footprint.row)}
        if keys.isdisjoint(known_keys):
            distinct_pairs.append(pair)
        known_keys |= keys
    return distinct_pairs


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
    for (side, left_csv, tick), (next_side, right_csv, _) in pairwise((*log, ("", "", 0))):
        if side == "left":
            t = tick_to_seconds(recording, tick)
            pixels = _parse_bytes(left_csv)
            right_pixels = _parse_bytes(right_csv) if next_side == "right" else b""
            yield Image(
                t, tick, get_pose_after(recording, tick), pixels, right_pixels, -1, side=round((len(pixels) / 4) ** 0.5)
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
    pairs: Sequence[ImagePair],
    usable: int,
    repeated_count: int,
) -> Iterator[tuple[bool, str]]:
    """Yield each condition with the message for the case that it fails."""
    command = "image_data both" if criterion.source == "log" else "IMG_DATA"
    yield (
        bool(pairs),
        Sentence("Expected pairs of images to be collected, but there are none (%(command)s).", command=command),
    )
    rarest = min(classes, key=lambda label: counts[label], default="")
    commonest = max(classes, key=lambda label: counts[label], default="")
    template = (
        translatable(
            "Expected at least 1 different usable image of each class, but there are %(count)s of %(label)s; "
            "%(usable)s of %(pairs)s pairs are usable, with a pattern under the left sensor and its label patch under "
            "the right one."
        )
        if criterion.each == 1
        else translatable(
            "Expected at least %(least)s different usable images of each class, but there are %(count)s of %(label)s; "
            "%(usable)s of %(pairs)s pairs are usable, with a pattern under the left sensor and its label patch under "
            "the right one."
        )
    )
    yield (
        bool(classes) and counts[rarest] >= criterion.each,
        Sentence(
            template,
            least=criterion.each,
            count=counts[rarest],
            label=quote_text(rarest),
            usable=usable,
            pairs=len(pairs),
        ),
    )
    if criterion.balance is not None:
        yield (
            counts[rarest] >= criterion.balance * counts[commonest],
            Sentence(
                "Expected the rarest class to have at least %(percent).0f%% of the images of the commonest, but there "
                "are %(count)s of %(label)s and %(other_count)s of %(other_label)s.",
                percent=100 * criterion.balance,
                count=counts[rarest],
                label=quote_text(rarest),
                other_count=counts[commonest],
                other_label=quote_text(commonest),
            ),
        )
    yield (
        repeated_count <= criterion.most_duplicates * len(pairs),
        Sentence(
            "Expected at most %(percent).0f%% of the images to repeat an earlier one, but %(count)s of %(pairs)s do.",
            percent=100 * criterion.most_duplicates,
            count=repeated_count,
            pairs=len(pairs),
        ),
    )
    useless = len(pairs) - usable
    yield (
        useless <= criterion.most_unusable * len(pairs),
        Sentence(
            "Expected at most %(percent).0f%% of pairs to be unusable, but %(count)s of %(pairs)s are.",
            percent=100 * criterion.most_unusable,
            count=useless,
            pairs=len(pairs),
        ),
    )
