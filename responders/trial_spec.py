"""What a trial depends on, as plain values: the parts of a submission, the robot on its floor, channel and seeds.

Nothing here runs; ``trial.py`` makes a recording of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

from responders.channel import Channel
from responders.code import Code
from responders.sandbox.running_child import ChildLimits
from sim.floors import Floor
from sim.motion import COURSE_PHYSICS, Physics
from sim.recording import Pose
from sim.robot import Robot
from sim.world import Noise

Preamble = Literal["none", "imports", "preloaded"]


@dataclass(frozen=True, slots=True)
class ProgramSpec:
    """A robot program and what it may use."""

    code: Code
    preamble: Preamble
    limits: ChildLimits
    output_bytes: int


@dataclass(frozen=True, slots=True)
class ResponderSpec:
    """What answers the robot: code and the files in its folder."""

    code: Code
    files: Mapping[str, bytes]
    limits: ChildLimits
    output_bytes: int
    function: str | None = None  # the name of the responder; by the module's own choice if not given


@dataclass(frozen=True, slots=True)
class AgentSpec(ResponderSpec):
    """What the responder and the other agents ask: an agent of the student's, or one that is ``given``."""

    given: bool = False


@dataclass(frozen=True, slots=True)
class TrialSpec:
    """Everything a trial depends on. With ``collaborative`` and no responder, texts are answered ``pingpong``."""

    program: ProgramSpec
    responder: ResponderSpec | None
    collaborative: bool
    floor: Floor
    robot: Robot
    pose: Pose
    noise: Noise
    channel: Channel
    seconds: float
    seed: int
    child_seed: int  # of the chance that the children see; the world's is ``seed``
    pen_down: bool = False
    physics: Physics = COURSE_PHYSICS
    agents: Mapping[str, AgentSpec] = field(default_factory=lambda: MappingProxyType({}))  # by name
