"""Behaviour of unmodified RoboLab: every figure of its golden runs that this simulator reproduces."""

from __future__ import annotations

import tomllib
from typing import Any

import pytest

from paths import DATA
from running import run_program
from service.grading.trial_runner import TrialRunner
from sim.arena import Arena
from sim.camera import CachedCamera
from sim.floors import build_floor
from sim.recording import Pose
from sim.robot import get_robot
from sim.world import HashChain, Noise, World

pytestmark = pytest.mark.fast

GOLDEN: dict[str, list[dict[str, Any]]] = tomllib.loads((DATA / "original_simulator.toml").read_text())


@pytest.mark.parametrize("row", GOLDEN["drive"], ids=lambda row: row["program"].replace("\n", "; "))
def test_drive(runner: TrialRunner, row: dict[str, Any]) -> None:
    recording = run_program(runner, row["program"], Pose(*row["start"]))
    x, y, heading = row["end"]
    assert recording.end.x == pytest.approx(x, abs=0.01)
    assert recording.end.y == pytest.approx(y, abs=0.01)
    assert recording.end.heading == pytest.approx(heading, abs=0.01)
    assert abs(len(recording.ticks) - row["milliseconds"] * 30 / 1000) <= 1
    if "encoders" in row:
        left, right = row["encoders"]
        assert recording.ticks.left_position[-1] == pytest.approx(left, abs=0.01)
        assert recording.ticks.right_position[-1] == pytest.approx(right, abs=0.01)


@pytest.mark.parametrize("row", GOLDEN["light"], ids=lambda row: f"{row['background']} {row['pose']}")
def test_light_sensors(row: dict[str, Any]) -> None:
    ground = build_floor(row["background"])
    arena, camera = Arena(), CachedCamera(ground.pixels)
    try:
        world = World(get_robot("Default_Robot"), arena, camera, Pose(*row["pose"]), Noise(), 0, HashChain())
        for means, expected in ((world.left_means, row["left"]), (world.right_means, row["right"])):
            assert means == pytest.approx(expected, abs=row.get("tolerance", 0.0001))
    finally:
        camera.close()
        arena.close()


@pytest.mark.parametrize("row", GOLDEN["ultrasonic"], ids=lambda row: str(row["pose"]))
def test_ultrasonic(row: dict[str, Any]) -> None:
    import math

    arena = Arena(tuple(tuple(box) for box in row.get("obstacles", [])))
    try:
        x, y, heading = row["pose"]
        assert arena.measure_distance(x, y, math.radians(heading), 20) == row["distance"]
    finally:
        arena.close()
