"""World of one trial: drive, sensors and touches, advanced and recorded tick by tick.

Each trial gets a new world, built from shared parts without state (arena, camera). Programs and messages are handled
elsewhere; time advances only in ``tick``.
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
from sim.drive import Drive
from sim.light_sensors import Footprint, LightReader, compute_footprint
from sim.motion import COURSE_PHYSICS, Physics
from sim.random_streams import RandomStream
from sim.recording import COLUMNS, SECOND, SENSORS, TICK, Pose, Ticks, Touch
from sim.robot import Robot
from sim.trigonometry import sincos

#: A row: the time and all columns, those of the chain first.
_ROW = struct.Struct("<q" + "".join(f"{each.width}{'q' if each.whole else 'd'}" for each in COLUMNS))
_TABLE = np.dtype(
    [("time", "<i8"), *((each.name, each.dtype, (each.width,) if each.width > 1 else ()) for each in COLUMNS)]
)
_CHAINED = 8 + 8 * sum(each.width for each in COLUMNS if each.in_chain)  # bytes
_sources = ", ".join(f"*world.{each.source}" if each.width > 1 else f"world.{each.source}" for each in COLUMNS)
# Compiled to one expression, because it runs at every tick; a loop over the table would take 5 % of the tick.
_collect_row: Callable[[World], tuple[float, ...]] = eval(f"lambda world: ({_sources},)")
_collect_readings = attrgetter(*SENSORS.values())
_RIGHT_ANGLE = math.pi / 2


@dataclass(frozen=True, slots=True)
class Noise:
    """Noise amplitudes: grey levels per pixel of a light sensor, degrees per second per wheel.

    In the original, wheels at negative speeds have no noise. With ``both_directions`` they have noise too.
    """

    light: float = 0.0
    motor: float = 0.0
    both_directions: bool = False


class HashChain:
    """SHA-256 over all events in order."""

    def __init__(self) -> None:
        self._digest = hashlib.sha256()
        #: Adds raw bytes. Called for the row of each tick and for each reading.
        self.add_bytes = self._digest.update

    def add(self, kind: str, time: int, data: bytes) -> None:
        """Add an event other than a tick: its kind, its time (thirds of a microsecond) and its bytes."""
        self.add_bytes(f"{kind}:{time}:{len(data)}:".encode() + data)

    @staticmethod
    def encode_without_time(kind: str, numbers: str) -> bytes:
        """Return the bytes that ``add`` adds for these numbers, with ``%d`` for the time. Used for frequent events."""
        return f"{kind}:%d:{len(numbers)}:{numbers}".encode()

    def hexdigest(self) -> str:
        """Return the hash of all data added so far, 64 hexadecimal digits."""
        return self._digest.hexdigest()


class World:
    """A robot on a floor. ``clock`` counts ticks; values that programs can read change only at ticks."""

    def __init__(
        self,
        robot: Robot,
        arena: Arena,
        camera: LightCamera,
        pose: Pose,
        noise: Noise,
        seed: int,
        chain: HashChain,
        physics: Physics = COURSE_PHYSICS,
        tick: int = TICK,
        *,
        motor_seed: int | None = None,
    ) -> None:
        """Create the world. ``tick`` is its length in units of simulated time; the equations assume 1/30 s.

        ``seed`` is that of the noise; the wheels' noise has ``motor_seed`` instead, if given.
        """
        motor_seed = seed if motor_seed is None else motor_seed
        self.robot = robot
        self._tick = tick
        self.clock = 0
        self.drive = Drive(
            robot,
            arena.place_motion(robot, physics, pose.x, pose.y, math.radians(pose.heading)),
            pose.x,
            pose.y,
            math.radians(pose.heading),
            noise.motor,
            noise.both_directions,
            RandomStream(motor_seed, "left wheel"),
            RandomStream(motor_seed, "right wheel"),
        )
        self._arena = arena
        self.obstacles = arena.obstacles
        self._chain = chain
        self._lights = (
            LightReader(robot.left_light, camera, noise.light, RandomStream(seed, "left light")),
            LightReader(robot.right_light, camera, noise.light, RandomStream(seed, "right light")),
        )
        self._noisy = noise.light > 0
        self._footprints: tuple[Footprint, Footprint]
        self.left_sums = self.right_sums = (0, 0, 0)
        self.ultrasonic = 0.0
        self.touches: list[Touch] = []
        # Contacts at the start pose do not count as touches: several of the course's poses overlap a wall.
        self._touching = arena.find_contacts(robot, pose.x, pose.y, self.drive.heading)
        self._rows: list[bytes] = []
        self._read_sensors(has_moved=True, is_listening=True)

    @property
    def pose(self) -> Pose:
        """The robot's pose: the middle of its axle in mm, and its heading in degrees."""
        return Pose(self.drive.x, self.drive.y, self.drive.heading_degrees)

    def tick(self) -> None:
        """Advance by one tick."""
        self.sense(self.move())

    def move(self) -> bool:
        """Run the first half of a tick: turn the wheels. Return whether the robot moved or turned."""
        self.clock += 1
        drive = self.drive
        x, y, heading = drive.x, drive.y, drive.heading
        drive.tick(self.clock)
        return x != drive.x or y != drive.y or heading != drive.heading

    def sense(self, has_moved: bool) -> None:
        """Run the second half of a tick, after all robots have moved: read the sensors and write the row."""
        self._read_sensors(has_moved, is_listening=self.clock % 3 == 0)
        row = _ROW.pack(self.clock * self._tick, *_collect_row(self))
        self._rows.append(row)
        self._chain.add_bytes(row[:_CHAINED])

    def collect_readings(self) -> dict[str, Any]:
        """Return the readings of every sensor after the last tick."""
        return dict(zip(SENSORS, _collect_readings(self), strict=True))

    @property
    def left_means(self) -> list[float]:
        """Mean R, G, B of the left light sensor."""
        return _compute_means(self.left_sums, self._lights[0].pixels)

    @property
    def right_means(self) -> list[float]:
        """Mean R, G, B of the right light sensor."""
        return _compute_means(self.right_sums, self._lights[1].pixels)

    @property
    def gyro_angle_and_rate(self) -> list[float]:
        """The gyro's angle in degrees and its rate in degrees per second, both clockwise."""
        return [self.drive.gyro_angle, self.drive.gyro_rate]

    def render_images(self) -> tuple[bytes, bytes]:
        """Return the RGBA bytes of the left and the right light sensor after the last tick."""
        left, right = (
            reader.render_image(where, self.clock) for reader, where in zip(self._lights, self._footprints, strict=True)
        )
        return left, right

    @property
    def left_footprint(self) -> Footprint:
        """The position of the left light sensor."""
        return self._footprints[0]

    def ticks(self) -> Ticks:
        """Return all rows so far."""
        table = np.frombuffer(b"".join(self._rows), _TABLE)
        return Ticks(
            **{each.name: table[each.name].astype(each.dtype) for each in COLUMNS},
            left_pixels=self._lights[0].pixels,
            right_pixels=self._lights[1].pixels,
            length=self._tick,
        )

    def _read_sensors(self, has_moved: bool, is_listening: bool) -> None:
        drive = self.drive
        if has_moved:
            sine, cosine = sincos(drive.heading - _RIGHT_ANGLE)
            left, right = self.robot.left_light, self.robot.right_light
            self._footprints = (
                compute_footprint(left, drive.x, drive.y, sine, cosine),
                compute_footprint(right, drive.x, drive.y, sine, cosine),
            )
            self._record_touches()
        if has_moved or self._noisy:
            self.left_sums = self._lights[0].measure_sums(self._footprints[0], self.clock)
            self.right_sums = self._lights[1].measure_sums(self._footprints[1], self.clock)
        if is_listening:
            self.ultrasonic = self._arena.measure_distance(drive.x, drive.y, drive.heading, self.robot.ultrasonic_y)

    def _record_touches(self) -> None:
        touched_names = self._arena.find_contacts(self.robot, self.drive.x, self.drive.y, self.drive.heading)
        for name in touched_names:
            if name not in self._touching:
                self.touches.append(Touch(self.clock * self._tick / SECOND, name, self.pose))
        self._touching = touched_names


def _compute_means(sums: tuple[int, int, int], pixels: int) -> list[float]:
    red, green, blue = sums
    return [red / pixels, green / pixels, blue / pixels]
