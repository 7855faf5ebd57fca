"""The true label of each image, from the floor, its grey patch, the instructor's places or a list.

The module also decides which images count. It does not handle answers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from service.grading.grade import TrialResult
from service.grading.judging.geometry import locate_part
from service.grading.judging.judge_declaration import IndexedTrials
from service.grading.judging.label_patches import CODES, GREYS, decode_label
from sim.floors import list_label_names
from sim.recording import Pose, Recording
from sim.recording_values import rebuild_floor
from submissions.assignment.definition import Assignment
from submissions.assignment.truth_file import LabelledPlace
from submissions.criteria.recognition import Recognition

#: The truth of an image that was never sent, if the assignment does not define it.
NO_IMAGE = "(no image)"

#: The number of an image in its recording, and its true label.
NumberedTruth = tuple[int, str]


def find_counted_images(criterion: Recognition, trials: IndexedTrials) -> Mapping[int, Sequence[NumberedTruth]]:
    """Return the images that count for each trial (by its index in the grade), in the order sent.

    Images of unlabelled floor don't count.
    """
    return {index: _pick_counted(criterion, _collect_known_truths(criterion, trial)) for index, trial in trials}


def find_missing_label(criterion: Recognition, trial: TrialResult) -> str:
    """Return the true label of a missing image, if the assignment defines it; otherwise ``NO_IMAGE``."""
    return _find_listed_label(criterion, trial) or NO_IMAGE


def collect_labels(criterion: Recognition, assignment: Assignment, truths: Sequence[str]) -> tuple[str, ...]:
    """Return all possible labels: the criterion's list, otherwise those of the floor, truths and aliases."""
    if criterion.labels:
        return criterion.labels
    # The instructor's places have their own labels. Otherwise, all labels of the floor are possible.
    floor_labels = () if criterion.truth == "places" else list_label_names(assignment.world.background)
    listed_labels = criterion.truth if isinstance(criterion.truth, tuple) else ()
    place_labels = tuple(label for _, _, label in _list_places(criterion))
    greys = CODES[criterion.greys].values() if isinstance(criterion.greys, str) else criterion.greys
    return tuple(dict.fromkeys([*floor_labels, *listed_labels, *place_labels, *greys, *truths, *criterion.aliases]))


def _pick_counted(criterion: Recognition, truths: Sequence[NumberedTruth]) -> Sequence[NumberedTruth]:
    match criterion.images:
        case "first":
            return truths[:1]
        case "last":
            return truths[-1:]
        case "all":
            return truths


def _collect_known_truths(criterion: Recognition, trial: TrialResult) -> list[NumberedTruth]:
    recording = trial.recording
    truths: list[NumberedTruth] = []
    for number, image in enumerate(recording.images):
        if criterion.near_start is not None and _measure_start_distance(recording, image.pose) > criterion.near_start:
            continue
        if (
            criterion.near_spot is not None
            and _measure_spot_distance(criterion, recording, image.pose) > criterion.near_spot
        ):
            continue
        truth: str | None
        match criterion.truth:
            case "label":
                truth = image.truth
            case "grey":
                truth = decode_label(image, _map_grey_labels(criterion, recording), trial.light_noise)
            case "places":
                truth = _find_nearest_label(
                    _list_places(criterion), locate_part(recording, "left", image.pose), criterion.within
                )
            case _:
                truth = _find_listed_label(criterion, trial)
        if truth is not None:
            truths.append((number, truth))
    return truths


def _map_grey_labels(criterion: Recognition, recording: Recording) -> Mapping[int, str]:
    """Return the label of each grey: the assignment's own, otherwise those of the floor's patches."""
    if isinstance(criterion.greys, str):
        return CODES[criterion.greys]
    labels_by_grey = {grey: label for label, grey in criterion.greys.items()}
    return labels_by_grey or GREYS.get(recording.background, {})


def _measure_start_distance(recording: Recording, pose: Pose) -> float:
    """Return the distance of the left sensor, with the robot at ``pose``, from its start position, mm."""
    return math.dist(locate_part(recording, "left", pose), locate_part(recording, "left", recording.start))


def _measure_spot_distance(criterion: Recognition, recording: Recording, pose: Pose) -> float:
    """Return the distance of the left sensor, at ``pose``, from the centre of the nearest labelled thing, mm."""
    sensor_position = locate_part(recording, "left", pose)
    floor = rebuild_floor(recording)
    labels = () if floor is None else floor.labels
    spots = [(each.x + each.width / 2, each.y + each.height / 2) for each in labels]
    spots += [place[:2] for place in _list_places(criterion)]
    return min((math.dist(sensor_position, spot) for spot in spots), default=math.inf)


def _find_listed_label(criterion: Recognition, trial: TrialResult) -> str | None:
    """Return the label that the criterion lists for the trial's start pose, or None."""
    truths = criterion.truth
    return truths[trial.place] if isinstance(truths, tuple) and trial.place < len(truths) else None


def _list_places(criterion: Recognition) -> Sequence[LabelledPlace]:
    """Return the instructor's places. A file name was replaced by its rows when the assignment was read."""
    return () if isinstance(criterion.places, str) else criterion.places


def _find_nearest_label(
    places: Sequence[LabelledPlace], position: tuple[float, float], max_distance: float
) -> str | None:
    nearest = min(places, key=lambda place: math.dist(place[:2], position), default=None)
    return nearest[2] if nearest is not None and math.dist(nearest[:2], position) <= max_distance else None
