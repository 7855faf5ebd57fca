"""Flags of the notebook magics, and the simulator settings that result from them.

Order, limits and side effects follow the original (robolab sections 1.2 and 8). ``notes`` explains flags whose effect
may be unexpected.
"""

from __future__ import annotations

import math
import shlex
from dataclasses import dataclass, field, replace

from sim.errors import UsageError
from sim.floors import OBSTACLE_PRESETS, get_floor_start, list_floor_names
from sim.recording import Pose
from sim.robot import WIDENED, get_default_robot_name
from submissions.source_text import PREAMBLES, Preamble, find_magic_line
from submissions.suggestions import suggest_name

_MAX_X, _MAX_Y, _MAX_ANGLE = 2362, 1143, 360
_MAX_LIGHT_NOISE, _MAX_MOTOR_NOISE = 128, 500
#: The longest line of flags, in characters. Splitting it takes time.
_MAX_ARGUMENTS_LENGTH = 2000
_PEN_COLOURS = ("red", "orange", "green")

#: Pose of the robot in a new simulator, and after a robot is chosen.
_FRESH_POSE = Pose(200, 800, 0)
_AFTER_ROBOT = Pose(200, 943, 0)

_VALUED = {
    "b": "background",
    "r": "robotSetup",
    "o": "obstacles",
    "x": "xpos",
    "y": "ypos",
    "a": "angle",
    "P": "pencolor",
    "N": "sensornoise",
    "M": "motornoise",
    "s": "sim",
}
_SWITCHES = {
    "h": "help",
    "u": "ultrasound",
    "p": "pendown",
    "C": "clear",
    "q": "quiet",
    "c": "chart",
    "O": "output",
    "A": "array",
    "z": "noisecontrols",
    "Z": "settings",
    "X": "positioning",
    "D": "code",
    "i": "instrumentation",
    "W": "world",
    "H": "hide",
    "R": "autorun",
    "v": "preview",
    "L": "collab",
    "S": "stop",
    "m": "move",
    "F": "refresh",
}
#: Flags that only ``%sim_magic`` has, and the flag it lacks.
_PLAIN_ONLY = frozenset({"S", "m", "F"})
_PREVIEW_CODE = "previewcode"
_LONG = {long: short for short, long in (_VALUED | _SWITCHES).items()}


@dataclass(frozen=True, slots=True)
class Flags:
    """Flags of a magic line: values by flag, and the switches that are on."""

    preamble: Preamble = "preloaded"
    values: dict[str, str] = field(default_factory=dict)
    switches: frozenset[str] = frozenset()

    def with_values(self, **values: str | None) -> Flags:
        """Return these flags with some values replaced; None leaves a value unchanged."""
        changes = {key: value for key, value in values.items() if value is not None}
        return replace(self, values=self.values | changes)

    def remove_value(self, flag: str) -> Flags:
        """Return these flags without one value."""
        return replace(self, values={key: value for key, value in self.values.items() if key != flag})


@dataclass(frozen=True, slots=True)
class SimulatorSettings:
    """Simulator settings after applying the flags of a magic line."""

    background: str
    robot: str
    obstacles: tuple[tuple[float, float, float, float], ...]
    pose: Pose
    light_noise: float
    motor_noise: float
    pen_down: bool
    collaborative: bool
    notes: tuple[str, ...]


def split_program(text: str) -> tuple[Flags, str]:
    """Return the flags of a program's magic line and ``comment_out_magic``; the preloaded preamble if it has none.

    Raises:
        UsageError: A magic or a flag does not exist.
    """
    magic_line = find_magic_line(text)
    if magic_line is None:
        return Flags(), text
    return parse_magic(text.split("\n")[magic_line].lstrip("\ufeff").strip(), magic_line + 1), _comment_out_lines(
        magic_line, text
    )


def comment_out_magic(text: str) -> str:
    """Return the program with its magic line as an empty comment, so that line numbers stay the same."""
    magic_line = find_magic_line(text)
    return text if magic_line is None else _comment_out_lines(magic_line, text)


def _comment_out_lines(magic_line: int, text: str) -> str:
    lines = text.split("\n")
    lines[: magic_line + 1] = [
        "#" if line.lstrip("\ufeff \t").startswith("%") else line for line in lines[: magic_line + 1]
    ]
    return "\n".join(lines)


def parse_magic(line: str, number: int = 1) -> Flags:
    """Return the flags of a ``%%sim_magic...`` line.

    Raises:
        UsageError: A magic or a flag does not exist. The message has the line ``number``.
    """
    name, *arguments = line.lstrip("%").split(maxsplit=1) or [""]
    if name.startswith("%") and (intended_name := name.lstrip("%")[:40]):
        raise UsageError(f"line {number}: there is a blank between the percent signs; expected %%{intended_name}")
    try:
        return parse_flags(name, "".join(arguments))
    except UsageError as error:
        raise UsageError(f"line {number}: {error}") from None


