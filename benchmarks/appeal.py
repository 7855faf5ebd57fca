"""All trials of the pool of a noisy line follower, as an appeal runs them in one worker.

It measures real time, so run it on an idle machine: ``python -m benchmarks appeal``.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from benchmarks.measurement import SECONDS, Measurement, measure_wall_seconds
from responders.source_file import SourceFile
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from submissions.assignment.reader import read_assignment
from submissions.submission import Submission

_TRIALS = 200
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
pool = {_TRIALS}
trials = {{ least = 4, most = 40 }}
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
bands = [[0.2, 2], [0.45, 4]]
"""
_PROGRAM = """\
from ev3dev2.motor import MoveTank, OUTPUT_B, OUTPUT_C, SpeedPercent
from ev3dev2.sensor import INPUT_2, INPUT_3
from ev3dev2.sensor.lego import ColorSensor
tank = MoveTank(OUTPUT_B, OUTPUT_C)
left, right = ColorSensor(INPUT_2), ColorSensor(INPUT_3)
while True:
    steering = 0.4 * (left.reflected_light_intensity_pc - right.reflected_light_intensity_pc)
    tank.on(SpeedPercent(10 + steering), SpeedPercent(10 - steering))
"""


def measure(_times: int) -> list[Measurement]:
    """Measure one grading of all trials, with its CPU time in all processes."""
    with tempfile.TemporaryDirectory() as folder, TrialRunner() as runner:
        (Path(folder) / "assignment.toml").write_text(_ASSIGNMENT)
        assignment = read_assignment(Path(folder))
        submission = Submission("ada", SourceFile("robot.py", _PROGRAM), None)
        cpu_before = time.process_time() + runner.children_cpu_seconds
        seconds = measure_wall_seconds(lambda: grade(submission, assignment, runner=runner))
        cpu_seconds = time.process_time() + runner.children_cpu_seconds - cpu_before
    title = f"appeal: all {_TRIALS} trials of a noisy line follower"
    return [Measurement(title, seconds, SECONDS, 30, details=f"CPU {cpu_seconds:.1f} s")]
