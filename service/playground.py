"""The playground: an assignment without marks, in a world that the person who runs a program chooses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sim.errors import UsageError
from sim.floors import get_floor_start, list_floor_names
from sim.recording import Pose
from sim.robot import get_default_robot_name
from submissions.assignment.definition import Assignment, Parts, WorldSpec
from submissions.assignment.scenario import Scenario

#: The id of the playground's assignments. Ids of real assignments have no capital letters.
PLAYGROUND_ID = "Playground"
#: The files of the playground, as an assignment asks for them.
PLAYGROUND_FILES = ("robot.py", "responder.py")
#: The ranges of the simulator's own sliders: mm, degrees, and the levels of noise.
RANGES = {"x": 2362, "y": 1143, "heading": 360, "light_noise": 128, "motor_noise": 500}
STARTER_PROGRAM = '''\
"""Drive forwards, turn left, and say how bright the floor is."""

tank_drive.on_for_seconds(SpeedPercent(30), SpeedPercent(30), 2)
tank_turn.on_for_rotations(-100, SpeedPercent(20), 0.5)
say("The floor is " + str(colorLeft.reflected_light_intensity_pc) + " bright")
'''


@dataclass(frozen=True, slots=True)
class PlaygroundWorld:
    """The floor, the start pose (mm and degrees), and the noise of the light sensors and the motors."""

    floor: str
    x: float
    y: float
    heading: float
    light_noise: float = 0.0
    motor_noise: float = 0.0

    def change(self, start: Sequence[float | None], light_noise: float, motor_noise: float) -> PlaygroundWorld:
        """Return the world with these levels of noise, and with the values of ``start`` that are not None."""
        kept = zip(start, (self.x, self.y, self.heading), strict=True)
        x, y, heading = (usual if value is None else value for value, usual in kept)
        return PlaygroundWorld(self.floor, x, y, heading, light_noise, motor_noise)


def place_on_floor(floor: str) -> PlaygroundWorld:
    """Return the world with this floor and its usual start pose. Raises UsageError for an unknown floor."""
    _check_floor(floor)
    pose, _ = get_floor_start(floor)
    return PlaygroundWorld(floor, pose.x, pose.y, pose.heading % 360)


def build_playground(world: PlaygroundWorld) -> Assignment:
    """Return the assignment for one run in this world. Raises UsageError for a floor or a value that is invalid."""
    _check_floor(world.floor)
    for name, highest in RANGES.items():
        value = getattr(world, name)
        if not (math.isfinite(value) and 0 <= value <= highest):
            raise UsageError(
                "%(name)s is %(value)s, expected a number from 0 to %(highest)s.",
                name=name,
                value=f"{value:g}",
                highest=highest,
            )
    scenario = Scenario(
        "playground",
        (Pose(world.x, world.y, world.heading),),
        light_noise=(world.light_noise,),
        motor_noise=(world.motor_noise,),
    )
    return Assignment(
        PLAYGROUND_ID,
        PLAYGROUND_ID,
        WorldSpec(world.floor, obstacles=get_floor_start(world.floor)[1], robot=get_default_robot_name(world.floor)),
        Parts(),
        (scenario,),
        (),
    )


def read_world(assignment: Assignment) -> PlaygroundWorld:
    """Return the world of an assignment that ``build_playground`` made."""
    (scenario,) = assignment.scenarios
    (pose,), (light_noise,), (motor_noise,) = scenario.poses, scenario.light_noise, scenario.motor_noise
    return PlaygroundWorld(assignment.world.background, pose.x, pose.y, pose.heading, light_noise, motor_noise)


def _check_floor(name: str) -> None:
    if name not in list_floor_names():
        raise UsageError(
            "there is no floor called %(name)s, expected the name of a floor such as Simple_Shapes.",
            name=repr(name[:40]),
        )


DEFAULT_WORLD = place_on_floor("Empty_Map")
