"""What is found out about a submission without driving: what its text has, values of its functions, a check's answers.

All of it is found inside the sandbox; what it is worth is decided in the modules of the kinds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

from responders.conversation import Code
from responders.function_calls import Called, FunctionCall, Returned
from responders.sandbox.meter import JobMeter
from responders.sandbox.running_child import ChildLimits
from service.grading.grade import TrialResult
from service.grading.judging.function_checks import calls_of
from service.grading.judging.outcome import fault_words
from service.grading.judging.source_rules import SPEECH, SourceAnswers
from sim.chance import Stream
from sim.recording import Pose, Recording
from submissions.assignment.definition import Assignment
from submissions.criteria.code import Functions, PythonCheck, SourceRules
from submissions.magics import Flags
from submissions.submission import Cell, Source

_MEGABYTE = 1 << 20
#: Much more than the longest text takes: how fast a machine is must make no difference.
_READER_LIMITS = ChildLimits(30.0, 512 * _MEGABYTE)
_READER_OUTPUT = 100_000
#: What is handed to it of all files together, and of one; a little more than it reads, so that it says so.
_MOST_READ, _MOST_OF_ONE = 1_000_001, 300_001
_READER = Code("source_reader.py", "from inside.source_reader import read")
#: The names by which a responder's functions are found.
_RESPONDERS = ("responder", "*_responder")


@dataclass(frozen=True, slots=True)
class SubmittedParts:
    """What is looked at: the sources of the parts, the flags of the program's magic line, the responder's files.

    ``own`` are those of the files that were submitted; ``cells`` those of a notebook that is the responder.
    """

    program: Source | None = None
    responder: Source | None = None
    flags: Flags = field(default_factory=Flags)
    files: Mapping[str, bytes] = field(default_factory=dict)
    own: Mapping[str, bytes] = field(default_factory=dict)
    cells: tuple[Cell, ...] = ()
    child_seed: int = 0  # of the chance that its functions see


@dataclass(frozen=True, slots=True)
class StaticAnalysis:
    """``answers`` and ``called`` are by the id of a criterion, ``checks`` by that and the place of the trial."""

    answers: Mapping[str, SourceAnswers] = field(default_factory=dict)
    flags: Flags = field(default_factory=Flags)
    called: Mapping[str, Called] = field(default_factory=dict)
    checks: Mapping[tuple[str, int], Returned] = field(default_factory=dict)
    sandbox: str = ""


class Caller(Protocol):
    """Calls functions inside the sandbox; a runner does."""

    def call(
        self,
        code: Code,
        files: Mapping[str, bytes],
        calls: Sequence[FunctionCall],
        limits: ChildLimits,
        output_bytes: int,
        seed: int,
        meter: JobMeter,
    ) -> Called: ...


def analyse(
    submitted: SubmittedParts,
    assignment: Assignment,
    trials: Sequence[TrialResult],
    caller: Caller,
    meter: JobMeter,
) -> StaticAnalysis:
    """Everything that the criteria ask for beside the recordings. Raises HostError when the machine fails."""
    sources = {"program": submitted.program, "responder": submitted.responder}
    answers: dict[str, SourceAnswers] = {}
    called: dict[str, Called] = {}
    checks: dict[tuple[str, int], Returned] = {}
    # What the instructor's checks cost is not the submission's, and what that has left is not theirs.
    own = JobMeter(meter.limits, meter.heartbeat)
    for criterion in assignment.criteria:
        if isinstance(criterion, SourceRules) and sources[criterion.part] is not None:
            answers[criterion.id] = _answers(criterion, submitted, assignment, caller, meter)
        elif isinstance(criterion, Functions) and submitted.responder is not None:
            called[criterion.id] = _called(criterion, submitted, assignment, caller, meter)
        elif isinstance(criterion, PythonCheck):
            for place, trial in enumerate(trials):
                if not criterion.scenarios or trial.scenario in criterion.scenarios:
                    checks[criterion.id, place] = _check(criterion, trial, assignment, caller, own)
    sandbox = next((each.sandbox for each in called.values()), "")
    return StaticAnalysis(answers, submitted.flags, called, checks, sandbox)


def reads_program(assignment: Assignment) -> bool:
    """Whether the text of the robot program is marked."""
    return any(isinstance(each, SourceRules) and each.part == "program" for each in assignment.criteria)


def does_without(assignment: Assignment, part: Literal["program", "responder"]) -> tuple[str, ...]:
    """The modules that a student's part may not import: what carries marks is refused when it is run, too."""
    if getattr(assignment.parts, part) != "student":
        return ()
    rules = (each for each in assignment.criteria if isinstance(each, SourceRules) and each.part == part and each.marks)
    return tuple(sorted({module for each in rules for module in each.avoided_modules}))


def responder_limits(assignment: Assignment) -> ChildLimits:
    """What a responder may use, whatever it is run for."""
    limits = assignment.limits
    without = does_without(assignment, "responder")
    return ChildLimits(limits.responder_cpu, limits.responder_memory_mb * _MEGABYTE, without)


