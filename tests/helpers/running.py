"""Running one program, with or without a responder, the way a trial does."""

from __future__ import annotations

from collections.abc import Mapping

from responders.channel import Channel
from responders.code import Code
from responders.sandbox.meter import JobMeter
from responders.sandbox.running_child import ChildLimits
from responders.trial_spec import AgentSpec, Preamble, ProgramSpec, ResponderSpec, TrialSpec
from service.grading.trial_runner import TrialRunner
from sim.floors import floor
from sim.motion import COURSE_PHYSICS, Physics, Rectangle
from sim.recording import Pose, Recording
from sim.robot import robot
from sim.world import Noise

PROGRAM_LIMITS = ChildLimits(2.0, 128 << 20)
RESPONDER_LIMITS = ChildLimits(3.0, 512 << 20)


def agent_spec(name: str, text: str, files: Mapping[str, bytes] | None, output_bytes: int) -> AgentSpec:
    """A student's agent."""
    return AgentSpec(Code(f"{name}.py", text), files or {}, RESPONDER_LIMITS, output_bytes)


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
    meter: JobMeter | None = None,
) -> Recording:
    """One trial; the start is the background's own unless given."""
    ground = floor(background)
    spec = TrialSpec(
        program=ProgramSpec(Code("robot.py", program), preamble, PROGRAM_LIMITS, output_bytes),
        responder=None
        if responder is None
        else ResponderSpec(Code("responder.py", responder), files or {}, RESPONDER_LIMITS, output_bytes),
        collaborative=responder is not None,
        floor=ground,
        robot=robot(robot_name),
        pose=start or ground.default_pose,
        noise=noise,
        channel=channel,
        seconds=seconds,
        seed=seed,
        child_seed=seed,
        physics=physics,
        agents={name: agent_spec(name, text, files, output_bytes) for name, text in (agents or {}).items()},
    )
    return runner.run(spec, obstacles, meter)
