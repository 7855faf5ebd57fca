"""What the robot's left light sensor sees at a pose on a floor, as it is in a trial: drive, camera and noise included.

A place says what is there to be named; who names it is ``evaluation.py``'s business.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import TracebackType

from models.preprocessing import Grey, focus
from sim.arena import Arena
from sim.camera import Cameras
from sim.chance import Stream
from sim.floors import Floor, floor
from sim.recording import Pose
from sim.robot import robot
from sim.world import Chain, Noise, World


@dataclass(frozen=True, slots=True)
class LabelledPose:
    """Where the robot stands to see one thing, on which floor, and the number of that thing's class."""

    background: str
    sheet: int
    pose: Pose
    label: int


@dataclass(frozen=True, slots=True)
class Shift:
    """How far beside a place the robot stands, mm and degrees, and how noisy its light sensor is, grey levels."""

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0
    noise: float = 0.0


class Photographer:
    """A robot that is put down at places. Use it as a context manager."""

    def __init__(self) -> None:
        self._arena = Arena(())
        # A test goes through its sheets, six at most, once for each value that it varies.
        self._cameras = Cameras(most=6)
        self._robot = robot("Default_Robot")

    def __enter__(self) -> Photographer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._cameras.close()
        self._arena.close()

    def image(self, place: LabelledPose, shift: Shift, seed: int = 0) -> Grey:
        """The grey focus of the left light sensor, shape (14, 14)."""
        pose = Pose(place.pose.x + shift.x, place.pose.y + shift.y, place.pose.heading + shift.heading)
        camera = self._cameras.camera(_ground(place).pixels)
        world = World(self._robot, self._arena, camera, pose, Noise(light=shift.noise), seed, Chain())
        return focus(world.images()[0])

    def draws(
        self, places: Sequence[LabelledPose], shift: Shift, name: str, draws: int
    ) -> Iterator[tuple[LabelledPose, Grey]]:
        """Every place ``draws`` times, each time with noise of its own that ``name`` decides; once without noise."""
        for number, place in enumerate(places):
            for draw in range(draws if shift.noise > 0 else 1):
                yield place, self.image(place, shift, Stream(0, f"{name}:{shift}:{number}:{draw}").integer(0) >> 1)


def _ground(place: LabelledPose) -> Floor:
    return floor(place.background, seed=place.sheet)
