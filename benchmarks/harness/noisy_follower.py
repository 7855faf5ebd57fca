"""A noisy line follower, and an assignment whose marks are defined over a pool of 200 of its runs.

The program passes about as often as the boundary for full marks demands, so few trials do not decide its marks. With
the worlds of ``SECRET``, 89 of 200 trials pass, and 90 are needed.
"""

from __future__ import annotations

from pathlib import Path

from responders.source_file import SourceFile
from submissions.assignment.definition import Assignment
from submissions.assignment.reader import read_assignment
from submissions.grading_request import GradingRequest
from submissions.submission import Submission

POOL = 200
MOST = 40
SECRET = "worlds of the noisy follower"
BOUNDARY = 0.45
_ASSIGNMENT = f"""
id = "noisy-follower"
title = "Follow a line with noisy sensors"
[world]
background = "Line_Following_Test"
[parts]
responder = "none"
[[scenario]]
id = "line"
poses = [[141, 125, 90]]
pool = {POOL}
trials = {{ least = 4, most = {MOST} }}
light_noise = 40
motor_noise = 115
seconds = 6
visibility = "hidden"
[[criterion]]
id = "follows"
title = "Follows the line"
marks = 4
check = "follows"
line = {{ on = "Line_Following_Test/141" }}
within = 15
covers = 0.05
at_most = 20
bands = [[0.2, 2], [{BOUNDARY}, 4]]
"""
PROGRAM = """\
from ev3dev2.motor import MoveTank, OUTPUT_B, OUTPUT_C, SpeedPercent
from ev3dev2.sensor import INPUT_2, INPUT_3
from ev3dev2.sensor.lego import ColorSensor
tank = MoveTank(OUTPUT_B, OUTPUT_C)
left, right = ColorSensor(INPUT_2), ColorSensor(INPUT_3)
while True:
    steering = 0.4 * (left.reflected_light_intensity_pc - right.reflected_light_intensity_pc)
    tank.on(SpeedPercent(10 + steering), SpeedPercent(10 - steering))
"""


def write_assignment(folder: Path) -> Assignment:
    """Write the assignment into a new folder, and return it."""
    folder.mkdir()
    (folder / "assignment.toml").write_text(_ASSIGNMENT)
    return read_assignment(folder)


def build_request(assignment: Assignment, student: str, program: str = PROGRAM) -> GradingRequest:
    """Return a submission of the program."""
    return GradingRequest(Submission(student, SourceFile("robot.py", program), None), assignment, f"{student}.zip")


def list_variants(count: int) -> list[str]:
    """Return variants of the program that differ in white space only."""
    return ["\n" * (number // 5) + PROGRAM.replace("\n", " " * (number % 5) + "\n") for number in range(count)]
