"""The original's stepping loop in plain Python compared with ours, with the same programs, in one run.

Both must end at the same pose, otherwise neither is timed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Protocol

import numpy as np

from benchmarks.measurement import GAIN, Measurement, measure_cpu_seconds, measure_median
from benchmarks.original_loop import OriginalSimulator
from benchmarks.simulator import FLOOR, START
from sim.arena import Arena
from sim.camera import CachedCamera
from sim.floors import build_floor
from sim.robot import get_robot
from sim.world import HashChain, Noise, World

_TICKS = 600
_NEAR = 0.01  # mm, and degrees


class _Wheel(Protocol):
    speed_sp: float
    position_sp: float

    def run(self, command: str, clock: int, /) -> None: ...


#: Sets both wheels before a numbered tick, from the red value of the left light sensor, 0 to 255.
_Program = Callable[[_Wheel, _Wheel, float, int], None]


def _follow(left: _Wheel, right: _Wheel, red: float, clock: int) -> None:
    """Follow the edge of the line."""
    turn = (int(red) - 128) * 0.15
    left.speed_sp, right.speed_sp = 10.5 * (25 - turn), 10.5 * (25 + turn)
    if clock == 0:
        left.run("run-forever", clock)
        right.run("run-forever", clock)


def _drive_square(left: _Wheel, right: _Wheel, _red: float, clock: int) -> None:
    """Drive a square: two seconds ahead, two on the spot, to positions."""
    if clock % 60 == 0:
        is_straight = clock % 120 == 0
        left.speed_sp = right.speed_sp = 315
        left.position_sp, right.position_sp = (1080, 1080) if is_straight else (-576, 576)
        left.run("run-to-rel-pos", clock)
        right.run("run-to-rel-pos", clock)


_PROGRAMS: tuple[tuple[str, _Program, Noise], ...] = (
    ("a line follower", _follow, Noise()),
    ("a square", _drive_square, Noise()),
    ("a line follower with sensor noise", _follow, Noise(light=32)),
)


def measure(times: int) -> list[Measurement]:
    """Measure how many times less CPU ours needs than the port."""
    pixels = build_floor(FLOOR).pixels
    canvas = np.dstack((pixels, np.full(pixels.shape[:2], 255, np.uint8))).tobytes()
    arena, camera = Arena(), CachedCamera(pixels)
    try:
        return [
            _compare_speed(
                name,
                partial(_run_original, canvas, program, noise),
                partial(_run_world, arena, camera, program, noise),
                noise,
                times,
            )
            for name, program, noise in _PROGRAMS
        ]
    finally:
        camera.close()
        arena.close()


def _compare_speed(
    name: str,
    original_factory: Callable[[], OriginalSimulator],
    world_factory: Callable[[], World],
    noise: Noise,
    times: int,
) -> Measurement:
    if noise.light == 0:
        _compare(name, original_factory(), world_factory())
    port_seconds, own_seconds = (
        measure_median(min(times, 3), partial(measure_cpu_seconds, run)) for run in (original_factory, world_factory)
    )
    seconds = _TICKS / 30
    return Measurement(
        f"the original's loop in plain Python against ours, {name}",
        port_seconds / own_seconds,
        GAIN,
        details=f"{seconds / port_seconds:.0f}x and {seconds / own_seconds:.0f}x real time",
    )


def _compare(name: str, port: OriginalSimulator, world: World) -> None:
    drive = world.drive
    pose_error = (port.x - drive.x, port.y - drive.y, math.degrees(port.angle - drive.heading))
    differences = (*pose_error, port.ultrasonic - world.ultrasonic, port.left_red - world.left_means[0])
    if max(map(abs, differences)) > _NEAR:
        raise RuntimeError(f"the port and ours do not end alike with {name}: {differences}")


def _run_original(canvas: bytes, program: _Program, noise: Noise) -> OriginalSimulator:
    simulator = OriginalSimulator(canvas, START.x, START.y, math.radians(START.heading), noise.motor, noise.light)
    for clock in range(_TICKS):
        program(simulator.left, simulator.right, simulator.left_red, clock)
        simulator.tick()
    return simulator


def _run_world(arena: Arena, camera: CachedCamera, program: _Program, noise: Noise) -> World:
    world = World(get_robot("Default_Robot"), arena, camera, START, noise, 0, HashChain())
    for clock in range(_TICKS):
        program(world.drive.left, world.drive.right, world.left_means[0], clock)
        world.tick()
    return world
