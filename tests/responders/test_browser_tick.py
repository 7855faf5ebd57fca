"""Ticks of 33 ms, as in the original's browser: slightly more per second, with the same distance per tick."""

from __future__ import annotations

import numpy as np
import pytest

from responders.source_file import SourceFile
from running import run_program
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.store.grades.recordings import from_bytes, to_bytes
from sim.recording import BROWSER_TICK, TICK, Pose, Recording, Verdict
from sim.recording_values import count_ticks_until, tick_to_seconds
from submissions.assignment.definition import Assignment, Parts, Scenario, WorldSpec
from submissions.submission import Submission

START = Pose(100, 800, 0)
DRIVE = "import time\ntank_drive.on(50, 50)\ntime.sleep(6.6)\nprint(get_clock())\n"


def run(runner: TrialRunner, program: str, tick: int = BROWSER_TICK) -> Recording:
    return run_program(runner, f"from ev3dev2_glue import get_clock\n{program}", START, tick=tick)


def test_the_clock_counts_ticks_and_the_robot_gets_farther(runner: TrialRunner) -> None:
    exact, browser = run(runner, DRIVE, TICK), run(runner, DRIVE)
    assert (len(exact.ticks), len(browser.ticks)) == (198, 200)
    assert [exact.printed[0].text, browser.printed[0].text] == ["6.6", str(200 / 30)]
    assert exact.end_t == browser.end_t == 6.6
    assert browser.end.x - exact.end.x == pytest.approx(2 * 525 / 30 * np.pi * 56 / 360)
    assert np.array_equal(exact.ticks.x, browser.ticks.x[:198])
    assert exact.ticks.t.tolist() == [tick / 30 for tick in range(1, 199)]
    assert browser.ticks.t.tolist() == [tick * 33 / 1000 for tick in range(1, 201)]


def test_program_and_world_agree_on_when_a_value_is_new(runner: TrialRunner) -> None:
    program = "seen = []\nwhile get_clock() < 3:\n    seen.append(gyro.angle_and_rate[0])\nprint(len(seen))\n"
    recording = run(runner, f"tank_turn.on(100, 20)\n{program}")
    # 90 ticks of 33 ms, a reading every 10 ms; the last reading ends with the tick.
    assert recording.printed[0].text == "297"
    assert recording.end_t == pytest.approx(2.97)
    assert recording.sha256 == run(runner, f"tank_turn.on(100, 20)\n{program}").sha256


@pytest.mark.long
@pytest.mark.parametrize("tick", [TICK, BROWSER_TICK])
@pytest.mark.parametrize("seconds", [1, 1.02, 1.025])
@pytest.mark.parametrize(
    ("reads", "deed"),
    [(120, "gyro.angle"), (200, "colorLeft.reflected_light_intensity"), (200, "ultrasonic.distance_centimeters")],
)
def test_no_read_ends_after_the_time_limit(
    runner: TrialRunner, tick: int, seconds: float, reads: int, deed: str
) -> None:
    """A read that ends between two ticks costs its time, and the time limit applies to it."""
    allowed = {count: run_until(runner, count, deed, tick, seconds) for count in (10, reads)}
    assert (allowed[10].verdict, allowed[reads].verdict) == (Verdict.FINISHED, Verdict.TIME_LIMIT)
    assert allowed[reads].end_t == pytest.approx(seconds)
    cost = allowed[10].end_t / 10
    most = int(seconds / cost + 1e-6)
    assert run_until(runner, most, deed, tick, seconds).verdict is Verdict.FINISHED
    assert run_until(runner, most + 1, deed, tick, seconds).verdict is Verdict.TIME_LIMIT


def run_until(runner: TrialRunner, reads: int, deed: str, tick: int, seconds: float) -> Recording:
    return run_program(runner, f"for _ in range({reads}):\n    {deed}\n", START, tick=tick, seconds=seconds)


def test_a_stored_recording_keeps_its_tick(runner: TrialRunner) -> None:
    recording = from_bytes(to_bytes(run(runner, DRIVE)))
    assert recording.ticks.length == BROWSER_TICK
    assert [count_ticks_until(recording, tick_to_seconds(recording, tick)) for tick in range(201)] == list(range(201))


def test_an_assignment_may_want_it(runner: TrialRunner) -> None:
    scenario = Scenario("one", (START,), seconds=10)
    ends = []
    for world in (WorldSpec(), WorldSpec(tick="browser")):
        assignment = Assignment("a", "A", world, Parts("student", "none"), (scenario,), ())
        submission = Submission(
            "ada", program=SourceFile("robot.py", "import time\ntank_drive.on(50, 50)\ntime.sleep(6.6)\n")
        )
        ends.append(grade(submission, assignment, runner=runner).trials[0].recording.end.x)
    assert ends[1] - ends[0] == pytest.approx(2 * 525 / 30 * np.pi * 56 / 360)
