"""Light sensors: position on the floor, noise, and the images they return.

``camera.py`` renders the floor. The brick computes colours, percentages and names from the means.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.camera import HEIGHT, LightCamera, build_sensor_mask
from sim.random_streams import RandomStream
from sim.robot import LightSensor

#: Pixel value outside the round window in the original.
_OUTSIDE = (245, 226, 225)


@dataclass(frozen=True, slots=True)
class Footprint:
    """Position of a sensor: the window's upper left pixel, and the sensor's centre in world mm."""

    column: int
    row: int
    x: float
    y: float


def compute_footprint(sensor: LightSensor, x: float, y: float, sine: float, cosine: float) -> Footprint:
    """Return the position of ``sensor`` on a robot at (x, y); sine and cosine are of the heading minus a right angle.

    The operations have the original's order (robolab section 4), because the result is truncated.
    """
    column = cosine * sensor.x - sine * sensor.y + x
    row = -(sine * sensor.x + cosine * sensor.y) + (HEIGHT - y)
    radius = sensor.diameter / 2
    return Footprint(int(column - radius), int(row - radius), column, HEIGHT - row)


class LightReader:
    """One light sensor over one floor, with new noise per pixel in each tick."""

    def __init__(self, sensor: LightSensor, camera: LightCamera, noise: float, chance: RandomStream) -> None:
        self.sensor = sensor
        self._camera = camera
        self._noise = noise
        self._chance = chance
        self._mask = build_sensor_mask(sensor.diameter)
        self.pixels = int(self._mask.sum())

    def measure_sums(self, footprint: Footprint, tick: int) -> tuple[int, int, int]:
        """Return the sums of R, G and B over the sensor's pixels, including noise."""
        if self._noise <= 0:
            return self._camera.measure_sums(footprint.column, footprint.row, self.sensor.diameter)
        red, green, blue = self._add_noise(footprint, tick).sum(axis=0, dtype=np.int64).tolist()
        return red, green, blue

    def render_image(self, footprint: Footprint, tick: int) -> bytes:
        """Return RGBA bytes, row-major, top row first. Outside the round window, pixels have the original's colour."""
        side = self.sensor.diameter
        rgba = np.empty((side, side, 4), np.uint8)
        rgba[:, :, :3] = _OUTSIDE
        rgba[:, :, 3] = 255
        if self._noise <= 0:
            colours = self._camera.render_window(footprint.column, footprint.row, side)[self._mask]
        else:
            colours = self._add_noise(footprint, tick)
        rgba[self._mask, :3] = colours
        return rgba.tobytes()

    def _add_noise(self, footprint: Footprint, tick: int) -> NDArray[np.uint8]:
        """Return the visible pixels with uniform noise, rounded half up and clamped, shape (pixels, 3)."""
        colours = self._camera.render_window(footprint.column, footprint.row, self.sensor.diameter)[self._mask]
        offsets = self._chance.uniforms(tick, self.pixels * 3).reshape(-1, 3) * (2 * self._noise) - self._noise
        return np.clip(np.floor(colours + offsets + 0.5), 0, 255).astype(np.uint8)
