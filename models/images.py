"""Images of the robot's left light sensor at given poses, made with the sensor, camera and noise of a trial.

Each pose has the class of the object shown there; ``evaluation.py`` compares it with the prediction.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import TracebackType

from models.preprocessing import Grey, extract_focus
from sim.camera import Cameras
from sim.floors import Floor, build_floor
from sim.light_sensors import LightReader, compute_footprint
from sim.random_streams import RandomStream
from sim.recording import Pose
from sim.robot import get_robot
from sim.trigonometry import sincos


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
        # The test visits up to six sheets, once for each value of a varied condition.
        self._cameras = Cameras(capacity=6)
        self._sensor = get_robot("Default_Robot").left_light

    def __enter__(self) -> Photographer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._cameras.close()

    def take_image(self, place: LabelledPose, shift: Shift, seed: int = 0) -> Grey:
        """Return the grey focus of the left light sensor, shape (14, 14).

        It is the image of a whole world at tick 0, which would also compute the motors and all other sensors.
        """
        sine, cosine = sincos(math.radians(place.pose.heading + shift.heading) - math.pi / 2)
        footprint = compute_footprint(self._sensor, place.pose.x + shift.x, place.pose.y + shift.y, sine, cosine)
        camera = self._cameras.open_camera(_build_place_floor(place).pixels)
        reader = LightReader(self._sensor, camera, shift.noise, RandomStream(seed, "left light"))
        return extract_focus(reader.render_image(footprint, 0))

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
