"""Runs one program as a trial does, with or without a responder."""

from __future__ import annotations

from collections.abc import Mapping

from responders.channel import Channel
from responders.sandbox.meter import JobMeter
from responders.sandbox.running_child import ChildLimits
from responders.source_file import SourceFile
from responders.trial_spec import AgentSpec, PartnerSpec, Preamble, ProgramSpec, ResponderSpec, TrialSpec
from service.grading.trial_runner import TrialRunner
from sim.floors import build_floor
from sim.motion import COURSE_PHYSICS, Physics, Rectangle
from sim.recording import TICK, Pose, Recording
from sim.robot import get_robot
from sim.world import Noise

PROGRAM_LIMITS = ChildLimits(2.0, 128 << 20)
RESPONDER_LIMITS = ChildLimits(3.0, 512 << 20)


def agent_spec(name: str, text: str, files: Mapping[str, bytes] | None, output_bytes: int) -> AgentSpec:
    """Return a student's agent."""
    return AgentSpec(SourceFile(f"{name}.py", text), files or {}, RESPONDER_LIMITS, output_bytes)


def run_program(
    runner: TrialRunner,
    program: str,
    start: Pose | None = None,
    *,
    responder: str | None = None,
    agents: Mapping[str, str] | None = None,
    files: Mapping[str, bytes] | None = None,
    background: str = "Empty_Map",
    robot_name: str = "Default_Robot",
    obstacles: tuple[Rectangle, ...] = (),
    noise: Noise = Noise(),  # noqa: B008
    channel: Channel = Channel(),  # noqa: B008
    preamble: Preamble = "preloaded",
    seconds: float = 60,
    seed: int = 1,
    output_bytes: int = 1_000_000,
    physics: Physics = COURSE_PHYSICS,
    tick: int = TICK,
    meter: JobMeter | None = None,
    second: str | None = None,
    second_start: Pose = Pose(1500, 500, 180),  # noqa: B008
    given: bool = False,
    program_limits: ChildLimits | None = None,
    child_seed: int | None = None,
) -> Recording:
    """Run one trial. The start is the background's own unless given; with a ``second`` program there are two robots.

    ``given`` says whether the assignment provides the second program.
    """
    ground = build_floor(background)
    partner = None
    if second is not None:
        program_of_second = ProgramSpec(
            SourceFile("robot2.py", second), preamble, program_limits or PROGRAM_LIMITS, output_bytes
        )
        partner = PartnerSpec(program_of_second, second_start, given=given)
    spec = TrialSpec(
        program=ProgramSpec(SourceFile("robot.py", program), preamble, program_limits or PROGRAM_LIMITS, output_bytes),
        responder=None
        if responder is None
        else ResponderSpec(SourceFile("responder.py", responder), files or {}, RESPONDER_LIMITS, output_bytes),
        collaborative=responder is not None or second is not None,
        floor=ground,
        robot=get_robot(robot_name),
        pose=start or ground.default_pose,
        noise=noise,
        channel=channel,
        seconds=seconds,
        seed=seed,
        child_seed=seed if child_seed is None else child_seed,
        physics=physics,
        tick=tick,
        agents={name: agent_spec(name, text, files, output_bytes) for name, text in (agents or {}).items()},
        partner=partner,
    )
    return runner.run(spec, obstacles, meter)
