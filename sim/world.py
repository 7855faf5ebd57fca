"""One trial's world: the drive, the sensors and the touches, advanced tick by tick and written down as they go.

A world is made afresh for every trial from parts that keep no state (arena, camera); it knows nothing of programs
or messages, and time moves only when ``tick`` is called.
"""

from __future__ import annotations

import hashlib
import math
import struct
from dataclasses import dataclass

import numpy as np

from sim.arena import Arena
from sim.camera import LightCamera
from sim.chance import Stream
from sim.drive import Drive
from sim.motion import COURSE_PHYSICS, Physics
from sim.recording import TICK, Pose, Ticks, Touch
from sim.robot import Robot
from sim.sensors import Footprint, LightReader, footprint
from sim.trigonometry import sincos

_ROW = struct.Struct("<q5d6q2d")
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

    def add(self, kind: str, time: int, data: bytes) -> None:
        """Something that is not a tick: its kind, when (thirds of a microsecond), and its bytes."""
        self._digest.update(f"{kind}:{time}:{len(data)}:".encode() + data)

    def add_row(self, row: bytes) -> None:
        self._digest.update(row)

    def hexdigest(self) -> str:
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
    ) -> None:
        self.robot = robot
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
        self._rows: list[tuple[float, ...]] = []
        self._sense(moved=True, listen=True)

    @property
    def pose(self) -> Pose:
        return Pose(self.drive.x, self.drive.y, self.drive.heading_degrees)

    def tick(self) -> None:
        """Advance a thirtieth of a second."""
        self.clock += 1
        drive = self.drive
        x, y, heading = drive.x, drive.y, drive.heading
        drive.tick(self.clock)
        moved = x != drive.x or y != drive.y or heading != drive.heading
        self._sense(moved, listen=self.clock % 3 == 0)
        degrees = drive.heading_degrees
        row = (
            drive.x,
            drive.y,
            degrees,
            drive.left.position,
            drive.right.position,
            *self.left_sums,
            *self.right_sums,
            self.ultrasonic,
            drive.gyro_angle,
        )
        self._rows.append(row)
        self._chain.add_row(_ROW.pack(self.clock * TICK, *row))

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

    @property
    def pixels(self) -> tuple[int, int]:
        """How many pixels the left and the right sums are over."""
        return self._lights[0].pixels, self._lights[1].pixels

    def ticks(self) -> Ticks:
        """All rows so far."""
        table = np.array(self._rows, dtype=np.float64).reshape(-1, 13)
        sums = table[:, 5:11].astype(np.int64)
        return Ticks(
            x=table[:, 0].copy(),
            y=table[:, 1].copy(),
            heading=table[:, 2].copy(),
            left_position=table[:, 3].copy(),
            right_position=table[:, 4].copy(),
            left_sums=sums[:, :3].copy(),
            right_sums=sums[:, 3:].copy(),
            ultrasonic=table[:, 11].copy(),
            gyro=table[:, 12].copy(),
            left_pixels=self._lights[0].pixels,
            right_pixels=self._lights[1].pixels,
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
                self.touches.append(Touch(self.clock / 30, what, self.pose))
        self._touching = touching
