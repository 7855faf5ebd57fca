"""The flags of the notebook's magics, and the set-up that they give a fresh simulator.

The order, the clamps and the side effects are the original's (robolab sections 1.2 and 8); a flag that does
not mean what it seems to say is pointed out in ``notes``.
"""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field, replace
from typing import Literal

from sim.backgrounds import OBSTACLE_PRESETS, floor, names
from sim.errors import UsageError
from sim.recording import Pose
from sim.robot import ROBOTS

Preamble = Literal["none", "imports", "preloaded"]
_PREAMBLES: dict[str, Preamble] = {
    "sim_magic": "none",
    "sim_magic_imports": "imports",
    "sim_magic_preloaded": "preloaded",
}

_X_MOST, _Y_MOST, _ANGLE_MOST = 2362, 1143, 360
_LIGHT_NOISE_MOST, _MOTOR_NOISE_MOST = 128, 500

#: Where a robot is put by a fresh widget, and by choosing a robot.
_FRESH = Pose(200, 800, 0)
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
_LONG = {long: short for short, long in (_VALUED | _SWITCHES).items()}


@dataclass(frozen=True, slots=True)
class Flags:
    """What a magic line says: the value of each valued flag, and the switches that are on."""

    preamble: Preamble = "preloaded"
    values: dict[str, str] = field(default_factory=dict)
    switches: frozenset[str] = frozenset()

    def with_values(self, **values: str | None) -> Flags:
        """These flags with some values replaced; None leaves one as it is."""
        given = {key: value for key, value in values.items() if value is not None}
        return replace(self, values=self.values | given)


@dataclass(frozen=True, slots=True)
class Setup:
    """What the flags make of a fresh simulator."""

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
    """The flags of a program's magic line and ``without_magic``; the preloaded preamble if it has none.

    Raises UsageError for a magic or a flag that does not exist.
    """
    place = _magic_place(text)
    if place is None:
        return Flags(), text
    return parse_magic(text.split("\n")[place].lstrip("\ufeff").strip(), place + 1), without_magic(text)


def without_magic(text: str) -> str:
    """The program with its magic line as an empty comment, so that every other line keeps its number."""
    lines = text.split("\n")
    place = _magic_place(text)
    if place is not None:
        lines[place] = "#"
    return "\n".join(lines)


def _magic_place(text: str) -> int | None:
    """Where the first line is that is neither blank nor a comment, if it is a magic."""
    for place, line in enumerate(text.split("\n")):
        stripped = line.lstrip("\ufeff").strip()
        if stripped and not stripped.startswith("#"):
            return place if stripped.startswith("%") else None
    return None


def parse_magic(line: str, number: int = 1) -> Flags:
    """The flags of a ``%%sim_magic...`` line. Raises UsageError, naming line ``number``, for what does not exist."""
    name, *rest = line.lstrip("%").split(maxsplit=1) or [""]
    try:
        if name not in _PREAMBLES:
            expected = ", ".join(f"%%{known}" for known in _PREAMBLES)
            raise UsageError(f"%{name[:40]} is not a magic that starts a program; expected one of {expected}")
        return _flags(_words(name, "".join(rest)), _PREAMBLES[name])
    except UsageError as error:
        raise UsageError(f"line {number}: {error}") from None


def _words(name: str, arguments: str) -> list[str]:
    try:
        return shlex.split(arguments, comments=False)
    except ValueError as error:
        raise UsageError(f"the flags of %%{name} cannot be read: {str(error).lower()}") from None


def _flags(words: list[str], preamble: Preamble) -> Flags:
    values: dict[str, str] = {}
    switches: set[str] = set()
    waiting = list(words)
    while waiting:
        word = waiting.pop(0)
        if word.startswith("--"):
            long, equals, value = word[2:].partition("=")
            short = _LONG.get(long)
            if long == "previewcode":
                continue
            if short is None:
                raise UsageError(f"there is no flag --{long[:40]}; --help of the course's magic lists them")
            if short in _VALUED:
                values[short] = value if equals else _next(waiting, word)
            else:
                switches.add(short)
        elif word.startswith("-") and len(word) > 1:
            _short_flags(word[1:], waiting, values, switches)
        else:
            raise UsageError(f"{word[:40]!r} is not a flag")
    return Flags(preamble, values, frozenset(switches))


