"""Sensors of the simulator. A reading takes 10 ms (colour, angle, rate 20 ms); values change thirty times a second."""

from __future__ import annotations

import math
from typing import Any

from brick_link import link
from ev3dev2.sensor import colour


def _round(value: float) -> int:
    """Round like JavaScript: halves go up."""
    return math.floor(value + 0.5)


class Sensor:
    """Base class of all sensors. Checks that the port has the right sensor."""

    _ports: tuple[str, ...] = ()
    _kind = ""

    def __init__(self, address: str | None = None) -> None:
        if address not in self._ports:
            raise TypeError(f"No {self._kind} sensor connected to {'null' if address is None else address}")
        self.address = address

    def _read(self, what: str, times: int = 1) -> Any:
        """Return a value after ``times`` reading times of 10 ms."""
        return link.read(what, times)


class ColorSensor(Sensor):
    COLOR_NOCOLOR = 0
    COLOR_BLACK = 1
    COLOR_BLUE = 2
    COLOR_GREEN = 3
    COLOR_YELLOW = 4
    COLOR_RED = 5
    COLOR_WHITE = 6
    COLOR_BROWN = 7
    COLORS = ("NoColor", "Black", "Blue", "Green", "Yellow", "Red", "White", "Brown")
    MODE_COL_REFLECT = "COL-REFLECT"
    MODE_COL_AMBIENT = "COL-AMBIENT"
    MODE_COL_COLOR = "COL-COLOR"
    MODE_REF_RAW = "REF-RAW"
    MODE_RGB_RAW = "RGB-RAW"

    _ports = ("in2", "in3")
    _kind = "color"

    def _means(self, times: int = 1) -> list[float]:
        means: list[float] = link.read("left" if self.address == "in2" else "right", times)
        return means

    @property
    def reflected_light_intensity(self) -> int:
        """Mean red, 0..255."""
        return int(self._means()[0])

    @property
    def reflected_light_intensity_pc(self) -> float:
        """Mean red as a percentage."""
        return 100 * int(self._means()[0]) / 255

    @property
    def full_reflected_light_intensity(self) -> float:
        """Mean of red, green and blue as a percentage."""
        return 100 * sum(int(value) for value in self._means()) / 765

    @property
    def ambient_light_intensity(self) -> int:
        """Always zero: the simulator has no ambient light."""
        return 0

    @property
    def color(self) -> int:
        """One of the COLOR_ numbers."""
        return colour.find_colour_number(*self._means(times=2))

    @property
    def color_name(self) -> str:
        return self.COLORS[self.color]

    @property
    def raw(self) -> list[float]:
        """Mean red, green and blue, not truncated."""
        return self._means()

    @property
    def rgb(self) -> list[int]:
        return [int(value) for value in self._means()]

    @property
    def red(self) -> int:
        return self.rgb[0]

    @property
    def green(self) -> int:
        return self.rgb[1]

    @property
    def blue(self) -> int:
        return self.rgb[2]

    @property
    def hsv(self) -> list[int]:
        """Hue 0..359, saturation and value 0..100."""
        return colour.to_hsv(*self._means())

    @property
    def hls(self) -> list[int]:
        """Hue 0..359, lightness and saturation 0..100."""
        return colour.to_hls(*self._means())

    @property
    def lab(self) -> list[int]:
        return colour.to_lab(*self._means())

    def calibrate_white(self) -> None:
        """Do nothing: white paper already reads 255."""


class GyroSensor(Sensor):
    MODE_GYRO_ANG = "GYRO-ANG"
    MODE_GYRO_RATE = "GYRO-RATE"
    MODE_GYRO_FAS = "GYRO-FAS"
    MODE_GYRO_G_A = "GYRO-G&A"
    MODE_GYRO_CAL = "GYRO-CAL"

    _ports = ("in4",)
    _kind = "gyro"

    @property
    def angle(self) -> int:
        """Degrees turned since the start of the program, clockwise."""
        return _round(self._read("gyro", times=2)[0])

    @property
    def rate(self) -> int:
        """Degrees per second, clockwise."""
        return _round(self._read("gyro", times=2)[1])

    @property
    def angle_and_rate(self) -> list[int]:
        return [_round(value) for value in self._read("gyro")]

    def wait_until_angle_changed_by(self, delta: float, direction_sensitive: bool = False) -> None:
        """Wait until the angle has changed by ``delta`` degrees, in either direction by default."""
        start = self.angle
        while True:
            change = self.angle - start
            if not direction_sensitive:
                if abs(change) >= abs(delta):
                    return
            elif (delta >= 0 and change >= delta) or (delta < 0 and change <= delta):
                return


class UltrasonicSensor(Sensor):
    MODE_US_DIST_CM = "US-DIST-CM"
    MODE_US_DIST_IN = "US-DIST-IN"
    MODE_US_LISTEN = "US-LISTEN"
    MODE_US_SI_CM = "US-SI-CM"
    MODE_US_SI_IN = "US-SI-IN"

    _ports = ("in1",)
    _kind = "ultrasonic"

    @property
    def distance_centimeters(self) -> float:
        """Distance to the object in front, 0..255 cm; 255 if there is none."""
        return int(self._read("ultrasonic")) / 10.0

    @property
    def distance_centimeters_continuous(self) -> float:
        return self.distance_centimeters

    @property
    def distance_centimeters_ping(self) -> float:
        return self.distance_centimeters

    @property
    def distance_inches(self) -> float:
        return self.distance_centimeters / 2.54

    @property
    def distance_inches_continuous(self) -> float:
        return self.distance_inches

    @property
    def distance_inches_ping(self) -> float:
        return self.distance_inches

    @property
    def other_sensor_present(self) -> bool:
        return False