def parse_flags(name: str, arguments: str) -> Flags:
    """Return the flags of the magic ``name``.

    Raises:
        UsageError: The magic or a flag does not exist.
    """
    if name not in PREAMBLES:
        expected = ", ".join(f"%%{known}" for known in PREAMBLES)
        hint = suggest_name(f"%%{name[:40]}", (f"%%{known}" for known in PREAMBLES))
        raise UsageError(f"%{name[:40]} is not a magic that starts a program; expected one of {expected}{hint}")
    flags = _parse_words(_split_arguments(name, arguments), PREAMBLES[name])
    foreign_flags = sorted(flags.switches & _PLAIN_ONLY)
    if name != "sim_magic" and foreign_flags:
        raise UsageError(f"%%{name} has no flag -{foreign_flags[0]}; only %sim_magic has it")
    return flags


def _split_arguments(name: str, arguments: str) -> list[str]:
    if len(arguments) > _MAX_ARGUMENTS_LENGTH:
        raise UsageError(f"the flags of %%{name} are longer than {_MAX_ARGUMENTS_LENGTH} characters")
    try:
        return shlex.split(arguments, comments=False)
    except ValueError as error:
        raise UsageError(f"the flags of %%{name} cannot be read: {str(error).lower()}") from None


def _parse_words(words: list[str], preamble: Preamble) -> Flags:
    values: dict[str, str] = {}
    switches: set[str] = set()
    remaining_words = list(words)
    while remaining_words:
        word = remaining_words.pop(0)
        if word.startswith("--"):
            long_name, separator, value = word[2:].partition("=")
            if long_name == _PREVIEW_CODE and preamble != "none":
                continue
            letter = _find_short_flag(long_name)
            if letter in _VALUED:
                values[letter] = value if separator else _take_value(remaining_words, word)
            else:
                switches.add(letter)
        elif word.startswith("-") and len(word) > 1:
            _parse_short_flags(word[1:], remaining_words, values, switches)
        else:
            raise UsageError(f"{word[:40]!r} is not a flag")
    return Flags(preamble, values, frozenset(switches))


def _find_short_flag(long_name: str) -> str:
    """Return the letter of a long flag. Like the course's magics, accept any unambiguous prefix."""
    long_names = (
        [long_name] if long_name in _LONG else [name for name in _LONG if long_name and name.startswith(long_name)]
    )
    if len(long_names) == 1:
        return _LONG[long_names[0]]
    if long_names:
        raise UsageError(f"--{long_name[:40]} may be {' or '.join(f'--{name}' for name in long_names)}")
    hint = suggest_name(f"--{long_name[:40]}", (f"--{name}" for name in _LONG))
    raise UsageError(f"there is no flag --{long_name[:40]}" + (hint or "; --help of the course's magic lists them"))


def _parse_short_flags(letters: str, remaining_words: list[str], values: dict[str, str], switches: set[str]) -> None:
    """Parse combined short flags (-HWZ). A flag with a value takes the rest of the word, or the next word."""
    for index, letter in enumerate(letters):
        if letter in _SWITCHES:
            switches.add(letter)
        elif letter in _VALUED:
            value = letters[index + 1 :].removeprefix("=")
            values[letter] = value if value else _take_value(remaining_words, f"-{letter}")
            return
        else:
            other_case = letter.swapcase()
            hint = f"; did you mean -{other_case}?" if other_case in _SWITCHES or other_case in _VALUED else ""
            raise UsageError(f"there is no flag -{letter}{hint}")


def _take_value(remaining_words: list[str], flag: str) -> str:
    if not remaining_words:
        raise UsageError(f"{flag} needs a value")
    return remaining_words.pop(0)


def apply_flags(flags: Flags) -> SimulatorSettings:
    """Return the settings of a new simulator with these flags.

    Raises:
        UsageError: A value is not a number.
    """
    return SimulatorPage().apply(flags)


