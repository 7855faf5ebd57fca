"""What the robot's light sensors make of the floor: where they look, their noise, and the pixels they hand out.

Seeing the floor is ``camera.py``'s; colours, percentages and names are computed by the brick from these means.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.camera import HEIGHT, LightCamera, sensor_mask
from sim.chance import Stream
from sim.robot import LightSensor

#: What the original shows outside the round window.
_OUTSIDE = (245, 226, 225)


@dataclass(frozen=True, slots=True)
class Footprint:
    """Where a sensor is at one moment: the window's upper left pixel and the sensor's middle in world mm."""

    column: int
    row: int
    x: float
    y: float


def footprint(sensor: LightSensor, x: float, y: float, sine: float, cosine: float) -> Footprint:
    """Where ``sensor`` looks from a robot at (x, y); sine and cosine are of the heading less a right angle.

    The order of the operations is the original's (robolab section 4), because the result is truncated.
    """
    column = cosine * sensor.x - sine * sensor.y + x
    row = -(sine * sensor.x + cosine * sensor.y) + (HEIGHT - y)
    radius = sensor.diameter / 2
    return Footprint(int(column - radius), int(row - radius), column, HEIGHT - row)


class LightReader:
    """One light sensor over one floor, with per-pixel noise drawn afresh each tick."""

    def __init__(self, sensor: LightSensor, camera: LightCamera, noise: float, chance: Stream) -> None:
        self.sensor = sensor
        self._camera = camera
        self._noise = noise
        self._chance = chance
        self._mask = sensor_mask(sensor.diameter)
        self.pixels = int(self._mask.sum())

    def sums(self, where: Footprint, tick: int) -> tuple[int, int, int]:
        """R, G, B summed over the sensor's pixels, noise included."""
        if self._noise <= 0:
            return self._camera.sums(where.column, where.row, self.sensor.diameter)
        red, green, blue = self._noisy(where, tick).sum(axis=0, dtype=np.int64).tolist()
        return red, green, blue

    def image(self, where: Footprint, tick: int) -> bytes:
        """RGBA bytes, row-major, top row first; pixels outside the round window have the original's fixed colour."""
        side = self.sensor.diameter
        rgba = np.empty((side, side, 4), np.uint8)
        rgba[:, :, :3] = _OUTSIDE
        rgba[:, :, 3] = 255
        if self._noise <= 0:
            seen = self._camera.window(where.column, where.row, side)[self._mask]
        else:
            seen = self._noisy(where, tick)
        rgba[self._mask, :3] = seen
        return rgba.tobytes()

    def _noisy(self, where: Footprint, tick: int) -> NDArray[np.uint8]:
        """The seen pixels with uniform noise, rounded half up and clamped, shape (pixels, 3)."""
        seen = self._camera.window(where.column, where.row, self.sensor.diameter)[self._mask]
        offsets = self._chance.uniforms(tick, self.pixels * 3).reshape(-1, 3) * (2 * self._noise) - self._noise
        return np.clip(np.floor(seen + offsets + 0.5), 0, 255).astype(np.uint8)
