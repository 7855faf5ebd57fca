"""Noise of light sensors and wheels: mean and spread follow the original's formulas, and a seed is reproducible."""

from __future__ import annotations

import math

import numpy as np
import pytest

from responders.source_file import SourceFile
from running import run_program
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from sim.camera import CachedCamera
from sim.light_sensors import Footprint, LightReader
from sim.random_streams import RandomStream
from sim.recording import Pose
from sim.robot import LightSensor
from sim.world import Noise
from submissions.assignment.reader import find_assignment
from submissions.submission import Submission

TICKS = 200
AHEAD = "tank_drive.on_for_seconds(50, 50, 20)"
BACK = "tank_drive.on_for_seconds(-50, -50, 20)"
STILL = "tank_drive.on_for_seconds(0, 0, 20)"


def expected_pixel(value: int, amplitude: float) -> tuple[float, float]:
    """Return mean and spread of clamp(round(value + U(-N, N)), 0, 255), calculated from the formula."""
    drawn = np.clip(np.floor(value + np.linspace(-amplitude, amplitude, 2_000_001) + 0.5), 0, 255)
    return float(drawn.mean()), float(drawn.std())


def pixels(value: int, amplitude: float, seed: int) -> np.ndarray:
    """Return the readings of a left sensor's 305 pixels over a plain floor, shape (ticks, 305, 3)."""
    camera = CachedCamera(np.full((1143, 2362, 3), value, np.uint8))
    reader = LightReader(LightSensor(-20, 30), camera, amplitude, RandomStream(seed, "left light"))
    where = Footprint(500, 500, 510, 633)
    seen = [
        np.frombuffer(reader.render_image(where, tick), np.uint8).reshape(20, 20, 4) for tick in range(1, TICKS + 1)
    ]
    camera.close()
    rows, columns = np.mgrid[0:20, 0:20]
    inside = (rows - 10) ** 2 + (columns - 10) ** 2 < 100
    return np.stack([image[inside][:, :3] for image in seen])


@pytest.mark.parametrize("amplitude", [10, 64, 128])
@pytest.mark.parametrize("value", [0, 128, 255])
def test_each_pixel_has_the_mean_and_the_spread_of_the_formula(value: int, amplitude: float) -> None:
    drawn = pixels(value, amplitude, 3)
    mean, spread = expected_pixel(value, amplitude)
    of_the_mean = 5 * spread / math.sqrt(drawn.size)
    assert drawn.mean() == pytest.approx(mean, abs=of_the_mean)
    assert drawn.std() == pytest.approx(spread, rel=0.02)
    if value != 128:
        # The original's bias: 255 - N/4 on white, N/4 on black.
        assert mean == pytest.approx(abs(value - amplitude / 4), abs=0.3)
    assert drawn.mean(axis=(1, 2)).std() < spread / 15  # 915 draws a reading


def test_light_noise_is_the_same_for_a_seed_and_another_for_another() -> None:
    assert np.array_equal(pixels(128, 32, 3), pixels(128, 32, 3))
    assert not np.array_equal(pixels(128, 32, 3), pixels(128, 32, 4))


def speeds(runner: TrialRunner, program: str, amplitude: float, seed: int = 1) -> np.ndarray:
    """Return the left wheel's speed in degrees per second at each tick, after the first second."""
    recording = run_program(runner, program, Pose(1100, 500, 0), noise=Noise(motor=amplitude), seed=seed, seconds=30)
    return np.diff(recording.ticks.left_position)[30:590] * 30


def wavering(amplitude: float, ticks: int) -> np.ndarray:
    """Return the original's speed update: towards 525 by at most 27.8, noise, rounded and capped where positive."""
    chance = np.random.default_rng(1).uniform(-amplitude, amplitude, ticks)
    speed, most, drawn = 525.0, 5000 / 6 / 30, np.empty(ticks)
    for tick in range(ticks):
        speed += max(-most, min(most, 525 - speed))
        noisy = speed + chance[tick]
        if noisy >= 0:
            speed = min(math.floor(noisy + 0.5), 1050)
        drawn[tick] = speed
    return drawn


@pytest.mark.long
def test_a_noisy_wheel_wavers_about_its_speed_as_the_original_does(runner: TrialRunner) -> None:
    """Measured in the original with W = 100 at 525 degrees per second: 262 to 732, with a mean of 530."""
    drawn = np.concatenate([speeds(runner, AHEAD, 100, seed) for seed in range(20)])
    formula = wavering(100, 100_000)
    assert drawn.mean() == pytest.approx(formula.mean(), abs=20)
    assert drawn.std() == pytest.approx(formula.std(), rel=0.15)
    assert np.quantile(drawn, [0.02, 0.98]) == pytest.approx(np.quantile(formula, [0.02, 0.98]), abs=40)
    fast = drawn[drawn > 100]  # a speed that was negative is not whole
    assert fast == pytest.approx(np.round(fast), abs=1e-6)


