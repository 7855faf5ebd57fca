"""One trial's world: the drive, the sensors and the touches, advanced tick by tick and written down as they go.

A world is made afresh for every trial from parts that keep no state (arena, camera); it knows nothing of programs
or messages, and time moves only when ``tick`` is called.
"""

from __future__ import annotations

import hashlib
import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np

from sim.arena import Arena
from sim.camera import LightCamera
from sim.chance import Stream
from sim.drive import Drive
from sim.motion import COURSE_PHYSICS, Physics
from sim.recording import COLUMNS, SECOND, SENSORS, TICK, Pose, Ticks, Touch
from sim.robot import Robot
from sim.sensors import Footprint, LightReader, footprint
from sim.trigonometry import sincos

#: A row: the time and all columns, of which those of the chain come first.
_ROW = struct.Struct("<q" + "".join(f"{each.width}{'q' if each.whole else 'd'}" for each in COLUMNS))
_TABLE = np.dtype(
    [("time", "<i8"), *((each.name, each.dtype, (each.width,) if each.width > 1 else ()) for each in COLUMNS)]
)
_CHAINED = 8 + 8 * sum(each.width for each in COLUMNS if each.in_chain)  # bytes
_sources = ", ".join(f"*world.{each.source}" if each.width > 1 else f"world.{each.source}" for each in COLUMNS)
# Written out once, as it is called at every tick: to follow the table there would take a twentieth of the whole tick.
_row_of: Callable[[World], tuple[float, ...]] = eval(f"lambda world: ({_sources},)")
_readings = attrgetter(*SENSORS.values())
_RIGHT_ANGLE = math.pi / 2


@dataclass(frozen=True, slots=True)
class Noise:
    """Amplitudes: grey levels for each pixel of a light sensor, degrees per second for each wheel.

    In the original a wheel at a negative speed has no noise; with ``both_directions`` it has.
    """

    light: float = 0.0
    motor: float = 0.0
    both_directions: bool = False


class Chain:
    """The SHA-256 of everything that happened, in order."""

    def __init__(self) -> None:
        self._digest = hashlib.sha256()
        #: Something as it is: called for each tick with its row, and for each reading.
        self.add_bytes = self._digest.update

    def add(self, kind: str, time: int, data: bytes) -> None:
        """Something that is not a tick: its kind, when (thirds of a microsecond), and its bytes."""
        self.add_bytes(f"{kind}:{time}:{len(data)}:".encode() + data)

    @staticmethod
    def timeless(kind: str, numbers: str) -> bytes:
        """What ``add`` would add of numbers, once ``%`` has put the time into it: for what is added time and again."""
        return f"{kind}:%d:{len(numbers)}:{numbers}".encode()

    def hexdigest(self) -> str:
        """The hash of all that was added so far, 64 hexadecimal digits."""
        return self._digest.hexdigest()