def plain_trial(trial: TrialResult) -> dict[str, Any]:
    """What an instructor's check is given: the recording as JSON has it."""
    recording = trial.recording
    return {
        "scenario": trial.scenario,
        "index": trial.index,
        "light_noise": trial.light_noise,
        "motor_noise": trial.motor_noise,
        "background": recording.background,
        "start": _pose(recording.start),
        "end": _pose(recording.end),
        "end_t": recording.end_t,
        "verdict": str(recording.verdict),
        "ticks": _ticks(recording),
        "printed": [[line.t, line.text] for line in recording.printed],
        "spoken": [[line.t, line.text] for line in recording.spoken],
        "messages": [
            {"t": each.t, "sender": each.sender, "text": each.text, "delivered": each.delivered}
            for each in recording.messages
        ],
        "datalog": [
            [each.t, each.name, each.value, each.simtime] for each in recording.datalog if math.isfinite(each.value)
        ],
        "images": [{"t": each.t, "pose": _pose(each.pose), "truth": each.truth} for each in recording.images],
        "image_log": [[side, tick / 30] for side, _, tick in recording.image_log],
        "touches": [[each.t, each.what] for each in recording.touches],
    }


def _answers(
    criterion: SourceRules, submitted: SubmittedParts, assignment: Assignment, caller: Caller, meter: JobMeter
) -> SourceAnswers:
    asked = {
        "uses": criterion.uses,
        "avoids": criterion.avoids,
        "in_loop": criterion.in_loop,
        "defines": criterion.defines,
        "shown": SPEECH,
        "entries": (*criterion.defines, *_entries(assignment)) if criterion.part == "responder" else criterion.defines,
    }
    calls = [FunctionCall("read", [list(_read_files(criterion.part, submitted)), asked])]
    called = caller.call(_READER, {}, calls, _READER_LIMITS, _READER_OUTPUT, 0, meter)
    fault = called.fault or called.returned[0].fault
    if fault is not None:
        return SourceAnswers(error=f"it cannot be taken apart ({fault_words(fault)})")
    return SourceAnswers.read(called.returned[0].value, criterion)


def _read_files(part: str, submitted: SubmittedParts) -> Iterator[Mapping[str, Any]]:
    """The part, and the Python files beside a responder, as bytes: they say themselves how they are written."""
    source = submitted.program if part == "program" else submitted.responder
    assert source is not None
    if part == "responder" and submitted.cells:
        yield {"name": "", "cells": [(cell.number, cell.source) for cell in submitted.cells]}
    else:
        yield {"name": "", "text": source.text[:_MOST_OF_ONE]}
    left = _MOST_READ - len(source.text)
    beside = {name: data for name, data in submitted.own.items() if name.lower().endswith(".py")}
    for name, data in beside.items() if part == "responder" else ():
        if left > 0:
            yield {"name": name, "bytes": data[:_MOST_OF_ONE].decode("latin-1")}
        left -= len(data)


def _entries(assignment: Assignment) -> Iterator[str]:
    """The functions of a responder that are called from outside."""
    yield from _RESPONDERS
    if assignment.training is not None:
        yield assignment.training.function
    for criterion in assignment.criteria:
        if isinstance(criterion, Functions):
            yield from {criterion.function, *(call.function for call in criterion.calls)} - {""}


def _called(
    criterion: Functions, submitted: SubmittedParts, assignment: Assignment, caller: Caller, meter: JobMeter
) -> Called:
    responder = submitted.responder
    assert responder is not None
    return caller.call(
        Code(responder.name, responder.text),
        submitted.files,
        calls_of(criterion),
        responder_limits(assignment),
        assignment.limits.output_bytes,
        Stream(submitted.child_seed, f"calls {criterion.id}").integer(0) >> 1,
        meter,
    )


def _check(
    criterion: PythonCheck, trial: TrialResult, assignment: Assignment, caller: Caller, meter: JobMeter
) -> Returned:
    limits = assignment.limits
    called = caller.call(
        Code(criterion.file, assignment.given_parts[criterion.file]),
        assignment.given,
        [FunctionCall("check", [plain_trial(trial)])],
        ChildLimits(limits.responder_cpu, limits.responder_memory_mb * _MEGABYTE),
        limits.output_bytes,
        trial.seed,
        meter,
    )
    return called.returned[0] if called.returned else Returned(fault=called.fault)


def _pose(pose: Pose) -> dict[str, float]:
    return {"x": pose.x, "y": pose.y, "heading": pose.heading}


def _ticks(recording: Recording) -> dict[str, Any]:
    ticks = recording.ticks
    columns = {
        "t": ticks.t,
        "x": ticks.x,
        "y": ticks.y,
        "heading": ticks.heading,
        "left_position": ticks.left_position,
        "right_position": ticks.right_position,
        "left_rgb": ticks.left_rgb,
        "right_rgb": ticks.right_rgb,
        "ultrasonic": ticks.ultrasonic,
        "gyro": ticks.gyro,
    }
    return {name: column.tolist() for name, column in columns.items()}
