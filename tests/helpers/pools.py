"""A small assignment with a pool, and a program whose success depends on chance."""

from __future__ import annotations

from pathlib import Path

from responders.source_file import SourceFile
from submissions.assignment.definition import Assignment
from submissions.assignment.reader import read_assignment
from submissions.grading_request import GradingRequest
from submissions.submission import Submission

ASSIGNMENT = """
id = "short-pool"
title = "Drive a little with noise"
[parts]
responder = "none"
[[scenario]]
id = "noisy"
poses = [[500, 500, 0]]
pool = 30
trials = { least = 2, most = 6 }
motor_noise = 400
seconds = 3
visibility = "hidden"
[[criterion]]
id = "far"
title = "Drives far enough"
marks = 4
check = "displacement"
distance = [75, 1000]
bands = [[0.5, 2], [0.7, 4]]
"""
#: Drives 75 mm in about three of four trials.
LUCKY = """
from ev3dev2.motor import MoveTank, OUTPUT_B, OUTPUT_C, SpeedPercent
tank = MoveTank(OUTPUT_B, OUTPUT_C)
tank.on_for_seconds(SpeedPercent(50), SpeedPercent(50), 0.5)
"""


def pool_assignment(folder: Path, text: str = ASSIGNMENT) -> Assignment:
    folder.mkdir(exist_ok=True)
    (folder / "assignment.toml").write_text(text)
    return read_assignment(folder)


def pool_request(assignment: Assignment, student: str = "ada", program: str = LUCKY) -> GradingRequest:
    return GradingRequest(Submission(student, SourceFile("robot.py", program), None), assignment, f"{student}.zip")
