"""Attacks on evidence: the same thing shown many times, or marks without any work."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal
from typing import Any

import numpy as np
import pytest

from driving import along, driven, rest, spin, straight
from judging import criterion, judged, recorded
from paths import DATA
from responders.source_file import SourceFile
from service.grading.grade import CriterionResult
from service.grading.grader import grade
from service.grading.judging import collecting, patterns
from service.grading.judging.judge import judge
from service.grading.trial_runner import TrialRunner
from sim.recording import DatalogEntry, Image, Message, Pose, Recording, TimedText
from submissions.assignment.examples import locate_examples
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission
from submissions.submission import Submission

_BEGIN = "%%sim_magic_preloaded\nimport time\n"
_TINY_SQUARE = """
def turn(way):
    tank_drive.on(SpeedPercent(10 * way), SpeedPercent(-10 * way))
    time.sleep(2.75)
    tank_drive.off()
    time.sleep(0.5)
def ahead(seconds):
    tank_drive.on(SpeedPercent(20), SpeedPercent(20))
    time.sleep(seconds)
    tank_drive.off()
    time.sleep(0.5)
turn(1)
ahead(2.5)
for corner in range(5):
    turn(-1)
    ahead(1)
"""
_ALL_AT_ONCE = """
tank_drive.on(SpeedPercent(30), SpeedPercent(30))
for step in range(45):
    for words in {words}:
        print(words)
        say(words)
    time.sleep(0.2)
