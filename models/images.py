"""Images of the robot's left light sensor at given poses, made with the drive, camera and noise of a trial.

Each pose has the class of the object shown there; ``evaluation.py`` compares it with the prediction.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import TracebackType

from models.preprocessing import Grey, extract_focus
from sim.arena import Arena
from sim.camera import Cameras
from sim.floors import Floor, build_floor
from sim.random_streams import RandomStream
from sim.recording import Pose
from sim.robot import get_robot
from sim.world import HashChain, Noise, World


@dataclass(frozen=True, slots=True)
class LabelledPose:
    """Pose of the robot on a floor, and the class number of the object that its sensor sees."""

    background: str
    sheet: int
    pose: Pose
    label: int


@dataclass(frozen=True, slots=True)
class Shift:
    """Offset of the robot from a pose (mm and degrees), and noise of the light sensor (grey levels)."""

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0
    noise: float = 0.0


class Photographer:
    """Robot that takes images at given poses. Use it as a context manager."""

    def __init__(self) -> None:
        self._arena = Arena(())
        # The test visits up to six sheets, once for each value of a varied condition.
        self._cameras = Cameras(capacity=6)
        self._robot = get_robot("Default_Robot")

    def __enter__(self) -> Photographer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._cameras.close()
        self._arena.close()

    def take_image(self, place: LabelledPose, shift: Shift, seed: int = 0) -> Grey:
        """Return the grey focus of the left light sensor, shape (14, 14)."""
        pose = Pose(place.pose.x + shift.x, place.pose.y + shift.y, place.pose.heading + shift.heading)
        camera = self._cameras.open_camera(_build_place_floor(place).pixels)
        world = World(self._robot, self._arena, camera, pose, Noise(light=shift.noise), seed, HashChain())
        return extract_focus(world.render_images()[0])

    def draws(
        self, places: Sequence[LabelledPose], shift: Shift, name: str, draws: int
    ) -> Iterator[tuple[LabelledPose, Grey]]:
        """Yield every place ``draws`` times, each with its own noise seeded by ``name``; once without noise."""
        for number, place in enumerate(places):
            for draw in range(draws if shift.noise > 0 else 1):
                yield (
                    place,
                    self.take_image(place, shift, RandomStream(0, f"{name}:{shift}:{number}:{draw}").integer(0) >> 1),
                )


def _build_place_floor(place: LabelledPose) -> Floor:
    return build_floor(place.background, seed=place.sheet)
