"""Speed of the simulator, alone and with the two sandboxed processes: a line follower for 60 simulated seconds."""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from benchmarks.measurement import (
    COUNT,
    MILLISECONDS,
    RATIO,
    SPEED,
    Measurement,
    measure_cpu_seconds,
    measure_median,
    measure_wall_seconds,
)
from responders.channel import Channel
from responders.sandbox.running_child import ChildLimits
from responders.source_file import SourceFile
from responders.trial_spec import ProgramSpec, ResponderSpec, TrialSpec
from service.grading.trial_runner import TrialRunner
from sim.arena import Arena
from sim.camera import HEIGHT, WIDTH, BulletCamera, CachedCamera, LightCamera
from sim.floors import build_floor
from sim.recording import Pose
from sim.robot import get_robot
from sim.world import HashChain, Noise, World

SECONDS = 60
START = Pose(320, 500, 90)
FLOOR = "Loop"
#: Follows the edge of the loop for the whole minute.
FOLLOWER = """
while True:
    turn = (colorLeft.reflected_light_intensity - 128) * 0.15
    colorRight.reflected_light_intensity
    tank_drive.on(25 - turn, 25 + turn)
"""
_ALONE = "simulator alone, 60 s line follower"
_SIDE = 20
_LIMITS = ChildLimits(30, 512 << 20)


def measure(times: int) -> list[Measurement]:
    """Measure the speed relative to real time on one core, by CPU time, and the costs of both sandboxed processes."""
    pixels = build_floor(FLOOR).pixels
    arena, cached, camera = Arena(), CachedCamera(pixels), BulletCamera(pixels)
    try:
        table_seconds = measure_median(times, lambda: measure_cpu_seconds(lambda: _follow(arena, cached)))
        camera_seconds = measure_median(min(times, 3), lambda: measure_cpu_seconds(lambda: _follow(arena, camera)))
        differing_pixels = _count_differing_pixels(camera, pixels)
    finally:
        camera.close()
        cached.close()
        arena.close()
    with TrialRunner() as runner:
        process_seconds = measure_median(max(times, 5), lambda: measure_through_processes(runner, build_spec(FOLLOWER)))
        ready_seconds = measure_median(4 * times, lambda: measure_wall_seconds(lambda: runner.run(build_spec("pass"))))
    return [
        Measurement(f"{_ALONE}, sensor table", SECONDS / table_seconds, SPEED, 400, 800, f"{table_seconds:.3f} s"),
        Measurement(
            f"{_ALONE}, a PyBullet camera image each tick",
            SECONDS / camera_seconds,
            SPEED,
            60,
            details=f"{camera_seconds:.3f} s",
        ),
        Measurement(
            "the same through both sandboxed processes, CPU of all against the simulator alone",
            process_seconds / table_seconds,
            RATIO,
            3,
            2,
            f"{process_seconds:.3f} s, {SECONDS / process_seconds:.0f}x",
        ),
        Measurement("a whole trial of an empty program with a responder", 1000 * ready_seconds, MILLISECONDS, 30),
        Measurement("pixels that PyBullet's camera sees otherwise than the image", differing_pixels, COUNT, 0),
    ]


def _follow(arena: Arena, camera: LightCamera) -> None:
    """Read both sensors fifty times a second, as a program that only reads them."""
    world = World(get_robot("Default_Robot"), arena, camera, START, Noise(), 0, HashChain())
    left, right = world.drive.left, world.drive.right
    left.run("run-forever", 0)
    right.run("run-forever", 0)
    for _ in range(SECONDS * 30):
        for _ in range(3):
            turn = (world.left_sums[0] // 305 - 128) * 0.15
            left.speed_sp, right.speed_sp = 10.5 * (25 - turn), 10.5 * (25 + turn)
        world.tick()


def _count_differing_pixels(camera: LightCamera, pixels: NDArray[np.uint8]) -> int:
    """Return the number of differing pixels in 200 windows of 20 by 20 pixels, spread over the floor."""
    chance = random.Random(0)
    places = [(chance.randrange(WIDTH - _SIDE), chance.randrange(HEIGHT - _SIDE)) for _ in range(200)]
    return sum(
        int(np.count_nonzero((camera.render_window(x, y, _SIDE) != pixels[y : y + _SIDE, x : x + _SIDE]).any(axis=2)))
        for x, y in places
    )


def build_spec(program: str) -> TrialSpec:
    """Return a trial of sixty seconds on the loop, with an echo responder."""
    return TrialSpec(
        ProgramSpec(SourceFile("robot.py", program), "preloaded", _LIMITS, 1 << 20),
        ResponderSpec(SourceFile("responder.py", "def responder(text): return text"), {}, _LIMITS, 1 << 20),
        True,
        build_floor(FLOOR),
        get_robot("Default_Robot"),
        START,
        Noise(),
        Channel(),
        SECONDS,
        seed=0,
        child_seed=0,
    )


def measure_through_processes(runner: TrialRunner, spec: TrialSpec) -> float:
    """Return the CPU seconds of the worker and of both students' processes."""
    children_before = runner.children_cpu_seconds
    worker_seconds = measure_cpu_seconds(lambda: runner.run(spec))
    return worker_seconds + runner.children_cpu_seconds - children_before
