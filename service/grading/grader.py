"""Grades one submission against one assignment: every trial run, every criterion judged.

A plain function that knows no queue and no database; the command line, the workers and the tests all call it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from responders.bridge import ProgramOrder, TrialOrder
from responders.channel import Channel
from responders.conversation import Code, ResponderOrder
from responders.sandbox.running_child import ChildLimits
from service.grading.grade import Grade, TrialResult
from service.grading.judge import judge
from service.grading.rig import Rig
from service.version import GRADER_VERSION
from sim.backgrounds import Floor, floor, floor_from_picture
from sim.errors import UsageError
from sim.robot import robot
from sim.world import Noise
from submissions.assignment import Assignment, ChannelSpec, Trial, WorldSpec
from submissions.magics import Flags, setup, split_program, without_magic
from submissions.submission import Source, Submission

_MEGABYTE = 1 << 20
_OBSERVE_SECONDS = 1.0


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a grading has come."""

    trials_done: int
    trials: int


class Observe(Protocol):
    """Called after each trial and about once a second; raises Cancelled to stop the grading."""

    def __call__(self, progress: Progress, /) -> None: ...


def _nobody(progress: Progress) -> None:
    """The default observer."""


@dataclass(frozen=True, slots=True)
class _Parts:
    """Who plays: the sources to run, and the files in the responder's folder."""

    program: Source
    flags: Flags
    responder: Source | None
    files: Mapping[str, bytes]
    notes: tuple[str, ...]


def grade(
    submission: Submission, assignment: Assignment, *, observe: Observe | None = None, rig: Rig | None = None
) -> Grade:
    """The marks of ``submission``. Without a ``rig`` one is made for this grading and closed afterwards.

    Raises UsageError when a part is missing that the assignment asks for, HostError when this machine fails,
    and whatever ``observe`` raises.
    """
    if rig is None:
        with Rig() as own:
            return grade(submission, assignment, observe=observe, rig=own)
    parts = _parts(submission, assignment)
    ground = _floor(assignment.world)
    trials = tuple(assignment.trials())
    results: list[TrialResult] = []
    watch = _Watch(observe or _nobody, len(trials))
    for trial in trials:
        order = _order(trial, parts, assignment, ground)
        recording = rig.run(order, assignment.world.obstacles, watch.pulse)
        results.append(
            TrialResult(
                trial.scenario.id,
                trial.index,
                trial.seed,
                trial.light_noise,
                trial.motor_noise,
                trial.scenario.visibility,
                recording,
            )
        )
        watch.finished_one()
    return Grade(
        assignment=assignment.id,
        assignment_title=assignment.title,
        assignment_version=assignment.version,
        submission=submission.sha256,
        student=submission.student,
        criteria=judge(assignment, tuple(results)),
        trials=tuple(results),
        walls=results[0].recording.walls if results else "no student code was run",
        grader_version=GRADER_VERSION,
        notes=(*submission.notes, *parts.notes),
    )


def check_parts(submission: Submission, assignment: Assignment) -> None:
    """Raise UsageError, naming it, when a part is missing that the assignment asks for."""
    _parts(submission, assignment)


class _Watch:
    """Turns the many pulses of a trial into one call of the observer a second."""

    def __init__(self, observe: Callable[[Progress], None], trials: int) -> None:
        self._observe = observe
        self._trials = trials
        self._done = 0
        self._last = time.monotonic()

    def pulse(self) -> None:
        if time.monotonic() - self._last >= _OBSERVE_SECONDS:
            self._tell()

    def finished_one(self) -> None:
        self._done += 1
        self._tell()

    def _tell(self) -> None:
        self._last = time.monotonic()
        self._observe(Progress(self._done, self._trials))


def _parts(submission: Submission, assignment: Assignment) -> _Parts:
    program = _part("robot program", "robot.py", assignment.parts.program, submission.program, assignment)
    if program is None:
        raise UsageError(f"assignment {assignment.id} has no robot program to run")
    responder = _part("responder", "responder.py", assignment.parts.responder, submission.responder, assignment)
    flags, text, notes = _flags(program.text, assignment)
    if submission.responder is not None and responder is not submission.responder:
        notes += ("your responder is not used: this assignment brings its own, or none",)
    return _Parts(Source(program.name, text), flags, responder, {**assignment.given, **submission.files}, notes)


def _part(what: str, usual: str, who: str, handed_in: Source | None, assignment: Assignment) -> Source | None:
    if who == "none":
        return None
    if who != "student":
        return Source(who, assignment.given_parts[who])
    if handed_in is None:
        raise UsageError(f"the hand-in has no {what}; {assignment.id} asks for {usual}")
    return handed_in


def _flags(text: str, assignment: Assignment) -> tuple[Flags, str, tuple[str, ...]]:
    """The flags of the program's first line, its text, and notes where the assignment decides otherwise."""
    try:
        flags, text = split_program(text)
        wanted = setup(flags)
    except UsageError as error:
        return Flags(), without_magic(text), (f"the program's magic line is ignored: {error}",)
    world = assignment.world
    notes = []
    if "b" in flags.values and wanted.background != world.background:
        notes.append(f"the program asks for the background {wanted.background}; the assignment's is {world.background}")
    if "r" in flags.values and wanted.robot != world.robot:
        notes.append(f"the program asks for the robot {wanted.robot}; the assignment's is {world.robot}")
    if flags.values.keys() & {"N", "M"}:
        notes.append("the assignment's noise is used, not the program's -N or -M")
    return flags, text, tuple(notes)


def _floor(world: WorldSpec) -> Floor:
    if world.picture is not None:
        return floor_from_picture(world.background, world.picture)
    return floor(world.background, labels=world.labels)


def _order(trial: Trial, parts: _Parts, assignment: Assignment, ground: Floor) -> TrialOrder:
    limits = assignment.limits
    responder = None
    if parts.responder is not None:
        responder = ResponderOrder(
            Code(parts.responder.name, parts.responder.text),
            parts.files,
            ChildLimits(limits.responder_cpu, limits.responder_memory_mb * _MEGABYTE),
            limits.output_bytes,
        )
    return TrialOrder(
        program=ProgramOrder(
            Code(parts.program.name, parts.program.text),
            parts.flags.preamble,
            ChildLimits(limits.program_cpu, limits.program_memory_mb * _MEGABYTE),
            limits.output_bytes,
        ),
        responder=responder,
        collaborative=responder is not None or "L" in parts.flags.switches,
        floor=ground,
        robot=robot(assignment.world.robot),
        pose=trial.pose,
        noise=Noise(trial.light_noise, trial.motor_noise),
        channel=_channel(trial.scenario.channel),
        seconds=trial.scenario.seconds,
        seed=trial.seed,
        pen_down="p" in parts.flags.switches,
    )


def _channel(spec: ChannelSpec) -> Channel:
    return Channel(spec.delay, spec.jitter, spec.loss, spec.duplication, spec.reordering)
