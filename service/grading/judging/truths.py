"""What each image shows: as the floor, its grey patch, the instructor's places or the assignment's list has it.

Which images count, too; what was answered is none of this module's business.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from service.grading.grade import TrialResult
from service.grading.judging.geometry import part_at
from service.grading.judging.judges import Indexed
from service.grading.judging.label_patches import CODES, GREYS, decoded
from sim.floors import label_names
from sim.recorded import floor_of
from sim.recording import Pose, Recording
from submissions.assignment.definition import Assignment
from submissions.assignment.truth_file import LabelledPlace
from submissions.criteria.recognition import Recognition

#: Stands for the truth of an image that was never sent, where the assignment does not tell it.
NO_IMAGE = "(no image)"

#: The number of an image in its recording, and what it shows.
NumberedTruth = tuple[int, str]


def shown_in(criterion: Recognition, trials: Indexed) -> Mapping[int, Sequence[NumberedTruth]]:
    """For each trial (by its index in the grade) the images that count, in the order in which they were sent.

    Images of floor that has no name show nothing to name, and do not count.
    """
    return {index: _counted(criterion, _known(criterion, trial)) for index, trial in trials}


def missing_truth(criterion: Recognition, trial: TrialResult) -> str:
    """What a trial without an image should have shown, where the assignment tells it."""
    return _told(criterion, trial) or NO_IMAGE


def nameable(criterion: Recognition, assignment: Assignment, truths: Sequence[str]) -> tuple[str, ...]:
    """All that can be named: as the criterion lists it, else what the floor, the truths and the aliases have."""
    if criterion.labels:
        return criterion.labels
    # The instructor's own places have labels of their own; everything else may be what the floor has.
    on_floor = () if criterion.truth == "places" else label_names(assignment.world.background)
    listed = criterion.truth if isinstance(criterion.truth, tuple) else ()
    placed = tuple(label for _, _, label in _places(criterion))
    greys = CODES[criterion.greys].values() if isinstance(criterion.greys, str) else criterion.greys
    return tuple(dict.fromkeys([*on_floor, *listed, *placed, *greys, *truths, *criterion.aliases]))


def _counted(criterion: Recognition, known: Sequence[NumberedTruth]) -> Sequence[NumberedTruth]:
    match criterion.images:
        case "first":
            return known[:1]
        case "last":
            return known[-1:]
        case "all":
            return known


def _known(criterion: Recognition, trial: TrialResult) -> list[NumberedTruth]:
    recording = trial.recording
    found: list[NumberedTruth] = []
    for number, image in enumerate(recording.images):
        if criterion.near_start is not None and _look_from_start(recording, image.pose) > criterion.near_start:
            continue
        if criterion.near_spot is not None and _look_from_spot(criterion, recording, image.pose) > criterion.near_spot:
            continue
        truth: str | None
        match criterion.truth:
            case "label":
                truth = image.truth
            case "grey":
                truth = decoded(image, _greys(criterion, recording), trial.light_noise)
            case "places":
                truth = _nearest(_places(criterion), part_at(recording, "left", image.pose), criterion.within)
            case _:
                truth = _told(criterion, trial)
        if truth is not None:
            found.append((number, truth))
    return found


def _greys(criterion: Recognition, recording: Recording) -> Mapping[int, str]:
    """The label of each grey: the assignment's own, else what the floor's patches are."""
    if isinstance(criterion.greys, str):
        return CODES[criterion.greys]
    own = {grey: label for label, grey in criterion.greys.items()}
    return own or GREYS.get(recording.background, {})


def _look_from_start(recording: Recording, pose: Pose) -> float:
    """How far the left sensor is, with the robot at ``pose``, from where it was at the start, mm."""
    return math.dist(part_at(recording, "left", pose), part_at(recording, "left", recording.start))


def _look_from_spot(criterion: Recognition, recording: Recording, pose: Pose) -> float:
    """How far the left sensor is, with the robot at ``pose``, from the middle of the nearest thing with a label, mm."""
    look = part_at(recording, "left", pose)
    floor = floor_of(recording)
    labels = () if floor is None else floor.labels
    spots = [(each.x + each.width / 2, each.y + each.height / 2) for each in labels]
    spots += [place[:2] for place in _places(criterion)]
    return min((math.dist(look, spot) for spot in spots), default=math.inf)


def _told(criterion: Recognition, trial: TrialResult) -> str | None:
    """The label that the criterion lists for the pose that the trial starts from, if it lists one."""
    truths = criterion.truth
    return truths[trial.place] if isinstance(truths, tuple) and trial.place < len(truths) else None


def _places(criterion: Recognition) -> Sequence[LabelledPlace]:
    """The instructor's places; a file's name has been replaced by its rows when the assignment was read."""
    return () if isinstance(criterion.places, str) else criterion.places


def _nearest(places: Sequence[LabelledPlace], where: tuple[float, float], within: float) -> str | None:
    near = min(places, key=lambda place: math.dist(place[:2], where), default=None)
    return near[2] if near is not None and math.dist(near[:2], where) <= within else None
