"""The simulator by itself, and through the two sandboxed processes: a line follower of 60 simulated seconds."""

from __future__ import annotations

import time

from benchmarks.measurement import Measurement, cpu_seconds, median_of
from responders.channel import Channel
from responders.code import Code
from responders.sandbox.running_child import ChildLimits
from responders.trial_spec import ProgramSpec, ResponderSpec, TrialSpec
from service.grading.trial_runner import TrialRunner
from sim.arena import Arena
from sim.camera import BulletCamera, CachedCamera, LightCamera
from sim.floors import floor
from sim.recording import Pose
from sim.robot import robot
from sim.world import Chain, Noise, World

_SECONDS = 60
_START = Pose(320, 500, 90)
_FLOOR = "Loop"
#: Stays at the edge of the loop for the whole minute.
_FOLLOWER = """
while True:
    turn = (colorLeft.reflected_light_intensity - 128) * 0.15
    colorRight.reflected_light_intensity
    tank_drive.on(25 - turn, 25 + turn)
"""
_LIMITS = ChildLimits(30, 512 << 20)


def measure() -> list[Measurement]:
    """Times real time, on one core, by CPU time."""
    pixels = floor(_FLOOR).pixels
    arena, cached, camera = Arena(), CachedCamera(pixels), BulletCamera(pixels)
    try:
        table = median_of(5, lambda: cpu_seconds(lambda: _follow(arena, cached)))
        shots = median_of(3, lambda: cpu_seconds(lambda: _follow(arena, camera)))
    finally:
        camera.close()
        cached.close()
        arena.close()
    with TrialRunner() as runner:
        both = median_of(5, lambda: _through_processes(runner))
        ready = median_of(20, lambda: _until_ready(runner))
    return [
        Measurement("simulator alone, 60 s line follower, sensor table", _times(table), "400x", "800x"),
        Measurement("the same, a PyBullet camera image each tick", _times(shots), "60x"),
        Measurement("the same through both sandboxed processes", _times(both), "100x", "250x"),
        Measurement("a whole trial of an empty program with a responder", f"{ready * 1000:.0f} ms", "30 ms"),
    ]


def _times(seconds: float) -> str:
    return f"{_SECONDS / seconds:.0f}x ({seconds:.3f} s)"


def _follow(arena: Arena, camera: LightCamera) -> None:
    """Both sensors read fifty times a second, as a program that only reads them does."""
    world = World(robot("Default_Robot"), arena, camera, _START, Noise(), 0, Chain())
    left, right = world.drive.left, world.drive.right
    left.run("run-forever", 0)
    right.run("run-forever", 0)
    for _ in range(_SECONDS * 30):
        for _ in range(3):
            turn = (world.left_sums[0] // 305 - 128) * 0.15
            left.speed_sp, right.speed_sp = 10.5 * (25 - turn), 10.5 * (25 + turn)
        world.tick()


def _spec(program: str) -> TrialSpec:
    return TrialSpec(
        ProgramSpec(Code("robot.py", program), "preloaded", _LIMITS, 1 << 20),
        ResponderSpec(Code("responder.py", "def responder(text): return text"), {}, _LIMITS, 1 << 20),
        True,
        floor(_FLOOR),
        robot("Default_Robot"),
        _START,
        Noise(),
        Channel(),
        _SECONDS,
        seed=0,
        child_seed=0,
    )


def _through_processes(runner: TrialRunner) -> float:
    """CPU seconds of the worker and of both students' processes together."""
    before = runner.children_cpu_seconds
    own = cpu_seconds(lambda: runner.run(_spec(_FOLLOWER)))
    return own + runner.children_cpu_seconds - before


def _until_ready(runner: TrialRunner) -> float:
    start = time.perf_counter()
    runner.run(_spec("pass"))
    return time.perf_counter() - start