class World:
    """A robot on a floor. ``clock`` counts ticks; every value that a program can read changes only at a tick."""

    def __init__(
        self,
        robot: Robot,
        arena: Arena,
        camera: LightCamera,
        pose: Pose,
        noise: Noise,
        seed: int,
        chain: Chain,
        physics: Physics = COURSE_PHYSICS,
        tick: int = TICK,
    ) -> None:
        """``tick`` is how long one lasts, units of simulated time; the equations know only thirtieths of a second."""
        self.robot = robot
        self._tick = tick
        self.clock = 0
        self.drive = Drive(
            robot,
            arena.motion(robot, physics, pose.x, pose.y, math.radians(pose.heading)),
            pose.x,
            pose.y,
            math.radians(pose.heading),
            noise.motor,
            noise.both_directions,
            Stream(seed, "left wheel"),
            Stream(seed, "right wheel"),
        )
        self._arena = arena
        self.obstacles = arena.obstacles
        self._chain = chain
        self._lights = (
            LightReader(robot.left_light, camera, noise.light, Stream(seed, "left light")),
            LightReader(robot.right_light, camera, noise.light, Stream(seed, "right light")),
        )
        self._noisy = noise.light > 0
        self._footprints: tuple[Footprint, Footprint]
        self.left_sums = self.right_sums = (0, 0, 0)
        self.ultrasonic = 0.0
        self.touches: list[Touch] = []
        # What the start pose touches already is no touch: several of the course's own overlap a wall.
        self._touching = arena.touching(robot, pose.x, pose.y, self.drive.heading)
        self._rows: list[bytes] = []
        self._sense(moved=True, listen=True)

    @property
    def pose(self) -> Pose:
        """Where the robot is now: the middle of its axle, mm, and its heading, degrees."""
        return Pose(self.drive.x, self.drive.y, self.drive.heading_degrees)

    def tick(self) -> None:
        """Advance one tick."""
        self.sense(self.move())

    def move(self) -> bool:
        """The first half of a tick: the wheels turn. Whether the robot is elsewhere, or stands otherwise, then."""
        self.clock += 1
        drive = self.drive
        x, y, heading = drive.x, drive.y, drive.heading
        drive.tick(self.clock)
        return x != drive.x or y != drive.y or heading != drive.heading

    def sense(self, moved: bool) -> None:
        """The second half, once all that shares the floor has moved: the sensors look, and the row is written."""
        self._sense(moved, listen=self.clock % 3 == 0)
        row = _ROW.pack(self.clock * self._tick, *_row_of(self))
        self._rows.append(row)
        self._chain.add_bytes(row[:_CHAINED])

    def readings(self) -> dict[str, Any]:
        """What each sensor gives a program, as of the last tick."""
        return dict(zip(SENSORS, _readings(self), strict=True))

    @property
    def left_means(self) -> list[float]:
        """Mean R, G, B of the left light sensor."""
        return _means(self.left_sums, self._lights[0].pixels)

    @property
    def right_means(self) -> list[float]:
        """Mean R, G, B of the right light sensor."""
        return _means(self.right_sums, self._lights[1].pixels)

    @property
    def gyro_angle_and_rate(self) -> list[float]:
        """What the gyro has turned, degrees, and its rate, degrees a second; both clockwise."""
        return [self.drive.gyro_angle, self.drive.gyro_rate]

    def images(self) -> tuple[bytes, bytes]:
        """RGBA bytes of the left and the right light sensor, as of the last tick."""
        left, right = (
            reader.image(where, self.clock) for reader, where in zip(self._lights, self._footprints, strict=True)
        )
        return left, right

    @property
    def left_footprint(self) -> Footprint:
        """Where the left light sensor looks."""
        return self._footprints[0]

    def ticks(self) -> Ticks:
        """All rows so far."""
        table = np.frombuffer(b"".join(self._rows), _TABLE)
        return Ticks(
            **{each.name: table[each.name].astype(each.dtype) for each in COLUMNS},
            left_pixels=self._lights[0].pixels,
            right_pixels=self._lights[1].pixels,
            length=self._tick,
        )

    def _sense(self, moved: bool, listen: bool) -> None:
        drive = self.drive
        if moved:
            sine, cosine = sincos(drive.heading - _RIGHT_ANGLE)
            left, right = self.robot.left_light, self.robot.right_light
            self._footprints = (
                footprint(left, drive.x, drive.y, sine, cosine),
                footprint(right, drive.x, drive.y, sine, cosine),
            )
            self._feel()
        if moved or self._noisy:
            self.left_sums = self._lights[0].sums(self._footprints[0], self.clock)
            self.right_sums = self._lights[1].sums(self._footprints[1], self.clock)
        if listen:
            self.ultrasonic = self._arena.distance(drive.x, drive.y, drive.heading, self.robot.ultrasonic_y)

    def _feel(self) -> None:
        touching = self._arena.touching(self.robot, self.drive.x, self.drive.y, self.drive.heading)
        for what in touching:
            if what not in self._touching:
                self.touches.append(Touch(self.clock * self._tick / SECOND, what, self.pose))
        self._touching = touching


def _means(sums: tuple[int, int, int], pixels: int) -> list[float]:
    red, green, blue = sums
    return [red / pixels, green / pixels, blue / pixels]