tank_drive.off()
"""
_EVERY_BOX = "rows 7 rows 9 rows 10 rows 11 columns 7 columns 9 columns 11 black 49 black 51 black 53 black 60"


#: Assignment, robot program, responder, the marks now, and the marks before the countermeasure existed.
_SUBMISSIONS: Sequence[tuple[str, str, str, str, str]] = [
    ("count-bands", _ALL_AT_ONCE.format(words='["1 2 3 4"]'), "", "2.00", "8.00"),
    ("count-bands", _ALL_AT_ONCE.format(words='"1234"'), "", "2.00", "8.00"),
    (
        "stop-at-black-line",
        "tank_drive.on(SpeedPercent(-50), SpeedPercent(-50))\ntime.sleep(3)\ntank_drive.off()\nsay('x')\n",
        "",
        "2.00",
        "6.00",
    ),
    (
        "log-bands",
        "tank_drive.on(SpeedPercent(50), SpeedPercent(50))\nlight = 1\nwhile light > 0:\n"
        "    light = colorLeft.reflected_light_intensity_pc\n"
        "    for again in range(10):\n        print('Colour: ' + str(light))\n    time.sleep(0.9)\n",
        "",
        "3.50",
        "5.50",
    ),
    (
        "bounding-boxes",
        "print('IMG_DATA')\ntime.sleep(1)\n",
        f'def responder(text):\n    return \'JSON::{{"message": "{_EVERY_BOX}"}}\'\n',
        "2.00",
        "9.00",
    ),
    ("calibrate-on-line", "print('255 100 0 0')\n", "", "1.00", "6.00"),
    ("calibrate-on-lollipop", "print('82.75 82.75 0 0 100 66.67 100 33.33')\n", "", "1.00", "7.00"),
    (
        "grey-band-readings",
        "print('100 86.27 82.75 50.2 0 255 255 255 220 220 220 211 211 211 128 128 128 0 0 0')\n",
        "",
        "1.00",
        "6.00",
    ),
    (
        "labelled-digits",
        "tank_drive.on(SpeedPercent(50), SpeedPercent(50))\ntime.sleep(6)\nprint('image_data both')\n",
        "",
        "0.00",
        "2.00",
    ),
    ("follow-a-shape-and-log-the-gyro", _TINY_SQUARE, "", "0.00", "3.00"),
]


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "robot", "responder", "most", "before"), _SUBMISSIONS, ids=lambda value: value if "-" in value else ""
)
def test_what_does_not_do_what_was_asked_gets_little(
    name: str, robot: str, responder: str, most: str, before: str, runner: TrialRunner
) -> None:
    submission = Submission(
        "x", SourceFile("robot.py", _BEGIN + robot), SourceFile("responder.py", responder) if responder else None
    )
    graded = grade(submission, find_assignment(name), runner=runner)
    assert graded.marks <= Decimal(most) < Decimal(before), [result.message for result in graded.criteria]


#: The middle of the left sensor as it is mounted: to the robot's right, and ahead.
_LEFT = (-20.0, 30.0)


def _looking_at(x: float, y: float, heading: float) -> Pose:
    """Return the pose of a robot with its left sensor at (x, y)."""
    turn = math.radians(heading - 90)
    right, ahead = _LEFT
    return Pose(
        x - (math.cos(turn) * right - math.sin(turn) * ahead),
        y - (math.sin(turn) * right + math.cos(turn) * ahead),
        heading,
    )


def _photographed(*seen: tuple[Pose, str, str], **parts: Any) -> Recording:
    """Return a recording of images from these poses: their labels and the answers."""
    images: list[Image] = []
    messages: list[Message] = []
    for number, (pose, truth, answer) in enumerate(seen):
        t = number / 10
        pixels = np.full(1600, 255, np.uint8)
        pixels[: number + 1] = number
        images.append(Image(t, int(30 * t), pose, pixels.tobytes(), bytes(1600), len(messages), truth))
        messages += [Message(t, "robot", "IMG_DATA::{}", t), Message(t, "responder", answer, t, len(messages))]
    return recorded(images=tuple(images), messages=tuple(messages), background="Simple_Shapes", **parts)


def _counted(result: CriterionResult) -> int:
    assert result.accuracy is not None
    return result.accuracy.n


@pytest.mark.parametrize("how", ["majority", "any", "first"])
@pytest.mark.parametrize("headings", [range(0, 360, 60), range(0, 360, 5)])
def test_one_pattern_from_many_headings_is_one_pattern(how: str, headings: range) -> None:
    """Each of these six poses is about 36 mm from the next one, and they used to count as 6 of 6 patterns."""
    one = [(_looking_at(310, 920, heading), "square", "square") for heading in headings]
    result = judged(criterion("classification", each_pattern=how, patterns=6, over="all"), _photographed(*one))
    assert result.marks == 0
    assert "images of 1 patterns, and 6 were expected" in result.message
    six = [(_looking_at(230 + 80 * number, 920, 60 * number), "square", "square") for number in range(6)]
    assert judged(criterion("classification", each_pattern=how, patterns=6, over="all"), _photographed(*six)).marks == 4


#: The drive, the responder, and the marks of a criterion: now, and before the countermeasure existed.
_DRIVEN = [
    ("one-shape-from-six-sides", "always the same", "shapes-on-the-move", "shapes", "0.00", "3.00"),
    ("one-shape-from-six-sides", "the network", "shapes-on-the-move", "shapes", "0.00", "6.00"),
    ("one-shape-from-six-sides", "always the same", "shapes-on-a-track", "track", "1.33", "4.00"),
    ("one-place-four-times", "nobody", "collect-shapes", "enough", "2.75", "4.75"),
]


@pytest.mark.long
@pytest.mark.parametrize(("folder", "answers", "name", "marked", "now", "before"), _DRIVEN)
def test_what_was_seen_from_many_sides_is_one_thing(
    folder: str,
    answers: str,
    name: str,
    marked: str,
    now: str,
    before: str,
    runner: TrialRunner,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assignment = find_assignment(name)
    only = next(each for each in assignment.criteria if each.id == marked)
    assignment = replace(assignment, criteria=(only,))
    submission = read_submission(DATA / "evidence" / folder, required_parts=assignment.parts)
    if answers == "the network":
        responder = (locate_examples(name) / "reference" / "responder.py").read_text()
        submission = replace(submission, responder=SourceFile("responder.py", responder))
    graded = grade(submission, assignment, runner=runner)
    assert graded.marks == Decimal(now), graded.criteria[0].message
    # Without the countermeasure, patterns differ by the robot's position, or always, and the marks are much higher.
    monkeypatch.setattr(patterns, "locate_part", lambda recording, side, pose: (pose.x, pose.y))
    monkeypatch.setattr(collecting, "_drop_repeated_pairs", lambda image_pairs, recording: image_pairs)
    (once,) = judge(assignment, graded.trials)
    assert once.marks == Decimal(before), once.message


def test_a_pattern_that_a_patch_names_is_where_the_patch_is() -> None:
    """A turn around the patch moves the left sensor far, but not the right one, which reads the patch."""
    patch = np.full((20, 20, 4), 255, np.uint8)
    patch[:, :, :3] = 0
    seen = []
    for heading in range(0, 360, 60):
        turn = math.radians(heading - 90)
        x = 350 - (math.cos(turn) * 20 - math.sin(turn) * 30)
        y = 920 - (math.sin(turn) * 20 + math.cos(turn) * 30)
        seen.append((Pose(x, y, heading), "square", "square"))
    run = _photographed(*seen)
    run = replace(run, images=tuple(replace(image, right=patch.tobytes(), truth=None) for image in run.images))
    result = judged(criterion("classification", truth="grey", each_pattern="majority", patterns=6), run)
    assert _counted(result) == 6
    assert result.marks == Decimal("0.67")


def test_a_robot_may_not_turn_to_what_is_easier() -> None:
    """The robot stays at its start, and its sensor sees the previous shape."""
    start = _looking_at(310, 920, 0)
    turned = Pose(start.x, start.y, 180)
    run = _photographed((turned, "square", "square"), start=start)
    near = criterion("classification", near_start=30, images="last")
    assert judged(near, run).marks == 0
    assert "the robot sent none from within 30 mm of where it started" in judged(near, run).message
    stayed = _photographed((_looking_at(318, 915, 15), "square", "square"), start=start)
    assert judged(near, stayed).marks == 4


def test_sending_the_same_image_again_counts_nothing() -> None:
    """A known image, sent a hundred times, does not compensate for wrong answers to other images."""
    known = [(_looking_at(230, 920, heading), "square", "square") for heading in range(100)]
    other = [(_looking_at(310 + 80 * number, 920, 0), "diamond", "square") for number in range(3)]
    result = judged(criterion("classification"), _photographed(*known, *other))
    assert _counted(result) == 4
    assert result.marks == 1
    again = [(_looking_at(230, 920, 0), "square", answer) for answer in ("square", "diamond", "square")]
    assert judged(criterion("classification"), _photographed(*again)).marks == 4


def test_one_place_gives_one_image_whatever_the_noise() -> None:
    """With noise no two images are equal, so a robot that stood still used to get any number of different ones."""
    patch = np.zeros((20, 20, 4), np.uint8).tobytes()

    def collected(*places: float) -> Recording:
        run = _photographed(*((_looking_at(x, 920, 0), "square", "") for x in places))
        return replace(run, images=tuple(replace(image, right=patch) for image in run.images))

    rule = criterion("collects", source="sent", each=4, classes=["square"], over="mean")
    still = judged(rule, collected(310, 310, 310, 310))
    assert still.marks == 1
    assert "3 repeat" in judged(criterion("collects", source="sent", classes=["square"]), collected(*[310] * 4)).message
    assert judged(rule, collected(306, 308, 310, 312)).marks == 4


def test_what_lies_beside_the_floor_is_nothing_to_come_upon() -> None:
    dark = [(255, 255, 255)] * 20 + [(0, 0, 0)] * 40
    moves = (straight(100), straight(-50), spin(90))
    rule = criterion("encounters", below=40)
    assert judged(rule, driven(*moves, rgb=dark[: 20 + 10 + 30], start=Pose(1000, 500, 0))).marks == 4
    off = driven(*moves, rgb=dark[: 20 + 10 + 30], start=Pose(1000, 1120, 90))
    assert judged(rule, off).marks == 0


@pytest.mark.parametrize(
    ("y", "reads", "keys", "passes"),
    [
        (500, 0, {"reflected": [0, 5]}, True),
        (1200, 0, {"reflected": [0, 5]}, False),
        (1200, 0, {"reflected": [0, 5], "off_floor": True}, True),
        (1143, 255 * 0.5, {"reflected": [0, 60]}, False),
        (1200, 0, {"rgb": [0, 0, 0]}, False),
        (1200, 0, {"near": [1000, 1200], "within": 20}, True),
    ],
)
def test_black_beside_the_floor_is_not_stopped_on(y: float, reads: float, keys: dict[str, Any], passes: bool) -> None:
    end = _looking_at(1000, y, 90)
    points = np.array([[end.x, end.y - 100], [end.x, end.y]])
    run = along(points, np.array([90.0, 90.0]), rgb=[(reads, reads, reads)])
    assert (judged(criterion("stop_on", **keys), run).marks == 4) is passes


def test_an_event_is_not_said_where_another_belongs() -> None:
    run = driven(straight(600), start=Pose(100, 500, 0))
    first_event, there = {"text": "1", "zone": [100, 400, 300, 600]}, {"text": "2", "zone": [400, 400, 700, 600]}
    rule = criterion("events", sensor="middle", source="speech", events=[first_event, there], over="mean")

    def judge_speech(*lines: tuple[float, str]) -> CriterionResult:
        return judged(rule, replace(run, spoken=tuple(TimedText(t, text) for t, text in lines)))

    assert judge_speech((1.0, "1"), (3.0, "2")).marks == 4
    assert judge_speech((1.0, "1"), (1.8, "nearly 2"), (3.0, "2"), (3.5, "2")).marks == 4  # between the places
    both = judge_speech((1.0, "1 2"), (3.0, "1 2"))
    assert both.marks == 0
    assert "and not at the place of another text, but it came at" in both.message
    assert judge_speech((1.0, "1"), (1.1, "2"), (3.0, "2")).marks == 2


def test_a_reading_that_is_printed_again_is_one_sample() -> None:
    run = driven(rest(90))
    repeated = tuple(DatalogEntry(0.5 + n / 1000, "Light_left", 255.0 - n / 10, None) for n in range(10))
    rule = criterion("datalog", series="Light_left", measured="left light", at_least=10, over="mean")
    assert judged(rule, replace(run, datalog=repeated)).marks == Decimal("0.40")
    read = tuple(DatalogEntry(0.5 + n / 100, "Light_left", 255.0, None) for n in range(10))
    assert judged(rule, replace(run, datalog=read)).marks == 4


def _talk(*exchanges: tuple[str, str]) -> Recording:
    messages: list[Message] = []
    for number, (text, answer) in enumerate(exchanges):
        messages += [Message(number / 10, "robot", text, number / 10)]
        messages += [Message(number / 10, "responder", answer, number / 10 + 0.05, len(messages) - 1)]
    return recorded(messages=tuple(messages))


def test_a_message_that_is_sent_again_asks_nothing_new() -> None:
    easy, hard = ("PY::0", 'JSON::{"n": 0}'), ("PY::1", "no idea")
    answers = criterion("replies", is_json=True, over="mean")
    assert judged(answers, _talk(*[easy] * 9, hard)).marks == 2
    assert judged(answers, _talk(easy, hard)).marks == 2
    assert judged(criterion("replies", is_json=True, at_least=3), _talk(easy, easy, easy)).marks == 0
    queue = criterion("messages", queue_grows=True, over="mean")
    assert judged(queue, _talk(*[easy] * 9, hard)).marks == 2


def test_what_belongs_to_other_poses_is_not_reported_as_well() -> None:
    places = (Pose(100, 800, 0), Pose(200, 800, 0), Pose(300, 800, 0))
    rule = criterion("reports", expected=[["rows", 7], ["rows", 9], ["rows", 11]])

    def judge_texts(*texts: str) -> CriterionResult:
        runs = (recorded(printed=(TimedText(1.0, text),)) for text in texts)
        return judged(rule, *runs, poses=places)

    assert judge_texts("rows 7 columns 9", "columns 11, rows 9", "rows 11 of 20").marks == 4
    assert judge_texts(*["rows 7 rows 9 rows 11"] * 3).marks == 0
    assert judge_texts(*["rows 7 rows 9"] * 3).marks == 0


def test_spinning_beside_a_point_is_no_round() -> None:
    angles = np.linspace(0, 2 * math.pi, 200)

    def circle(radius: float) -> Recording:
        points = np.column_stack([450 + radius * np.cos(angles), 493 + radius * np.sin(angles)])
        return along(points, np.degrees(angles) + 90)

    rule = criterion("circuits", x=450, y=493, times=[0.9, 1.1], clear_of=150)
    assert judged(rule, circle(200)).marks == 4
    near = judged(rule, circle(20))
    assert near.marks == 0
    assert "150 mm clear of (450, 493), but its smallest distance was 20 mm" in near.message
