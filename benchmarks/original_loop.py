"""The original simulator's stepping loop (``nbev3devsim`` 0.0.12), ported to plain Python line by line.

Drawing is left out. All calculations of a frame are included, even the text of each light sensor's pixels. Names are
local, and masks and offsets are computed once, to make the port as fast as plain Python allows.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field

WIDTH, HEIGHT, FPS = 2362, 1143, 30
_DIAMETER, _SPACING, _WEIGHT = 56, 180, 6
_MAX_SPEED_CHANGE = 5000 / _WEIGHT / FPS
_SIDE = 20
_RADIUS = _SIDE / 2
_RAYS = (0, 7, -7, 14, -14, 21, -21)
_REACH = 2550
#: The pixels of a sensor that count, row by row.
_MASK = [(row - _RADIUS) ** 2 + (column - _RADIUS) ** 2 < _RADIUS**2 for row in range(_SIDE) for column in range(_SIDE)]
_SEEN = sum(_MASK)
_OUTSIDE = ("245", "226", "225", "255")
_SENSORS = ((-20, 30), (20, 30))
#: Start, end, and direction in degrees.
_WALLS = (
    (0, 0, 0, HEIGHT, 90),
    (0, HEIGHT, WIDTH, HEIGHT, 0),
    (WIDTH, HEIGHT, WIDTH, 0, 90),
    (WIDTH, 0, 0, 0, 0),
)


def _round_half_up(value: float) -> int:
    """Return the value rounded as in JavaScript."""
    return math.floor(value + 0.5)


@dataclass(slots=True)
class Motor:
    """One of the two wheels."""

    position: float = 0.0
    speed: float = 0.0
    speed_sp: float = 0.0
    position_sp: float = 0.0
    command: str = ""
    position_target: float = 0.0

    def run(self, command: str, _clock: int) -> None:
        self.command = command
        if command == "run-to-rel-pos":
            self.position_target = self.position + self.position_sp

    def set_speed(self, noise: float) -> None:
        if self.speed < self.speed_sp:
            self.speed = min(self.speed + _MAX_SPEED_CHANGE, self.speed_sp)
        elif self.speed > self.speed_sp:
            self.speed = max(self.speed - _MAX_SPEED_CHANGE, self.speed_sp)
        noisy = self.speed + (random.uniform(-noise, noise) if noise > 0 else 0.0)
        if noisy >= 0:
            self.speed = min(_round_half_up(noisy), 1050)

    def distance(self) -> float:
        degrees = self.speed / FPS
        if self.command == "run-forever":
            self.position += degrees
        elif self.command == "run-to-rel-pos":
            if self.position_sp < 0:
                degrees = -degrees
            self.position += degrees
            if self.position > self.position_target if self.position_sp >= 0 else self.position < self.position_target:
                return 0.0
            self.position += degrees
        else:
            return 0.0
        return degrees * math.pi * _DIAMETER / 360


@dataclass(slots=True)
class OriginalSimulator:
    """A robot on a floor. ``pixels`` is RGBA, row by row from the top, as from a canvas."""

    pixels: bytes
    x: float
    y: float
    angle: float  # radians
    wheel_noise: float = 0.0
    sensor_noise: float = 0.0
    clock: int = 0
    left: Motor = field(default_factory=Motor)
    right: Motor = field(default_factory=Motor)
    gyro: list[float] = field(default_factory=lambda: [0.0, 0.0])
    ultrasonic: float = 0.0
    means: list[tuple[float, float, float]] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._read_light_sensors()

    @property
    def left_red(self) -> float:
        return self.means[0][0]

    def tick(self) -> None:
        """Simulate one frame."""
        self.clock += 1
        self.left.set_speed(self.wheel_noise)
        self.right.set_speed(self.wheel_noise)
        left, right = self.left.distance(), self.right.distance()
        distance = (left + right) / 2
        self.x += distance * math.cos(self.angle)
        self.y += distance * math.sin(self.angle)
        rotation = (right - left) / _SPACING
        self.angle += rotation
        if self.angle > 2 * math.pi:
            self.angle -= 2 * math.pi
        degrees = math.degrees(rotation)
        self.gyro[0] -= degrees
        self.gyro[1] = -degrees * FPS
        if self.clock % 3 == 0:
            self._read_sonar()
        self._read_light_sensors()

    def _read_light_sensors(self) -> None:
        cosine, sine = math.cos(self.angle - math.pi / 2), math.sin(self.angle - math.pi / 2)
        readings = []
        for across, ahead in _SENSORS:
            column = int(cosine * across - sine * ahead + self.x - _RADIUS)
            row = int(-(sine * across + cosine * ahead) + (HEIGHT - self.y) - _RADIUS)
            readings.append(self._read_light_sensor(column, row))
        self.means = [means for means, _ in readings]
        self.texts = [text for _, text in readings]

    def _read_light_sensor(self, column: int, row: int) -> tuple[tuple[float, float, float], str]:
        """Return the means, and the comma-separated values of all pixels, of one window of the canvas."""
        if 0 <= column <= WIDTH - _SIDE and 0 <= row <= HEIGHT - _SIDE:
            pixels, stride = self.pixels, 4 * WIDTH
            start = row * stride + 4 * column
            window = b"".join(pixels[start + stride * k : start + stride * k + 4 * _SIDE] for k in range(_SIDE))
        else:
            window = self._copy_partial_window(column, row)
        noise = self.sensor_noise
        red = green = blue = 0
        values: list[str] = []
        offset = 0
        for counts in _MASK:
            if counts:
                r, g, b = window[offset], window[offset + 1], window[offset + 2]
                if noise > 0:
                    r = min(255, max(0, _round_half_up(r + random.uniform(-noise, noise))))
                    g = min(255, max(0, _round_half_up(g + random.uniform(-noise, noise))))
                    b = min(255, max(0, _round_half_up(b + random.uniform(-noise, noise))))
                red += r
                green += g
                blue += b
                values += (str(r), str(g), str(b), "255")
            else:
                values += _OUTSIDE
            offset += 4
        return (red / _SEEN, green / _SEEN, blue / _SEEN), ",".join(values)

    def _copy_partial_window(self, column: int, row: int) -> bytes:
        window = bytearray(4 * _SIDE * _SIDE)
        for k in range(_SIDE * _SIDE):
            x, y = column + k % _SIDE, row + k // _SIDE
            if 0 <= x < WIDTH and 0 <= y < HEIGHT:
                start = 4 * (y * WIDTH + x)
                window[4 * k : 4 * k + 4] = self.pixels[start : start + 4]
        return bytes(window)

    def _read_sonar(self) -> None:
        heading = math.degrees(self.angle)
        x, y = self.x + 20 * math.cos(self.angle), self.y + 20 * math.sin(self.angle)
        nearest = float(_REACH)
        for ray in _RAYS:
            direction = math.radians(heading + ray)
            end_x, end_y = x + _REACH * math.cos(direction), y + _REACH * math.sin(direction)
            for wall in _WALLS:
                distance = _find_hit_distance(x, y, end_x, end_y, wall)
                if distance is not None and distance < nearest and _is_detectable(heading, wall[4]):
                    nearest = distance
        self.ultrasonic = min(_REACH, max(0, _round_half_up(nearest)))


def _is_detectable(heading: float, line: float) -> bool:
    incidence = abs(line - heading)
    if incidence > 180:
        incidence = 360 - incidence
    return 40 < incidence < 140


def _find_hit_distance(
    x: float, y: float, end_x: float, end_y: float, wall: tuple[float, float, float, float, float]
) -> float | None:
    """Return the distance of the wall along the ray, or None if the ray misses it."""
    x3, y3, x4, y4, _ = wall
    denominator = (x - end_x) * (y3 - y4) - (y - end_y) * (x3 - x4)
    if denominator == 0:
        return None
    ray, edge = x * end_y - y * end_x, x3 * y4 - y3 * x4
    at_x = (ray * (x3 - x4) - (x - end_x) * edge) / denominator
    at_y = (ray * (y3 - y4) - (y - end_y) * edge) / denominator
    for coordinate, start, end in ((at_x, x, end_x), (at_y, y, end_y), (at_x, x3, x4), (at_y, y3, y4)):
        if not min(start, end) - 0.01 <= coordinate <= max(start, end) + 0.01:
            return None
    return math.hypot(at_x - x, at_y - y)
