"""Optional worlds of an assignment: walls and obstacles that stop the robot, and wheels that roll in Bullet."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Sequence
from itertools import pairwise

import pytest

from rows import quick_first
from running import run_program
from service.grading.trial_runner import TrialRunner
from sim.arena import Arena
from sim.motion import FreeMotion, Physics, SolidMotion
from sim.recording import Pose
from sim.rigid_wheels import RigidWheels
from sim.robot import Robot, get_robot

SOLID, WHEELS, BOTH = Physics(solid=True), Physics(drive="wheels"), Physics(solid=True, drive="wheels")
POST = (900.0, 500.0, 200.0, 200.0)
AHEAD = """
from ev3dev2.motor import MoveTank, SpeedPercent, OUTPUT_B, OUTPUT_C
tank = MoveTank(OUTPUT_B, OUTPUT_C)
tank.on_for_seconds(SpeedPercent(40), SpeedPercent(40), 6)
"""
ROUND = """
from ev3dev2.motor import MoveTank, SpeedPercent, OUTPUT_B, OUTPUT_C
tank = MoveTank(OUTPUT_B, OUTPUT_C)
for left, right, seconds in [(30, 40, 2), (40, 10, 1.5), (-20, 20, 1), (35, 35, 2)]:
    tank.on_for_seconds(SpeedPercent(left), SpeedPercent(right), seconds)
"""


@pytest.mark.parametrize("speed", [2.0, 9.5, 16.7])
@pytest.mark.parametrize("start", [2250.0, 2251.3, 2257.7])
def test_a_wall_holds_the_body_at_any_speed(start: float, speed: float) -> None:
    motion = SolidMotion(get_robot("Default_Robot"), ())
    x, y, heading = start, 500.0, 0.0
    reached = []
    for _ in range(90):
        x, y, turned = motion.compute_move(x, y, heading, speed, speed)
        heading += turned
        reached.append(x + 45)
    motion.close()
    assert max(reached) < 2362 + 1
    assert reached[-1] == pytest.approx(2362, abs=0.5)
    assert (y, heading) == pytest.approx((500, 0), abs=0.3)


@pytest.mark.parametrize(("facing", "ends_facing"), [(45, 0), (60, 0), (80, 82)])
def test_an_oblique_robot_slides_along_the_wall_and_stays_out_of_it(facing: float, ends_facing: float) -> None:
    motion = SolidMotion(get_robot("Default_Robot"), ())
    x, y, heading = 2150.0, 200.0, math.radians(facing)
    deepest = 0.0
    for _ in range(140):
        x, y, turned = motion.compute_move(x, y, heading, 5, 5)
        heading += turned
        corners = (x + a * math.cos(heading) - b * math.sin(heading) for a in (45, -120) for b in (100, -100))
        deepest = max(deepest, *corners)
    motion.close()
    assert deepest < 2362 + 1
    assert y > 350
    assert math.degrees(heading) == pytest.approx(ends_facing, abs=2)


def test_the_post_stops_the_robot_and_the_wheels_slip(runner: TrialRunner) -> None:
    solid = run_program(runner, AHEAD, Pose(500, 600, 0), obstacles=(POST,), physics=SOLID)
    free = run_program(runner, AHEAD, Pose(500, 600, 0), obstacles=(POST,))
    assert solid.end.x == pytest.approx(855, abs=1)
    assert free.end.x > 1300
    assert solid.ticks.left_position[-1] == free.ticks.left_position[-1]
    assert [touch.what for touch in solid.touches] == ["obstacle 1"]
    assert solid.touches[0].pose.x == pytest.approx(855, abs=1.5)


def test_the_gyro_feels_what_the_wall_does(runner: TrialRunner) -> None:
    ended = run_program(runner, AHEAD, Pose(2150, 300, 70), physics=SOLID)
    assert abs(ended.end.heading - 70) > 10
    assert ended.ticks.gyro[-1] == pytest.approx(70 - ended.end.heading, abs=1e-6)


def test_away_from_walls_solid_changes_no_bit(runner: TrialRunner) -> None:
    assert (
        run_program(runner, ROUND, Pose(900, 500, 0), physics=SOLID).sha256
        == run_program(runner, ROUND, Pose(900, 500, 0)).sha256
    )


@pytest.mark.parametrize("physics", quick_first([SOLID, WHEELS, BOTH]))
def test_what_ran_before_leaves_no_trace(physics: Physics, runner: TrialRunner) -> None:
    def hashes(own: TrialRunner, starts: Sequence[Pose]) -> dict[Pose, str]:
        return {
            start: run_program(own, AHEAD, start, obstacles=(POST,), physics=physics, seconds=8).sha256
            for start in starts
        }

    starts = [Pose(600, 610, 0), Pose(2200, 300, 60), Pose(700, 450, 20), Pose(300, 1000, 100)]
    with TrialRunner() as fresh:
        assert hashes(runner, starts) == hashes(fresh, starts[::-1])


def random_drive(seed: int) -> Iterator[tuple[float, float]]:
    """Yield wheel speeds in degrees per second, with new targets each half second for a minute, and motor ramps."""
    chance = random.Random(seed)
    speeds, targets = [0.0, 0.0], [0.0, 0.0]
    for tick in range(1800):
        if tick % 15 == 0:
            targets = [chance.uniform(-50, 400), chance.uniform(-50, 400)]
        speeds = [s + max(-27.8, min(27.8, target - s)) for s, target in zip(speeds, targets, strict=True)]
        yield speeds[0], speeds[1]


@pytest.mark.long
@pytest.mark.parametrize("name", ["Default_Robot", "Small_Robot"])
@pytest.mark.parametrize("seed", [1, 2])
def test_rigid_wheels_stay_within_a_fifth_of_a_percent_of_the_path(name: str, seed: int) -> None:
    driven = get_robot(name)
    rigid = RigidWheels(driven)
    rigid.place(300, 500, 0)
    real, ideal = follow(rigid, driven, seed), follow(FreeMotion(driven), driven, seed)
    rigid.close()
    path = sum(math.dist(a, b) for a, b in pairwise(ideal))
    assert max(math.dist(a, b) for a, b in zip(real, ideal, strict=True)) < 0.002 * path
    assert real != ideal


def follow(motion: FreeMotion | RigidWheels, driven: Robot, seed: int) -> list[tuple[float, float]]:
    mm_per_tick = math.pi * driven.wheel_diameter / 360 / 30
    x, y, heading = 300.0, 500.0, 0.0
    places = [(x, y)]
    for left, right in random_drive(seed):
        x, y, turned = motion.compute_move(x, y, heading, left * mm_per_tick, right * mm_per_tick)
        heading += turned
        places.append((x, y))
    return places


def test_rigid_wheels_are_held_by_solid_walls_alone(runner: TrialRunner) -> None:
    start = Pose(600, 600, 0)
    assert run_program(runner, AHEAD, start, obstacles=(POST,), physics=BOTH).end.x == pytest.approx(855, abs=3)
    assert run_program(runner, AHEAD, start, obstacles=(POST,), physics=WHEELS).end.x > 1300


def test_an_arena_gives_each_physics_its_own_motion() -> None:
    arena = Arena((POST,))
    kinds = {
        type(arena.place_motion(get_robot("Default_Robot"), physics, 100, 100, 0))
        for physics in (Physics(), SOLID, WHEELS, BOTH)
    }
    arena.close()
    assert kinds == {FreeMotion, SolidMotion, RigidWheels}
