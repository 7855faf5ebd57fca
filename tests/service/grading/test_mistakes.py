"""Students' mistakes: the first screen of each report names the line or the cause, and the fix."""

from __future__ import annotations

import inspect
import re
import sys
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from _pytest.mark import ParameterSet

from mistakes import first_screen
from paths import DATA, ROOT
from service.grading.hint_code import read_code
from service.grading.hint_error_advice import ADVICE
from service.grading.hint_tables import ACTIONS, PROPERTIES, USAGE
from service.grading.trial_runner import TrialRunner

MISTAKES = tomllib.loads((DATA / "mistakes.toml").read_text("utf-8"))["mistake"]

#: One in this number of mistakes is a quick test.
_QUICK_INTERVAL = 14


def _cases() -> Iterator[ParameterSet]:
    for number, case in enumerate(MISTAKES):
        yield pytest.param(case, id=case["name"], marks=[pytest.mark.long] * (number % _QUICK_INTERVAL > 0))


@pytest.mark.parametrize("case", list(_cases()))
def test_the_first_screen_names_the_cause_and_the_fix(
    case: Mapping[str, Any], runner: TrialRunner, tmp_path: Path
) -> None:
    screen_text = first_screen(case, tmp_path, runner)
    assert [words for words in case["first_screen"] if words not in screen_text] == [], screen_text
    assert [words for words in case.get("never", ()) if words in screen_text] == [], screen_text
    assert "shown below" not in screen_text


@pytest.fixture
def brick(monkeypatch: pytest.MonkeyPatch) -> Mapping[str, Any]:
    """Return the classes that robot programs import."""
    before = set(sys.modules)
    monkeypatch.syspath_prepend(str(ROOT / "sim" / "brick"))
    from ev3dev2.motor import LargeMotor, MoveSteering, MoveTank
    from ev3dev2.sensor.lego import ColorSensor, GyroSensor, UltrasonicSensor

    brick_classes = (LargeMotor, MoveSteering, MoveTank, ColorSensor, GyroSensor, UltrasonicSensor)
    for name in set(sys.modules) - before:
        monkeypatch.delitem(sys.modules, name)
    return {each.__name__: each for each in brick_classes}


def test_the_properties_that_hints_know_are_the_bricks(brick: Mapping[str, Any]) -> None:
    real = {name for each in brick.values() for name, value in vars_of(each).items() if isinstance(value, property)}
    assert real >= PROPERTIES


def test_calls_are_written_as_the_brick_defines_them(brick: Mapping[str, Any]) -> None:
    owners = {"tank_drive": "MoveTank", "tank_turn": "MoveSteering"}
    for name, usage in USAGE.items():
        owner, _, method = name.partition(".")
        parameters = list(inspect.signature(getattr(brick[owners[owner]], method)).parameters.values())[1:]
        needed = [each.name for each in parameters if each.default is inspect.Parameter.empty]
        written = re.findall(r"[\w ]+(?=[,)])", usage.partition("(")[2])
        assert len(written) == len(needed)
    assert {"on", "off", "on_for_seconds"} <= ACTIONS


def test_the_ports_that_hints_name_are_the_bricks(brick: Mapping[str, Any]) -> None:
    advice_by_pattern = {each.pattern: advice for each, advice in ADVICE}
    for kind, sensor in (("color", "ColorSensor"), ("gyro", "GyroSensor"), ("ultrasonic", "UltrasonicSensor")):
        named = re.findall(r"INPUT_(\d)", advice_by_pattern[f"No {kind} sensor connected to"])
        assert [f"in{number}" for number in named] == list(brick[sensor]._ports)
    for letter in re.findall(r"OUTPUT_(\w)", advice_by_pattern["No motor connected to"]):
        assert brick["LargeMotor"](f"out{letter}").address == f"out{letter}"


def vars_of(owner: type) -> dict[str, Any]:
    return {name: value for each in reversed(owner.__mro__) for name, value in vars(each).items()}


def test_code_is_read_as_far_as_it_can_be_split_into_tokens() -> None:
    code = read_code(["%%sim_magic_preloaded", "while x > 0: x -= 1", "def f(a,", "      b):", "    return '", "y = 1"])
    loop, inside, function = code.statements[:3]
    assert (loop.line, loop.condition, code.list_body(loop)) == (2, ("x", ">", "0"), (inside,))
    assert (function.line, function.last_line, inside.bound_names) == (3, 4, {"x"})
    assert code.list_enclosing(inside) == (loop,)
