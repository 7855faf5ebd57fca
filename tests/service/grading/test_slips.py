"""Slips that are provable from a program's text: always found, and never reported in a correct program."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from paths import ROOT
from service.grading.hint_clues import Listing
from service.grading.hint_loops import describe_discarded_value
from service.grading.hint_slips import collect_slips


def listing(text: str, name: str = "robot.py") -> Listing:
    lines = tuple(text.split("\n"))
    return Listing(name, "program", lines)


def sources() -> Iterator[tuple[str, str]]:
    """Yield all programs of the catalogue, correct or flawed, and the responders and modules of Robomark."""
    for top in ("submissions/catalogue", "responders/library", "responders/kit", "sim/brick"):
        for file in sorted((ROOT / top).rglob("*.py")):
            yield str(file.relative_to(ROOT)), file.read_text("utf-8")
    for file in sorted((ROOT / "tests" / "data").rglob("*.ipynb")):
        yield from _cells(file)


def _cells(file: Path) -> Iterator[tuple[str, str]]:
    for number, cell in enumerate(json.loads(file.read_text("utf-8")).get("cells", []), 1):
        if cell["cell_type"] == "code":
            yield f"{file.name}, cell {number}", "".join(cell["source"])


def test_there_is_no_slip_in_programs_that_are_right() -> None:
    found = {name: slips for name, text in sources() if (slips := list(collect_slips(listing(text, name))))}
    assert found == {}


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("area = side ^ 2", "Write ** in place of ^"),
        ("if 10 < x & x < 20:", "Write and in place of &"),
        ("if x < 10 | y > 20:", "Write or in place of |"),
        ('while colour != "red" and "white":', 'Write and colour != "white"'),
        ("if colour == 3 or 5:", "Write or colour == 5"),
        ("light = colorLeft.red\nif light and other < 25:", "Write light < 25 and other < 25"),
        ('names = ["a", "b"\n    "c"]', 'a comma is missing after "b"'),
        ('names = {"a": 1, "b": "x" "c"}', "a comma is missing"),
        ("while get_clock < 10:", "Write get_clock()"),
        ('if colorLeft.color == "Red":', "color_name"),
        ('light = colorLeft.reflected_light_intensity_pc\nif light == "0":', "0 without quotes"),
        ("for i in range(5, 5):", "is empty"),
        ("for i in range(1, 5, -1):", "range(1, 6)"),
        ("for i in range(9, 0):", "range(9, -1, -1)"),
        ("def area(a):\n    b = a * a\n    b", "Write return b"),
        ('def answer(text):\n    f"Python saw {text}"', "Write return"),
        ('if a > 9:\n    say("x")\nif a > 5:\n    say("y")\nelse:\n    say("z")', "elif"),
        ("for day in days:\n    if day == 1:\n        days.remove(day)", "the loop in line 1 goes through"),
        ("if a < 9:\n    b = 1\nelif a < 5:\n    b = 2", "line 3"),
        ("if a < 9:\n    return 1\nif a < 5 and b < 5:\n    return 2", "Move this condition above line 1"),
        ("if a > 3:\n    return 1\nif a > 4:\n    return 2", "line 1 has already found that a > 3"),
    ],
)
def test_a_slip_is_found_with_its_fix(line: str, words: str) -> None:
    found = list(collect_slips(listing(line)))
    assert len(found) == 1
    assert words in found[0]


@pytest.mark.parametrize(
    "line",
    [
        "bits = flags & 3",
        "if (a < 3) & (b < 4):",
        'name = given or "nobody"',
        "if found and light < 25:",
        'print("one " "two")',
        'long = ["a text of many words that goes on in the " "next line because it is long", "b"]',
        "clock = get_clock()",
        'if colorLeft.color_name == "Red":',
        "for i in range(9, 0, -1):",
        "for i in range(1, n):",
        'def area(a):\n    "What it is."\n    return a',
        "def wait():\n    pass",
        'if a > 9:\n    say("x")\nif b > 5:\n    say("y")\nelse:\n    say("z")',
        "if a > 9:\n    return 1\nif a > 5:\n    return 2\nelse:\n    return 3",
        "for day in list(days):\n    days.remove(day)",
        "for day in days:\n    if day == 1:\n        days.remove(day)\n        break",
        "for day in days:\n    others.remove(day)",
        "if a < 9:\n    b = 1\nif a < 5:\n    b = 2",
        "if a < 9:\n    return 1\na = a - 9\nif a < 5:\n    return 2",
        "if a < 9:\n    return 1\nif b:\n    a = 1\nif a < 5:\n    return 2",
        "if a < 9 and b < 3:\n    return 1\nif a < 5:\n    return 2",
        "if a == 1:\n    return 1\nif a == 2:\n    return 2",
        "if sensor.value() < 9:\n    return 1\nif sensor.value() < 5:\n    return 2",
    ],
)
def test_no_slip_is_seen_in_what_is_right(line: str) -> None:
    assert list(collect_slips(listing(line))) == []


def effects(text: str) -> list[str]:
    """Return the statements of a text that are reported to have no effect."""
    code = listing(text).code
    return [found for each in code.statements if (found := describe_discarded_value(each, code))]


@pytest.mark.parametrize(
    "text",
    [
        "count = 5\nwhile count > 0:\n    count =- 1",
        "count = 0\nfor i in range(3):\n    count =+ 2",
        "count = 5\ndef step():\n    count =- 1\nwhile True:\n    step()",
    ],
)
def test_a_turned_operator_is_found(text: str) -> None:
    assert len(effects(text)) == 1


@pytest.mark.parametrize(
    "text",
    [
        "STEERING = -100",
        "STEERING =- 100",
        "speed = -50",
        "speed =- 50",
        "speed = 50\nwhile True:\n    speed = -50",
        "speed = 50\nwhile True:\n    speed = - 50",
        "speed = 50\nwhile True:\n    speed =-50",
        "speed = 50\nspeed =- 50",
        "for i in range(3):\n    speed =- 50",
        "SPEED = 50\nwhile True:\n    SPEED =- 50",
    ],
)
def test_a_negative_number_is_no_turned_operator(text: str) -> None:
    assert effects(text) == []
