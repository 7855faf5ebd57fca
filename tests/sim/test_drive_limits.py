"""No frame from a robot program makes a motor exceed a real motor's limits."""

from __future__ import annotations

import pytest

from running import run_program
from service.grading.trial_runner import TrialRunner
from sim.recording import Pose

_TELL = """
import time
from brick_link import link
for port in ("outB", "outC"):
    link.set_motor(port, %s)
time.sleep(6)
"""


@pytest.mark.parametrize(
    "words",
    [
        'polarity="inversed", speed_sp=-1e300, command="run-forever"',
        'speed_sp=1e300, command="run-forever"',
        'speed_sp=-1e300, time_sp=1e300, command="run-timed"',
        'speed_sp=1e300, position_sp=1e300, command="run-to-rel-pos"',
        'speed_sp=-1e300, position_sp=-1e300, position=1e300, command="run-to-abs-pos"',
    ],
)
def test_no_motor_is_faster_than_motors_are(runner: TrialRunner, words: str) -> None:
    recording = run_program(runner, _TELL % words, Pose(1000, 500, 0))
    way = abs(recording.end.x - 1000)
    # 1050 degrees a second on wheels of 56 mm
    assert way <= 6 * 1050 * 56 * 3.1416 / 360
    assert (recording.end.y, recording.end.heading) == (500, 0)