def test_a_noisy_wheel_creeps_when_it_should_stand_and_is_exact_backwards(runner: TrialRunner) -> None:
    creeping = speeds(runner, STILL, 20)
    assert creeping.min() >= 0
    assert creeping.mean() > 1
    assert speeds(runner, BACK, 100) == pytest.approx(speeds(runner, BACK, 0), abs=1e-6)


def test_wheel_noise_is_the_same_for_a_seed_and_another_for_another(runner: TrialRunner) -> None:
    assert np.array_equal(speeds(runner, AHEAD, 50), speeds(runner, AHEAD, 50))
    assert not np.array_equal(speeds(runner, AHEAD, 50), speeds(runner, AHEAD, 50, seed=2))


#: Ways to turn wheels at negative speeds, where the original has no noise. The last three drive forwards.
BACKWARDS = {
    "timed": "tank_drive.on_for_seconds(-50, -50, 4)",
    "until told to stop": "import time\ntank_drive.on(-50, -50)\ntime.sleep(4)\ntank_drive.off()",
    "on a curve": "tank_turn.on_for_seconds(20, -50, 4)",
    "one motor after the other": """
from ev3dev2.motor import LargeMotor
for port in (OUTPUT_B, OUTPUT_C) * 5:
    LargeMotor(port).on_for_seconds(-40, 0.3)
""",
    "both motors reversed": """
tank_drive.left_motor.polarity = tank_drive.right_motor.polarity = "inversed"
tank_drive.on_for_seconds(-50, -50, 4)
""",
    "set points by hand": """
import time
from ev3dev2.motor import LargeMotor
for port in (OUTPUT_B, OUTPUT_C):
    LargeMotor(port).run_forever(polarity="inversed", speed_sp=-525)
time.sleep(4)
""",
    "a move to a place behind, at a negative speed": """
import time
from ev3dev2.motor import LargeMotor
for port in (OUTPUT_B, OUTPUT_C):
    LargeMotor(port).run_to_rel_pos(position_sp=-4000, speed_sp=-525)
time.sleep(4)
""",
}


@pytest.mark.long
@pytest.mark.parametrize("program", BACKWARDS.values(), ids=BACKWARDS)
def test_noise_in_both_directions_cannot_be_driven_round(runner: TrialRunner, program: str) -> None:
    def ends(noise: Noise) -> set[Pose]:
        start = Pose(1100, 500, 0)
        return {run_program(runner, program, start, noise=noise, seed=seed, seconds=10).end for seed in (1, 2, 3)}

    assert len(ends(Noise(motor=20))) == 1  # as in the original
    assert len(ends(Noise(motor=20, both_directions=True))) == 3
    assert ends(Noise(motor=0, both_directions=True)) == ends(Noise())


def test_noise_in_both_directions_is_the_same_forwards_and_mirrored_backwards(runner: TrialRunner) -> None:
    def of(program: str, *, both: bool) -> np.ndarray:
        noise = Noise(motor=20, both_directions=both)
        recordings = (
            run_program(runner, program, Pose(1100, 500, 0), noise=noise, seed=s, seconds=9) for s in range(6)
        )
        return np.concatenate([np.diff(each.ticks.left_position)[30:240] * 30 for each in recordings])

    ahead, back = of(AHEAD, both=True), of(BACK, both=True)
    assert np.array_equal(ahead, of(AHEAD, both=False))
    assert back.mean() == pytest.approx(-ahead.mean(), abs=20)
    assert back.std() == pytest.approx(ahead.std(), rel=0.3)
    assert of(STILL, both=True).mean() == pytest.approx(0, abs=5)  # no drift in either direction


@pytest.mark.parametrize("name", ["dead-reckoning-with-noise", "lollipop-with-noise"])
def test_in_the_catalogue_backwards_is_noisy(runner: TrialRunner, name: str) -> None:
    backwards = Submission("eve", SourceFile("robot.py", "tank_drive.on_for_seconds(-50, -50, 1)\n"))
    trials = grade(backwards, find_assignment(name), runner=runner).trials
    noisy = [trial.recording.end for trial in trials if trial.motor_noise]
    assert len(set(noisy)) == len(noisy)