def _short_flags(letters: str, waiting: list[str], values: dict[str, str], switches: set[str]) -> None:
    """Single letters may stand together (-HWZ); one that takes a value takes the rest of the word, or the next word."""
    for place, letter in enumerate(letters):
        if letter in _SWITCHES:
            switches.add(letter)
        elif letter in _VALUED:
            rest = letters[place + 1 :]
            values[letter] = rest if rest else _next(waiting, f"-{letter}")
            return
        else:
            raise UsageError(f"there is no flag -{letter}")


def _next(waiting: list[str], flag: str) -> str:
    if not waiting:
        raise UsageError(f"{flag} needs a value")
    return waiting.pop(0)


def setup(flags: Flags) -> Setup:
    """What a fresh simulator looks like after these flags. Raises UsageError for a number that is none."""
    return _Widget().apply(flags)


class _Widget:
    """The original's page: sliders that clamp, and moves that read all three of them."""

    def __init__(self) -> None:
        self.background = "Empty_Map"
        self.robot = "Default_Robot"
        self.obstacles: tuple[tuple[float, float, float, float], ...] = ()
        self.pose = _FRESH
        self.angle_slider = 0
        self.noise = {"N": 0.0, "M": 0.0}
        self.notes: list[str] = []

    def apply(self, flags: Flags) -> Setup:
        values = flags.values
        if "r" in values:
            self._choose_robot(values["r"])
        if "b" in values:
            self._choose_background(values["b"])
        if "o" in values:
            self._choose_obstacles(values["o"])
        x, y = self._slider("x", values, _X_MOST), self._slider("y", values, _Y_MOST)
        angle = self._slider("a", values, _ANGLE_MOST)
        if x is not None or y is not None or angle is not None:
            self._move(x, y, angle)
        light = self._slider("N", values, _LIGHT_NOISE_MOST)
        if light is not None:
            self.noise["N"] = light
            before = self.pose
            self._move(None, None, None)
            if before.heading != self.pose.heading:
                self._note(f"-N also turns the robot to {self.pose.heading:g} degrees, as in the simulator")
        motor = self._slider("M", values, _MOTOR_NOISE_MOST)
        if motor is not None:
            self.noise["M"] = motor
        return Setup(
            self.background,
            self.robot,
            self.obstacles,
            self.pose,
            self.noise["N"],
            self.noise["M"],
            "p" in flags.switches,
            "L" in flags.switches,
            tuple(self.notes),
        )

    def _choose_robot(self, name: str) -> None:
        if name not in ROBOTS:
            self._note(f"-r {name[:40]} is not a robot; Default_Robot is used, as in the simulator")
            name = "Default_Robot"
        self.robot, self.pose = name, _AFTER_ROBOT

    def _choose_background(self, name: str) -> None:
        if name not in names():
            self._note(f"-b {name[:40]} is not a background; Empty_Map is used, as in the simulator")
            name = "Empty_Map"
        chosen = floor(name)
        self.background, self.obstacles, self.pose = name, chosen.obstacles, chosen.default_pose
        if 0 <= self.pose.heading <= _ANGLE_MOST:
            self.angle_slider = round(self.pose.heading)

    def _choose_obstacles(self, name: str) -> None:
        if name in OBSTACLE_PRESETS and name != "None":
            self.obstacles = OBSTACLE_PRESETS[name]
        elif name != "None":
            self._note(f"-o {name[:40]} is not a set of obstacles; they stay as they are, as in the simulator")

    def _slider(self, flag: str, values: dict[str, str], most: int) -> int | None:
        """A whole number, moved into the slider's range."""
        if flag not in values:
            return None
        try:
            wanted = int(values[flag])
        except ValueError:
            raise UsageError(f"-{flag} {values[flag][:40]}: expected a whole number between 0 and {most}") from None
        value = min(max(wanted, 0), most)
        if value != wanted:
            self._note(f"-{flag} {wanted} becomes {value}: the simulator's slider goes from 0 to {most}")
        return value

    def _move(self, x: int | None, y: int | None, angle: int | None) -> None:
        """Every move reads all three sliders; those of x and y follow the robot, that of the angle does not."""
        if angle is not None:
            self.angle_slider = angle
        x = min(max(round(self.pose.x), 0), _X_MOST) if x is None else x
        y = min(max(round(self.pose.y), 0), _Y_MOST) if y is None else y
        if angle is None and self.pose.heading != self.angle_slider:
            self._note(f"setting the position turns the robot to {self.angle_slider} degrees; add -a to choose")
        self.pose = Pose(x, y, self.angle_slider)

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)
