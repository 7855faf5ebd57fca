"""The world at the start of a trial, and its state as text for programs and notebooks.

``bridge.py`` moves the world.
"""

from __future__ import annotations

import math
from typing import Any

from responders import message_format
from responders.trial_spec import TrialSpec
from sim.arena import Arena
from sim.camera import LightCamera
from sim.world import HashChain, World


def format_reading(reading: float | list[float]) -> str:
    """Return the ``repr`` of a reading.

    Lists of three equal values are common over a grey floor and take a faster path, because formatting floats is slow.
    """
    if isinstance(reading, list):
        first = reading[0]
        if first and reading.count(first) == len(reading):  # 0.0 and -0.0 are equal but have different reprs
            return f"[{', '.join([repr(first)] * len(reading))}]"
    return repr(reading)


def build_world(spec: TrialSpec, arena: Arena, camera: LightCamera, chain: HashChain) -> World:
    """Return the world at the start of the trial."""
    noise_seed = spec.seed if spec.noise_seed is None else spec.noise_seed
    return World(
        spec.robot,
        arena,
        camera,
        spec.pose,
        spec.noise,
        noise_seed,
        chain,
        spec.physics,
        spec.tick,
        motor_seed=spec.motor_seed,
    )


def build_robot_state(world: World, spec: TrialSpec) -> dict[str, Any]:
    """Return the robot's pose and sensor values, with the keys of the original ``%sim_robot_state``."""
    readings = world.collect_readings()
    state: dict[str, Any] = {
        "x": world.pose.x,
        "y": world.pose.y,
        "angle": math.radians(world.pose.heading),
        "ultrasonic": readings["ultrasonic"],
        "gyro": readings["gyro"],
        "penDown": spec.pen_down,
        "_sensorNoise": spec.noise.light,
        "_wheelNoise": spec.noise.motor,
    }
    for number, (side, image) in enumerate(zip(("left", "right"), world.render_images(), strict=True)):
        rgb = readings[side]
        state[f"sensor{number + 1}dataArray"] = message_format.format_csv(image)
        state[f"{side}_light_raw"] = rgb
        state[f"{side}_light"] = int(rgb[0])
        state[f"{side}_light_pc"] = 100 * int(rgb[0]) / 255
        state[f"{side}_light_full"] = 100 * sum(map(int, rgb)) / 765
    return state