class SimulatorPage:
    """Model of the original's page: sliders with limits, and moves that read all three sliders.

    Settings persist until another flag changes them; switches apply to one magic. No program runs here.
    """

    def __init__(self) -> None:
        self.background = "Empty_Map"
        self.robot = self._chosen_robot = "Default_Robot"
        self.obstacles: tuple[tuple[float, float, float, float], ...] = ()
        self.pose = _FRESH_POSE
        self._angle_slider = 0
        self._noise = {"N": 0.0, "M": 0.0}
        self._noise_is_heard = True
        self._notes: list[str] = []

    def apply(self, flags: Flags) -> SimulatorSettings:
        """Apply the flags and return the resulting settings.

        Raises:
            UsageError: A value is not a number.
        """
        self._notes = []
        values = flags.values
        sliders = {flag: self._parse_slider(flag, values, most) for flag, most in _SLIDERS.items()}
        if "r" in values:
            self._choose_robot(values["r"])
        if "b" in values:
            self._choose_background(values["b"])
        if "o" in values:
            self._choose_obstacles(values["o"])
        x, y, angle = sliders["x"], sliders["y"], sliders["a"]
        if "m" in flags.switches or x is not None or y is not None or angle is not None:
            self._move(x, y, angle)
        self._choose_noise(sliders["N"], sliders["M"])
        if "P" in values and values["P"] not in _PEN_COLOURS:
            self._add_note(f"-P {values['P'][:40]} is not a pen colour; expected one of {', '.join(_PEN_COLOURS)}")
        return SimulatorSettings(
            self.background,
            self.robot,
            self.obstacles,
            self.pose,
            self._noise["N"],
            self._noise["M"],
            "p" in flags.switches,
            "L" in flags.switches,
            tuple(self._notes),
        )

    def set_pose(self, pose: Pose) -> None:
        """Set the robot's pose after a run."""
        self.pose = pose

    def _choose_robot(self, name: str) -> None:
        if name not in WIDENED:
            hint = suggest_name(name[:40], WIDENED)
            self._add_note(f"-r {name[:40]} is not a robot; Default_Robot is used, as in the simulator{hint}")
            name = "Default_Robot"
        self.robot = self._chosen_robot = name
        self.pose = _AFTER_ROBOT
        self._noise = {"N": 0.0, "M": 0.0}
        self._noise_is_heard = True

    def _choose_background(self, name: str) -> None:
        if name not in list_floor_names():
            hint = suggest_name(name[:40], list_floor_names())
            self._add_note(f"-b {name[:40]} is not a background; Empty_Map is used, as in the simulator{hint}")
            name = "Empty_Map"
        self.background = name
        self.pose, self.obstacles = get_floor_start(name)
        if 0 <= self.pose.heading <= _MAX_ANGLE:
            self._angle_slider = round(self.pose.heading)
        # The original keeps this change of the robot for the rest of the session; here it ends with the background.
        self.robot = self._chosen_robot
        if get_default_robot_name(name) == WIDENED["Default_Robot"]:
            self._add_note("-b Radial_grey also sets the light sensors 60 mm to either side, as in the simulator")
            self.robot = WIDENED[self._chosen_robot]
            self._noise = {"N": 0.0, "M": 0.0}
            self._noise_is_heard = False

    def _choose_obstacles(self, name: str) -> None:
        if name in OBSTACLE_PRESETS and name != "None":
            self.obstacles = OBSTACLE_PRESETS[name]
        elif name != "None":
            hint = suggest_name(name[:40], OBSTACLE_PRESETS)
            self._add_note(
                f"-o {name[:40]} is not a set of obstacles; they stay as they are, as in the simulator{hint}"
            )
        elif self.obstacles:
            self._add_note(
                "-o None leaves the obstacles as they are, as in the simulator; choosing a background clears them"
            )

    def _choose_noise(self, light: int | None, motor: int | None) -> None:
        if (light or motor) and not self._noise_is_heard:
            self._add_note(
                "-N and -M do nothing after -b Radial_grey until a robot is chosen (-r), as in the simulator"
            )
        if light is not None:
            self._noise["N"] = light if self._noise_is_heard else 0.0
            old_pose = self.pose
            self._move(None, None, None)
            if old_pose.heading != self.pose.heading:
                self._add_note(f"-N also turns the robot to {self.pose.heading:g} degrees, as in the simulator")
        if motor is not None:
            self._noise["M"] = motor if self._noise_is_heard else 0.0

    def _parse_slider(self, flag: str, values: dict[str, str], maximum: int) -> int | None:
        """Return a whole number, clamped to the slider's range."""
        if flag not in values:
            return None
        try:
            number = int(values[flag])
        except ValueError:
            raise UsageError(f"-{flag} {values[flag][:40]}: expected a whole number between 0 and {maximum}") from None
        value = min(max(number, 0), maximum)
        if value != number:
            self._add_note(
                f"-{flag} {values[flag][:40]} becomes {value}: the simulator's slider goes from 0 to {maximum}"
            )
        return value

    def _move(self, x: int | None, y: int | None, angle: int | None) -> None:
        """Move the robot to the values of all three sliders.

        The x and y sliders follow the robot; the angle slider does not.
        """
        if angle is not None:
            self._angle_slider = angle
        x = _to_slider_value(self.pose.x, _MAX_X) if x is None else x
        y = _to_slider_value(self.pose.y, _MAX_Y) if y is None else y
        if angle is None and self.pose.heading != self._angle_slider:
            self._add_note(f"setting the position turns the robot to {self._angle_slider} degrees; add -a to choose")
        self.pose = Pose(x, y, self._angle_slider)

    def _add_note(self, text: str) -> None:
        if text not in self._notes:
            self._notes.append(text)


_SLIDERS = {"x": _MAX_X, "y": _MAX_Y, "a": _MAX_ANGLE, "N": _MAX_LIGHT_NOISE, "M": _MAX_MOTOR_NOISE}


def _to_slider_value(value: float, maximum: int) -> int:
    """Return the slider value for a coordinate. JavaScript rounds halves up."""
    return min(max(math.floor(value + 0.5), 0), maximum)
