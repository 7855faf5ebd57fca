"""Slips that are provable from a program's text: always found, and never reported in a correct program."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from paths import ROOT
from service.grading.hint_clues import Clues, Listing
from service.grading.hint_differences import advise_on_difference
from service.grading.hint_passes import hint_about_kept_value, hint_about_stale_twin, hint_about_zero_pass
from service.grading.hint_skipped_loops import describe_unbracketed_not
from service.grading.hint_slips import collect_slips
from service.grading.hint_structure import describe_discarded_value
from submissions.criteria import Criterion
from submissions.criteria.motion import Excursions

LOST = Excursions.model_construct(id="out", check="excursions", heights=(1.0,))


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


@pytest.mark.long
def test_there_is_no_slip_in_programs_that_are_right() -> None:
    slips_by_name = {name: slips for name, text in sources() if (slips := list(collect_slips(listing(text, name))))}
    assert slips_by_name == {}


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("area = side ^ 2", "Write ** instead of ^"),
        ('if day != "Sat" or day != "Sun":', "Write and in place of or"),
        ("while colorLeft.color != 3 or colorLeft.color != 5:", "is always true"),
        ('if day == "Sat" and day == "Sun":', "Write or in place of and"),
        ("if shape.all:", "Write shape.all()"),
        ("while text.isdigit and a > 3:", "Write text.isdigit()"),
        ('while colorLeft.color_name != "red":', 'Write "Red"'),
        ('name = colorLeft.color_name\nif name == "grey":', "one of NoColor, Black"),
        ("days = []\nfor day in week:\n    days = days.append(day)", "Write days.append(day) alone there"),
        ("numbers = [3, 1]\nnumbers = numbers.sort()", "line 2 makes numbers None"),
        ("if 10 < x & x < 20:", "Write and instead of &"),
        ("if x < 10 | y > 20:", "Write or instead of |"),
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
        ("if a > 3 or b > 3:\n    return 1\nif b > 3:\n    return 2", "Remove what line 3 asks from line 1"),
        ("if a > 3:\n    return 1\nif a > 4:\n    return 2", "line 1 has already found that a > 3"),
        ("tank_drive.on_for_rotations(40, 40, 1,5)", "write 1.5"),
        ("tank_turn.on_for_degrees(-100, SpeedPercent(15), 90,5)", "write 90.5"),
        ('say("Colour", colorLeft.color)', 'Write say("Colour" + " " + str(colorLeft.color))'),
        ('if sender == "1":', "Write 1 without quotes"),
        ('if glue.robot_number() == "2":', "Write 2 without quotes"),
        ("if glue.robot_number() == 0:", "numbers 1 and 2"),
        ('count = 1\nwhile count != "5":\n    count = count + 1', "Write 5 without quotes"),
        ("if sender == 3:", "numbers 1 and 2"),
    ],
)
def test_a_slip_is_found_with_its_fix(line: str, words: str) -> None:
    slips = list(collect_slips(listing(line)))
    assert len(slips) == 1
    assert words in slips[0]


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
        "if a > 3 or b > 3:\n    return 1\nif b > 2:\n    return 2",
        "if a > 3 or b > 3:\n    x = 1\nif b > 3:\n    return 2",
        "if sensor.value() < 9:\n    return 1\nif sensor.value() < 5:\n    return 2",
        "tank_drive.on_for_rotations(40, 40, 5)",
        "tank_drive.on_for_rotations(40, 40, 5, True)",
        "tank_drive.on_for_rotations(left_speed=40, right_speed=40, rotations=1, brake=False)",
        'say("Colour", True)',
        'say("Colour", wait=True)',
        'say("Colour", 1)',
        'def say(a, b):\n    print(a, b)\nsay("Colour", name)',
        "if sender == 1:",
        "if glue.robot_number() == 2:",
        'answer = "1"\nif answer == "1":',
        'count = 1\ncount = str(count)\nif count == "1":',
        'for count in texts:\n    if count == "1":',
        'sender = "1"\nif sender == "1":',
        'if day != "Sat" and day != "Sun":',
        'if day == "Sat" or day == "Sun":',
        "if a != 3 or b != 5:",
        "if a != 3 or a != b:",
        "if a != 3 or a != 3 + b:",
        "if shape.all():",
        "if all(x) and settings.any_light:",
        'name = "grey"\nif name == "grey":',
        "table = read()\ntable = table.append(3)",
    ],
)
def test_no_slip_is_seen_in_what_is_right(line: str) -> None:
    assert list(collect_slips(listing(line))) == []


def effects(text: str) -> list[str]:
    """Return the statements of a text that are reported to have no effect."""
    code = listing(text).code
    return [discarded_value for each in code.statements if (discarded_value := describe_discarded_value(each, code))]


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


def clues_of(text: str, *lost: Criterion) -> Clues:
    """Return clues of a robot program that lost marks on these criteria, without trials."""
    return Clues((listing(text),), (), lost, (), None, "preloaded", False)


NESTED = "{start}for number in (1, 2):\n    {reset}while answer is None:\n        answer = find(number)\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            NESTED.format(start="answer = None\n", reset=""),
            "Move answer = None from line 1 into the loop, below line 2",
        ),
        (
            "side = 0\nfor square in range(3):\n    while side < 4:\n        side = side + 1\n",
            "Move side = 0 from line 1",
        ),
        ("side = 0\nwhile True:\n    while side < 4:\n        side += 1\n", "Move side = 0 from line 1"),
    ],
)
def test_a_value_that_an_inner_loop_keeps_is_found(text: str, words: str) -> None:
    assert [words in found for found in hint_about_kept_value(clues_of(text, LOST))] == [True]


@pytest.mark.parametrize(
    "text",
    [
        NESTED.format(start="answer = None\n", reset="answer = None\n    "),
        NESTED.format(start="", reset="answer = None\n    "),
        "count = 0\nwhile count < 4:\n    while count < 2:\n        count += 1\n    count += 1\n",
        "light = 100\nwhile True:\n    while light > 40:\n        light = colorLeft.reflected_light_intensity_pc\n",
        "count = 0\nwhile count < 4:\n    count = count + 1\n",
    ],
)
def test_no_kept_value_is_seen_in_loops_that_are_right(text: str) -> None:
    assert list(hint_about_kept_value(clues_of(text, LOST))) == []


LEFT, RIGHT = (f"{side.lower()} = color{side}.reflected_light_intensity_pc\n" for side in ("Left", "Right"))
DRIVE = "    tank_drive.on(left, right)\n"


@pytest.mark.parametrize(
    ("text", "count"),
    [
        (f"{LEFT}{RIGHT}while left > 5:\n{DRIVE}    {LEFT}", 1),
        (f"{LEFT}{RIGHT}while left > 5:\n{DRIVE}    {LEFT}    {RIGHT}", 0),
        (f"{LEFT}{RIGHT}while left > 5:\n    tank_drive.on(left, 20)\n    {LEFT}", 0),
        ("start = gyro.angle\nwhile now - start < 90:\n    now = gyro.angle\n", 0),
        ("start = colorLeft.red\nx = 1\ny = 2\nnow = 3\nwhile now > start:\n    now = colorRight.red\n", 0),
    ],
)
def test_a_reading_is_stale_only_if_its_twin_is_renewed(text: str, count: int) -> None:
    assert len(list(hint_about_stale_twin(clues_of(text, LOST)))) == count


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("for n in range(3):\n    way = n * 2\n    tank_drive.on_for_rotations(40, 40, way)\n", 1),
        ("for n in range(3):\n    tank_drive.on_for_rotations(40, 40, 2 * n)\n", 1),
        ("for n in range(1, 4):\n    tank_drive.on_for_rotations(40, 40, 2 * n)\n", 0),
        ("for n in range(3):\n    tank_drive.on_for_rotations(40, 40, n + 1)\n", 0),
        ("for n in range(3):\n    tank_drive.on_for_rotations(40, 40, 2 * (n + 1))\n", 0),
        ("for n in range(4):\n    tank_drive.on_for_rotations(40, 40, 2)\n", 0),
    ],
)
def test_a_first_pass_with_0_is_found_only_in_a_product(text: str, count: int) -> None:
    assert len(list(hint_about_zero_pass(clues_of(text, LOST)))) == count


@pytest.mark.parametrize(
    ("condition", "words"),
    [
        ("not red > 200 and green < 50", "not (red > 200 and green < 50)"),
        ("not (red > 200 and green < 50)", ""),
        ("not found and tries < 20", ""),
        ("red > 200 and not green > 50", ""),
    ],
)
def test_not_before_the_first_of_two_comparisons_is_found(condition: str, words: str) -> None:
    statement = listing(f"while {condition}:\n    pass").code.statements[0]
    found = describe_unbracketed_not(statement.condition)
    assert words in found
    assert bool(found) == bool(words)


@pytest.mark.parametrize(
    ("expected", "actual", "words"),
    [
        (100, 36000.0, "divide by 360"),
        (360, 1.0, "multiply by 360"),
        (3.14159, 1.0, "math.pi"),
        (1.5708, 90.0, "180 / math.pi"),
        (97, 80, ""),
        ("left", "Left", 'write "left"'),
        ("Py saw: 0", "Py saw: PY::0", 'removeprefix("PY::")'),
        ("a b", "ab", "Only blanks differ"),
        ("saw: 0", "saw 0", 'Only signs differ: write "saw: 0"'),
        ("last: hello", "last: {'message': 'hello'}", 'take its value with ["message"]'),
        ("last: hello", "last: {'message': 'bye'}", ""),
        ("saw 0", "saw ['PY', '0']", "take one entry, [1]"),
        ("saw 3", "saw ['PY', '0']", ""),
        ("left", "right", ""),
    ],
)
def test_a_difference_of_two_values_is_described(expected: object, actual: object, words: str) -> None:
    found = advise_on_difference(expected, actual)
    assert words in found
    assert bool(found) == bool(words)
