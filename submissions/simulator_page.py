"""The simulator's page: floor, robot, pose and noise, as the magics leave them.

Order, limits and side effects follow the original (robolab sections 1.2 and 8). ``notes`` explains flags whose effect
may be unexpected. ``magics.py`` reads the flags.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from sim.errors import UsageError
from sim.floors import OBSTACLE_PRESETS, get_floor_start, list_floor_names
from sim.recording import Pose
from sim.robot import WIDENED, get_default_robot_name
from submissions.magics import Flags
from submissions.suggestions import suggest_name

MAX_X, MAX_Y, MAX_ANGLE = 2362, 1143, 360
MAX_LIGHT_NOISE, MAX_MOTOR_NOISE = 128, 500
_PEN_COLOURS = ("red", "orange", "green")
#: Pose of the robot in a new simulator, and after a robot is chosen.
_FRESH_POSE = Pose(200, 800, 0)
_AFTER_ROBOT = Pose(200, 943, 0)


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


@dataclass(frozen=True, slots=True)
class PageState:
    """State of the page between two magics; the defaults are those of a new one.

    ``robot`` is the chosen robot, or its widened form if the background has one. ``angle_slider`` does not follow the
    robot. Without ``noise_is_heard``, flags for noise have no effect.
    """

    background: str = "Empty_Map"
    robot: str = "Default_Robot"
    chosen_robot: str = "Default_Robot"
    obstacles: tuple[tuple[float, float, float, float], ...] = ()
    pose: Pose = _FRESH_POSE
    angle_slider: int = 0
    light_noise: float = 0.0
    motor_noise: float = 0.0
    noise_is_heard: bool = True


FRESH_PAGE = PageState()


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

    def __init__(self, state: PageState = FRESH_PAGE) -> None:
        self.state = state
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
        state = self.state
        return SimulatorSettings(
            state.background,
            state.robot,
            state.obstacles,
            state.pose,
            state.light_noise,
            state.motor_noise,
            "p" in flags.switches,
            "L" in flags.switches,
            tuple(self._notes),
        )

    def set_pose(self, pose: Pose) -> None:
        """Set the robot's pose after a run."""
        self.state = replace(self.state, pose=pose)

    def _choose_robot(self, name: str) -> None:
        if name not in WIDENED:
            hint = suggest_name(name[:40], WIDENED)
            self._add_note(f"-r {name[:40]} is not a robot; Default_Robot is used, as in the simulator{hint}")
            name = "Default_Robot"
        self.state = replace(
            self.state,
            robot=name,
            chosen_robot=name,
            pose=_AFTER_ROBOT,
            light_noise=0.0,
            motor_noise=0.0,
            noise_is_heard=True,
        )

    def _choose_background(self, name: str) -> None:
        if name not in list_floor_names():
            hint = suggest_name(name[:40], list_floor_names())
            self._add_note(f"-b {name[:40]} is not a background; Empty_Map is used, as in the simulator{hint}")
            name = "Empty_Map"
        pose, obstacles = get_floor_start(name)
        # The original keeps this change of the robot for the rest of the session; here it ends with the background.
        robot = self.state.chosen_robot
        self.state = replace(self.state, background=name, pose=pose, obstacles=obstacles, robot=robot)
        if 0 <= pose.heading <= MAX_ANGLE:
            self.state = replace(self.state, angle_slider=round(pose.heading))
        if get_default_robot_name(name) == WIDENED["Default_Robot"]:
            self._add_note("-b Radial_grey also sets the light sensors 60 mm to either side, as in the simulator")
            self.state = replace(
                self.state, robot=WIDENED[robot], light_noise=0.0, motor_noise=0.0, noise_is_heard=False
            )

    def _choose_obstacles(self, name: str) -> None:
        if name in OBSTACLE_PRESETS and name != "None":
            self.state = replace(self.state, obstacles=OBSTACLE_PRESETS[name])
        elif name != "None":
            hint = suggest_name(name[:40], OBSTACLE_PRESETS)
            self._add_note(
                f"-o {name[:40]} is not a set of obstacles; they stay as they are, as in the simulator{hint}"
            )
        elif self.state.obstacles:
            self._add_note(
                "-o None leaves the obstacles as they are, as in the simulator; choosing a background clears them"
            )

    def _choose_noise(self, light: int | None, motor: int | None) -> None:
        is_heard = self.state.noise_is_heard
        if (light or motor) and not is_heard:
            self._add_note(
                "-N and -M do nothing after -b Radial_grey until a robot is chosen (-r), as in the simulator"
            )
        if light is not None:
            self.state = replace(self.state, light_noise=light if is_heard else 0.0)
            old_heading = self.state.pose.heading
            self._move(None, None, None)
            heading = self.state.pose.heading
            if old_heading != heading:
                self._add_note(f"-N also turns the robot to {heading:g} degrees, as in the simulator")
        if motor is not None:
            self.state = replace(self.state, motor_noise=motor if is_heard else 0.0)

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
        pose, slider = self.state.pose, self.state.angle_slider if angle is None else angle
        x = _to_slider_value(pose.x, MAX_X) if x is None else x
        y = _to_slider_value(pose.y, MAX_Y) if y is None else y
        if angle is None and pose.heading != slider:
            self._add_note(f"setting the position turns the robot to {slider} degrees; add -a to choose")
        self.state = replace(self.state, pose=Pose(x, y, slider), angle_slider=slider)

    def _add_note(self, text: str) -> None:
        if text not in self._notes:
            self._notes.append(text)


_SLIDERS = {"x": MAX_X, "y": MAX_Y, "a": MAX_ANGLE, "N": MAX_LIGHT_NOISE, "M": MAX_MOTOR_NOISE}


def _to_slider_value(value: float, maximum: int) -> int:
    """Return the slider value for a coordinate. JavaScript rounds halves up."""
    return min(max(math.floor(value + 0.5), 0), maximum)
