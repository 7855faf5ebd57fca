"""The floor of a run before it starts: its image, its obstacles, and the start pose of each robot."""

from __future__ import annotations

from dataclasses import dataclass

from service.reports.floor_image import encode_built_in_floor, encode_own_floor
from sim.recording import Pose
from submissions.assignment.definition import Assignment

Obstacle = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class StartPicture:
    """A floor with the robots on it, in mm from the lower left corner. Obstacles have x, y, width and height."""

    floor: str
    image: str  # a data URI
    poses: tuple[Pose, ...]
    obstacles: tuple[Obstacle, ...]


def build_start_picture(assignment: Assignment) -> StartPicture:
    """Return the picture of the assignment's first trial, with a public seed. It must have one."""
    trial = next(assignment.trials())
    world = assignment.world
    sheet = trial.seed if world.sheet is None else world.sheet
    image = (
        encode_built_in_floor(world.background, world.labels, sheet)
        if world.image is None
        else encode_own_floor(world.background, world.image)
    )
    poses = (trial.pose,) if trial.second_pose is None else (trial.pose, trial.second_pose)
    return StartPicture(world.background, image, poses, world.obstacles)
