"""Tables for hints on common student mistakes: modules, the usage of the brick, and its readings.

Data only. The rules that use these tables are in the other ``hint_`` modules.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

from service.language import translatable

#: Modules that students know from elsewhere and that are not available.
UNAVAILABLE_MODULES = frozenset(
    {
        "cv2",
        "IPython",
        "keras",
        "matplotlib",
        "pip",
        "plotly",
        "pybricks",
        "requests",
        "seaborn",
        "skimage",
        "tensorflow",
        "torch",
        "tqdm",
    }
)

#: The correct form of calls to a pair of motors, by object and method.
USAGE: Mapping[str, str] = MappingProxyType(
    {
        "tank_drive.on": translatable("tank_drive.on(left speed, right speed)"),
        "tank_drive.on_for_seconds": translatable("tank_drive.on_for_seconds(left speed, right speed, seconds)"),
        "tank_drive.on_for_rotations": translatable("tank_drive.on_for_rotations(left speed, right speed, rotations)"),
        "tank_drive.on_for_degrees": translatable("tank_drive.on_for_degrees(left speed, right speed, degrees)"),
        "tank_turn.on": translatable("tank_turn.on(steering, speed)"),
        "tank_turn.on_for_seconds": translatable("tank_turn.on_for_seconds(steering, speed, seconds)"),
        "tank_turn.on_for_rotations": translatable("tank_turn.on_for_rotations(steering, speed, rotations)"),
        "tank_turn.on_for_degrees": translatable("tank_turn.on_for_degrees(steering, speed, degrees)"),
    }
)

#: Functions whose texts students see or hear.
OUTPUT_FUNCTIONS = frozenset({"say", "print", "speak"})

#: The sign of a comparison that is turned round.
OPPOSITE_SIGNS: Mapping[str, str] = MappingProxyType({"<": ">", "<=": ">=", ">": "<", ">=": "<="})

#: Properties of sensors and motors: minimum, maximum, and a sentence on the range or unit.
READINGS: Mapping[str, tuple[float, float, str]] = MappingProxyType(
    {
        "reflected_light_intensity": (0, 255, translatable("%(reading)s goes from 0 to 255")),
        "reflected_light_intensity_pc": (0, 100, translatable("%(reading)s is in percent, from 0 to 100")),
        "full_reflected_light_intensity": (0, 100, translatable("%(reading)s is in percent, from 0 to 100")),
        "distance_centimeters": (0, 255, translatable("%(reading)s is in centimetres")),
        "distance_inches": (0, 101, translatable("%(reading)s is in inches")),
        "color": (0, 7, translatable("%(reading)s is the number of a colour, from 0 to 7")),
        "red": (0, 255, translatable("%(reading)s goes from 0 to 255")),
        "green": (0, 255, translatable("%(reading)s goes from 0 to 255")),
        "blue": (0, 255, translatable("%(reading)s goes from 0 to 255")),
        "angle": (-1e9, 1e9, translatable("%(reading)s is in degrees, clockwise")),
        "position": (-1e9, 1e9, translatable("%(reading)s is in degrees")),
    }
)
#: Other names that are read without brackets.
PROPERTIES = frozenset(READINGS) | {
    "rate",
    "angle_and_rate",
    "rgb",
    "hsv",
    "hls",
    "lab",
    "raw",
    "color_name",
    "speed",
    "state",
    "is_running",
    "ambient_light_intensity",
    "distance_centimeters_continuous",
    "distance_inches_continuous",
}

#: Calls with a time or an amount as their last argument: largest plausible value, and its unit.
AMOUNTS: Mapping[str, tuple[float, Literal["seconds", "rotations"]]] = MappingProxyType(
    {
        "sleep": (100, "seconds"),
        "on_for_seconds": (100, "seconds"),
        "on_for_rotations": (30, "rotations"),
    }
)

#: Methods and functions that have an effect only when called.
ACTIONS = frozenset(
    {
        "on",
        "off",
        "stop",
        "on_for_seconds",
        "on_for_rotations",
        "on_for_degrees",
        "run_forever",
        "run_timed",
        "run_to_rel_pos",
        "speak",
        "beep",
        "say",
        "print",
        "append",
        "sleep",
    }
)
#: The actions that start a robot moving, and those that move it and wait.
CONTINUOUS_MOVES = frozenset({"on", "run_forever", "run_direct"})
LIMITED_MOVES = frozenset({"on_for_seconds", "on_for_rotations", "on_for_degrees"})
