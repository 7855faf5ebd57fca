"""The course's drive: two wheels with speed, command and encoder, advanced by one tick (1/30 s) at a time.

The equations are the original's, quirks included, because student programs are tuned to them. ``motion.py`` converts
wheel travel to a new position of the robot.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from sim.motion import Motion
from sim.random_streams import RandomStream
from sim.robot import MAX_SPEED, Robot
from sim.trigonometry import round_half_up

Command = Literal["", "run-forever", "run-timed", "run-to-rel-pos", "run-to-abs-pos", "run-direct", "reset"]
TWO_PI = 2 * math.pi


@dataclass(slots=True)
class Wheel:
    """One motor and its wheel: degrees and degrees per second; ``time_sp`` is in seconds."""

    position: float = 0.0
    speed: float = 0.0
    speed_sp: float = 0.0
    position_sp: float = 0.0
    time_sp: float = 0.0
    polarity: str = "normal"
    state: str = ""
    command: str = ""
    _time_target: float = 0.0
    _position_target: float = 0.0

    def run(self, command: str, clock: int) -> None:
        """Apply a command between two ticks; ``clock`` is the number of ticks that have passed."""
        self.command = command
        if command == "run-forever":
            self.state = "running"
        elif command == "run-timed":
            self._time_target = clock + self.time_sp * 30
            self.state = "running"
        elif command == "run-to-rel-pos":
            self._position_target = self.position + self.position_sp
            if self._position_target != self.position:
                self.state = "running"
        elif command == "run-to-abs-pos":
            self._position_target = self.position_sp
            if self._position_target != self.position:
                self.state = "running"

    def change_speed(self, max_change: float, noise: float, both_directions: bool = False) -> None:
        """Move the speed towards its set point. Without ``both_directions``, negative speeds get no rounding or noise.

        Unlike the original, this method limits negative speeds. Otherwise a program that bypasses the brick's checks
        could ask for more than the motor's maximum and win every race.
        """
        if self.speed < self.speed_sp:
            self.speed = min(self.speed + max_change, self.speed_sp)
        elif self.speed > self.speed_sp:
            self.speed = max(self.speed - max_change, self.speed_sp, -MAX_SPEED)
        noisy = self.speed + noise
        if noisy >= 0:
            self.speed = min(round_half_up(noisy), MAX_SPEED)
        elif both_directions:
            self.speed = -min(round_half_up(-noisy), MAX_SPEED)

    def travel(self, clock: int) -> float:
        """Return the wheel travel of this tick in degrees.

        As in the original, a move to a position counts twice on the encoder.
        """
        degrees = self.speed / 30
        sign = -1.0 if self.polarity == "inversed" else 1.0
        if self.command == "run-forever" or (self.command == "run-timed" and clock < self._time_target):
            self.position += degrees
            return sign * degrees
        if self.command in ("run-to-rel-pos", "run-to-abs-pos"):
            backwards = self.position_sp < 0
            if backwards:
                degrees = -degrees
            self.position += degrees
            is_past_target = (
                self.position < self._position_target if backwards else self.position > self._position_target
            )
            if is_past_target:
                self.state = ""
                return 0.0
            self.position += degrees
            return sign * degrees
        self.state = ""
        return 0.0


@dataclass(slots=True)
class Drive:
    """Pose and wheels. ``heading`` is in radians and wraps only at the upper end; ``turns`` counts the wraps."""

    robot: Robot
    motion: Motion
    x: float
    y: float
    heading: float
    noise: float = 0.0
    both_directions: bool = False  # noise also for negative speeds
    left_chance: RandomStream | None = None
    right_chance: RandomStream | None = None
    turns: int = 0
    gyro_angle: float = 0.0  # degrees, clockwise
    gyro_rate: float = 0.0
    left: Wheel = field(default_factory=Wheel)
    right: Wheel = field(default_factory=Wheel)

    @property
    def heading_degrees(self) -> float:
        """The heading in degrees, not wrapped."""
        return math.degrees(self.heading) + 360.0 * self.turns

    def tick(self, clock: int) -> None:
        """Advance by one tick: update the speeds, the wheel travel and the pose, in this order."""
        max_change = self.robot.acceleration
        both_directions = self.both_directions and self.noise > 0
        self.left.change_speed(max_change, self._draw_noise(self.left_chance, clock), both_directions)
        self.right.change_speed(max_change, self._draw_noise(self.right_chance, clock), both_directions)
        mm_per_degree = math.pi * self.robot.wheel_diameter / 360
        left = self.left.travel(clock) * mm_per_degree
        right = self.right.travel(clock) * mm_per_degree
        previous_position = self.x, self.y
        self.x, self.y, rotation = self.motion.compute_move(self.x, self.y, self.heading, left, right)
        if rotation == 0.0 and (self.x, self.y) == previous_position:
            self.gyro_rate = 0.0
            return
        self.heading += rotation
        if self.heading > TWO_PI:
            self.heading -= TWO_PI
            self.turns += 1
        degrees = math.degrees(rotation)
        self.gyro_angle -= degrees
        self.gyro_rate = -degrees * 30

    def _draw_noise(self, chance: RandomStream | None, clock: int) -> float:
        if self.noise <= 0 or chance is None:
            return 0.0
        return chance.between(-self.noise, self.noise, clock)
