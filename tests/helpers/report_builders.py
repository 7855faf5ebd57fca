"""Grades built by hand for the report tests: a line follower, shape recognition, and hostile text.

Our own code simulates nothing here, so a report test fails only because of the report.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import replace
from decimal import Decimal
from functools import cache

import numpy as np

from responders.source_file import SourceFile
from service.grading.grade import (
    Accuracy,
    AccuracyCurve,
    Confidence,
    Counts,
    CriterionResult,
    Evidence,
    Grade,
    Level,
    Prediction,
    TrialResult,
    VisibleFeedback,
)
from service.reports.rows import TableRow
from sim.floors import build_floor
from sim.recording import (
    Call,
    DatalogEntry,
    Fault,
    Image,
    Message,
    Pose,
    Recording,
    Ticks,
    TimedText,
    Touch,
    Verdict,
)
from submissions.student_identity import Student
from submissions.submission import Submission

SHAPES = (
    "square",
    "right facing triangle",
    "left facing triangle",
    "downwards facing triangle",
    "upwards facing triangle",
    "diamond",
)
#: Markup, quotes, a terminal escape, a right-to-left override, a lone surrogate, a NUL, mathtext and Rich markup.
HOSTILE = (
    "<script>alert(1)</script>\" onload='alert(2)' {{7*7}} \x1b[31mred\u202eevil\ud800\x00 $\\frac{1}{ [red]x[/red] "
    "]]> --> =cmd() &amp; \u200b\u2028"
)
ROWS, COLUMNS = np.mgrid[0:20, 0:20]
MASK = (ROWS - 10) ** 2 + (COLUMNS - 10) ** 2 < 100


def row_of(grade: Grade) -> TableRow[Grade]:
    """Return the table row of one grade."""
    return TableRow(Student(grade.student), f"{grade.student}.zip", grade.assignment, grade)


def line_follower_recording(count: int = 300, background: str = "Lollipop", start: Pose | None = None) -> Recording:
    """Return a robot that follows the left edge of a black line for ``count`` ticks, and speaks and prints."""
    plan = build_floor(background)
    pose = start or plan.default_pose
    x, y, heading = pose.x, pose.y, pose.heading
    rows: list[tuple[float, ...]] = []
    left_degrees = right_degrees = 0.0
    lights: list[tuple[list[int], list[int]]] = []
    for _ in range(count):
        sums = [_sensor(plan.pixels, Pose(x, y, heading), side)[MASK].sum(axis=0).tolist() for side in (-20, 20)]
        error = (sums[0][0] - sums[1][0]) / 305 / 255
        left, right = 9.0 + 7.0 * error, 9.0 - 7.0 * error
        left_degrees, right_degrees = left_degrees + left, right_degrees + right
        step = (left + right) / 2 * math.pi * 56 / 360
        x, y = x + step * math.cos(math.radians(heading)), y + step * math.sin(math.radians(heading))
        heading += (right - left) * 56 / 360
        lights.append((sums[0], sums[1]))
        rows.append((x, y, heading, left_degrees, right_degrees))
    table = np.array(rows) if rows else np.empty((0, 5))
    ticks = Ticks(
        x=table[:, 0],
        y=table[:, 1],
        heading=table[:, 2],
        left_position=table[:, 3],
        right_position=table[:, 4],
        left_sums=np.array([light[0] for light in lights], dtype=np.int64).reshape(-1, 3),
        right_sums=np.array([light[1] for light in lights], dtype=np.int64).reshape(-1, 3),
        ultrasonic=np.clip((2362 - table[:, 0]) // 10 * 10, 0, 2550).astype(float),
        gyro=pose.heading - table[:, 2],
    )
    return Recording(
        background=background,
        start=pose,
        end=Pose(x, y, heading),
        end_t=count / 30,
        ticks=ticks,
        verdict=Verdict.TIME_LIMIT,
        sha256=_hash(f"line {background} {count}"),
        printed=tuple(TimedText(t, f"Light_left: {200 - 20 * t:.0f} {t}") for t in range(math.ceil(count / 30))),
        spoken=(TimedText(0.5, "off we go"), TimedText(count / 30 - 0.5, "still on the line")),
        datalog=tuple(DatalogEntry(float(t), "Light_left", 200.0 - t, float(t)) for t in range(math.ceil(count / 30))),
        image_log=(("left", ",".join(["255"] * 1600), 30),),
        pen=((30, True), (200, False)),
    )


def line_follower_grade(count: int = 300, **changes: object) -> Grade:
    recording = line_follower_recording(count)
    touching = replace(
        recording,
        obstacles=((420.0, 640.0, 120.0, 90.0),),
        touches=(Touch(4.0, "obstacle", Pose(560.0, 690.0, 100.0)),),
    )
    return _grade(
        assignment="line-follower",
        assignment_title="Follow the line",
        trials=(
            TrialResult("plain", 0, 11, 0.0, 0.0, "visible", recording),
            TrialResult("with-obstacle", 0, 12, 10.0, 20.0, "visible", touching),
        ),
        criteria=(
            CriterionResult(
                "stays-near", "Stays near the line", Decimal("3.5"), Decimal(5),
                "The robot was within 40 mm of the line for 81 % of the way; 95 % was asked for.",
                evidence=(Evidence(0, True, "95 %"), Evidence(1, False, "61 %", 4.0, Pose(560, 690, 100))),
            ),
            CriterionResult("speaks", "Says when it starts", Decimal(1), Decimal(1), "It said “off we go” at 0.50 s."),
        ),
        **changes,
    )  # fmt: skip


def shape_grade(wrong: int = 4, **changes: object) -> Grade:
    """Return six trials, one per shape. The shape at index ``wrong`` is answered as a diamond."""
    trials = tuple(_shape_trial(index, wrong) for index in range(6))
    predictions = tuple(
        Prediction(trial.recording.images[0], SHAPES[index], "diamond" if index == wrong else SHAPES[index],
              trial.scenario, index)
        for index, trial in enumerate(trials)
    )  # fmt: skip
    confusion = tuple((prediction.truth, prediction.answer, 1) for prediction in predictions)
    right = sum(prediction.truth == prediction.answer for prediction in predictions)
    accuracy = Accuracy(right / 6, 0.4365, 0.9699, 6, SHAPES, confusion)
    return _grade(
        assignment="shape-recognition",
        assignment_title="Recognise a shape",
        trials=trials,
        criteria=(
            CriterionResult(
                "names-the-right-shape", "Names the right shape", Decimal(right), Decimal(6),
                f"{right} of 6 images were identified correctly; the {SHAPES[wrong]} was identified as a diamond.",
                evidence=tuple(Evidence(index, index != wrong, "") for index in range(6)),
                accuracy=accuracy, predictions=predictions,
            ),
            CriterionResult(
                "asks-aloud", "Asks “Is that a …” aloud", Decimal(2), Decimal(2), "It asked every time.",
                for_staff="SECRETDOUBT",
            ),
        ),
        **changes,
    )  # fmt: skip


def swept_grade() -> Grade:
    """Return a shape grade with trials swept over light noise, and all measures of recognition."""
    grade = shape_grade()
    trials = tuple(
        replace(trial, sweep=(("light_noise", float(32 * index)),), light_noise=32.0 * index)
        for index, trial in enumerate(grade.trials)
    )
    levels = tuple(Level(32.0 * index, int(index != 4), 1, 0.2, 0.9) for index in range(6))
    first = grade.criteria[0]
    assert first.accuracy is not None
    accuracy = replace(first.accuracy, counts=Counts(7, 5, 1, 0, 1, 2, 6, 0), confidence=Confidence(0.9, 5, None, 0))
    result = replace(first, accuracy=accuracy, curves=(AccuracyCurve("light_noise", levels, 0.8),))
    return replace(grade, trials=trials, criteria=(result, *grade.criteria[1:]))


#: The possible effects of a channel on messages.
ASTRAY = (
    Message(0.1, "robot", "PY::0", None, None, "lost", "chance"),
    Message(0.2, "robot", "PY::0", None, None, "lost", "out of range", 1600.2, 3.0),
    Message(0.3, "robot", "PY::0", None, None, "lost", "facing away", 300.0, -90.4),
    Message(0.4, "robot", "PY::0", None, None, "lost", "blocked", 300.0, 0.0),
    Message(0.5, "robot", "PY::0", 0.5, None, "duplicated", arrived_as="PY::7"),
    Message(0.6, "responder", "saw 7", None, 4, "lost", "facing away", 300.0, 120.0),
)


def faulty_grade() -> Grade:
    """Return a grade of a program that fails in line 3, after two messages: one answer is lost, one is never sent."""
    return _make_faulty_grade()


@cache
def _make_faulty_grade() -> Grade:
    recording = line_follower_recording(45)
    faults = (
        Fault(0.4, Verdict.RESPONDER_ERROR, "responder", "NameError: name 'pasrer' is not defined", 2,
              "Did you mean parser?"),
        Fault(1.5, Verdict.PROGRAM_ERROR, "program", "ZeroDivisionError: division by zero", 3),
    )  # fmt: skip
    messages = (
        Message(0.1, "robot", "PY::0", 0.1),
        Message(0.2, "responder", "Python saw >> 0 << that...", None, 0, "lost"),
        Message(0.4, "robot", "PY::1", 0.4),
        Message(0.6, "robot", "PY::2", None, None, "lost"),
    )
    broken = replace(recording, verdict=Verdict.RESPONDER_ERROR, faults=faults, messages=messages)
    good = replace(recording, verdict=Verdict.FINISHED, sha256=_hash("good"))
    return _grade(
        assignment="echo-responder",
        assignment_title="Echo",
        trials=(
            TrialResult("quiet", 0, 1, 0, 0, "visible", good),
            TrialResult("talk", 0, 2, 0, 0, "visible", broken),
            TrialResult("talk", 1, 3, 0, 0, "visible", replace(broken, sha256=_hash("again"))),
        ),
        criteria=(
            CriterionResult("echoes", "Echoes every message", Decimal(0), Decimal(4), "No answer arrived.",
                            evidence=(Evidence(1, False, ""), Evidence(2, False, ""))),
        ),
    )  # fmt: skip


def astray_grade() -> Grade:
    """Return the faulty grade with every possible effect of a channel on its messages."""
    grade = faulty_grade()
    talk = [replace(trial, recording=replace(trial.recording, messages=ASTRAY)) for trial in grade.trials[1:2]]
    return replace(grade, trials=(grade.trials[0], *talk))


def faulty_submission() -> Submission:
    return Submission(
        "s1234567",
        program=SourceFile("robot.py", "import time\nfor i in range(3):\n    print(1 / (i - i))\n    time.sleep(1)\n"),
        responder=SourceFile("responder.py", "def echo_responder(msg_object):\n    return pasrer(msg_object)\n"),
    )


def hidden_grade() -> Grade:
    """Return a shape grade with two trials, the last ones, and one criterion hidden from the student."""
    grade = shape_grade()
    secret = CriterionResult(
        "secret-check", "SECRETCRITERION", Decimal(1), Decimal(3), "SECRETMESSAGE", "hidden", (Evidence(0, False, ""),)
    )
    trials = tuple(
        replace(trial, scenario="SECRETSCENARIO", visibility="hidden") if index >= 4 else trial
        for index, trial in enumerate(grade.trials)
    )
    accuracy = grade.accuracy
    assert accuracy is not None
    of_four = replace(accuracy, n=4, value=1.0, confusion=tuple((name, name, 1) for name in SHAPES[:4]))
    criteria = tuple(
        replace(result, shown=VisibleFeedback(f"VISIBLE: {result.title}", of_four)) for result in grade.criteria
    )
    return replace(grade, trials=trials, criteria=(*criteria, secret))


def hostile_grade() -> Grade:
    """Return a grade in which every text that a student can influence is hostile, and some texts are very long."""
    grade = shape_grade()
    recording = grade.trials[0].recording
    endless = "W" * 200_000
    poisoned = replace(
        recording,
        verdict=Verdict.PROGRAM_ERROR,
        printed=(TimedText(0.1, HOSTILE), TimedText(0.2, endless), *(TimedText(0.3, f"line {i}") for i in range(3000))),
        spoken=(TimedText(0.1, HOSTILE), TimedText(0.2, "a" + "\u0301" * 5000)),
        messages=tuple(
            message
            for index in range(0, 60, 2)
            for message in (
                Message(index / 10, "robot", "PY::" + HOSTILE, index / 10),
                Message(index / 10, "responder", HOSTILE + endless, index / 10 + 0.1, index, HOSTILE),
            )
        ),
        calls=(Call(0, 1, HOSTILE, HOSTILE, HOSTILE, HOSTILE),),
        faults=(Fault(0.1, Verdict.PROGRAM_ERROR, "program", HOSTILE, 2, HOSTILE),),
        responder_output=HOSTILE * 1000,
        responder_log=HOSTILE,
        notes=(HOSTILE,),
    )
    trials = (replace(grade.trials[0], recording=poisoned), *grade.trials[1:])
    criteria = tuple(replace(result, title=HOSTILE, message=HOSTILE) for result in grade.criteria)
    predictions = tuple(replace(prediction, answer=HOSTILE) for prediction in grade.criteria[0].predictions)
    accuracy = grade.accuracy
    assert accuracy is not None
    confusion = tuple((truth, HOSTILE, count) for truth, _, count in accuracy.confusion)
    first = replace(criteria[0], predictions=predictions, accuracy=replace(accuracy, confusion=confusion))
    return replace(
        grade, student=HOSTILE, assignment_title=HOSTILE, notes=(HOSTILE,), trials=trials,
        criteria=(first, *criteria[1:]),
    )  # fmt: skip


def _shape_trial(index: int, wrong: int) -> TrialResult:
    pose = Pose(200.0 + 80 * index, 900.0, 0.0)
    pixels = build_floor("Simple_Shapes").pixels
    left, right = (_rgba(_sensor(pixels, pose, side)) for side in (-20, 20))
    answer = "diamond" if index == wrong else SHAPES[index]
    image = Image(0.0, 0, pose, left, right, 0, SHAPES[index])
    count = 94
    still = np.ones(count)
    sums = [_sensor(pixels, pose, side)[MASK].sum(axis=0) for side in (-20, 20)]
    ticks = Ticks(
        x=pose.x * still,
        y=pose.y * still,
        heading=pose.heading * still,
        left_position=0 * still,
        right_position=0 * still,
        left_sums=np.tile(sums[0], (count, 1)).astype(np.int64),
        right_sums=np.tile(sums[1], (count, 1)).astype(np.int64),
        ultrasonic=2142 * still,
        gyro=0 * still,
    )
    text = json.dumps({"message": {"report": f"Agent says: I saw {answer}", "shape": answer}})
    csv = ",".join(map(str, left))
    recording = Recording(
        background="Simple_Shapes",
        start=pose,
        end=pose,
        end_t=count / 30,
        ticks=ticks,
        verdict=Verdict.FINISHED,
        sha256=_hash(f"shape {index}"),
        printed=(TimedText(0.0, "IMG_DATA"), TimedText(0.13, "JSON::" + text), TimedText(1.0,
            "{'messages': [" + text + "]}")),
        spoken=(TimedText(1.0, f"Is that a {answer}"),),
        messages=(
            Message(0.0, "robot", "IMG_DATA::" + json.dumps({"left": csv, "right": csv}), 0.0),
            Message(0.0, "responder", "JSON::" + text, 4 / 30, 0),
        ),
        images=(image,),
        calls=(
            Call(0, 0, "responder", "parser", "'IMG_DATA::{\"left\": \"245,226…", "{'typ': 'IMG_DATA', 'obj': {…}}"),
            Call(0, 1, "agent", "MLP", "array(1, 196)", f"array([{index}])"),
            Call(0, 0, "responder", "agent", "{'typ': 'IMG_DATA', 'obj': {…}}", "{'report': 'Agent says: …'}"),
            Call(0, 0, "responder", "logger", "'IMG_DATA::…', 'JSON::…'", "None"),
        ),
        responder_log="Received message: IMG_DATA\nResponse: JSON::...\n---\n",
    )  # fmt: skip
    return TrialResult("each-shape", index, 1000 + index, 0.0, 0.0, "visible", recording)


def _sensor(pixels: np.ndarray, pose: Pose, offset: float) -> np.ndarray:
    """Return the 20 x 20 pixels under a light sensor ``offset`` mm to the right of the middle and 30 mm in front."""
    angle = math.radians(pose.heading - 90)
    x = pose.x + math.cos(angle) * offset - math.sin(angle) * 30
    y = pose.y + math.sin(angle) * offset + math.cos(angle) * 30
    window = np.zeros((20, 20, 3), dtype=np.int64)
    top, left = int(1143 - y - 10), int(x - 10)
    part = pixels[max(0, top) : max(0, top + 20), max(0, left) : max(0, left + 20)]
    window[: part.shape[0], : part.shape[1]] = part
    return window


def _rgba(window: np.ndarray) -> bytes:
    pixels = np.where(MASK[:, :, None], window, np.array([245, 226, 225])).astype(np.uint8)
    return np.dstack((pixels, np.full((20, 20), 255, dtype=np.uint8))).tobytes()


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _grade(**fields: object) -> Grade:
    defaults: dict[str, object] = {
        "assignment_version": _hash("assignment"),
        "submission": _hash("submission"),
        "student": "s1234567",
        "sandbox": "process limits only",
        "grader_version": "0.1.0",
    }
    return Grade(**{**defaults, **fields})  # type: ignore[arg-type]
