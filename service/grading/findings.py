"""What is found out about a hand-in without driving: facts of its text, values of its functions, a check's answers.

All of it is found inside the walls; what it is worth is decided in the modules of the kinds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from typing import Any, Protocol

from responders.conversation import Code
from responders.function_calls import Called, FunctionCall, Returned
from responders.sandbox.meter import JobMeter
from responders.sandbox.running_child import ChildLimits
from service.grading.grade import TrialResult
from service.grading.judging.function_checks import calls_of, checked
from service.grading.judging.outcome import Outcome, fault_words
from service.grading.judging.source_rules import SourceFacts
from sim.chance import Stream
from sim.recording import Pose, Recording
from submissions.assignment import Assignment
from submissions.criteria.code import Functions, PythonCheck, SourceRules
from submissions.magics import Flags
from submissions.submission import Source

_MEGABYTE = 1 << 20
#: Much more than the longest text takes: how fast a machine is must make no difference.
_READER_LIMITS = ChildLimits(20.0, 256 * _MEGABYTE)
_READER_OUTPUT = 1000


@dataclass(frozen=True, slots=True)
class HandedIn:
    """What is looked at: the sources of the parts, the flags of the program's magic line, the responder's files."""

    program: Source | None = None
    responder: Source | None = None
    flags: Flags = field(default_factory=Flags)
    files: Mapping[str, bytes] = field(default_factory=dict)
    modules: tuple[Source, ...] = ()  # other Python files of the hand-in's own, which the responder may import
    child_seed: int = 0  # of the chance that its functions see


@dataclass(frozen=True, slots=True)
class Findings:
    """``called`` is by the id of a criterion, ``checks`` by that and the place of the trial, ``modules`` by name."""

    facts: Mapping[str, SourceFacts] = field(default_factory=dict)
    flags: Flags = field(default_factory=Flags)
    called: Mapping[str, Called] = field(default_factory=dict)
    checks: Mapping[tuple[str, int], Outcome] = field(default_factory=dict)
    walls: str = ""
    modules: Mapping[str, SourceFacts] = field(default_factory=dict)


class Caller(Protocol):
    """Calls functions inside the walls; a rig does."""

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


def look_at(
    handed_in: HandedIn,
    assignment: Assignment,
    trials: Sequence[TrialResult],
    caller: Caller,
    meter: JobMeter,
) -> Findings:
    """Everything that the criteria ask for beside the recordings.

    Raises AssignmentError when a check of the instructor's fails, HostError when the machine does.
    """
    sources = {"program": handed_in.program, "responder": handed_in.responder}
    parts: set[str] = {criterion.part for criterion in assignment.criteria if isinstance(criterion, SourceRules)}
    facts = {part: _facts(source, caller, meter) for part in sorted(parts) if (source := sources[part]) is not None}
    reads_modules = "responder" in facts
    modules = {each.name: _facts(each, caller, meter) for each in handed_in.modules} if reads_modules else {}
    called: dict[str, Called] = {}
    checks: dict[tuple[str, int], Outcome] = {}
    for criterion in assignment.criteria:
        if isinstance(criterion, Functions) and handed_in.responder is not None:
            called[criterion.id] = _called(criterion, handed_in, assignment, caller, meter)
        elif isinstance(criterion, PythonCheck):
            for place, trial in enumerate(trials):
                if not criterion.scenarios or trial.scenario in criterion.scenarios:
                    checks[criterion.id, place] = _check(criterion, trial, assignment, caller, meter)
    walls = next((each.walls for each in called.values()), "")
    return Findings(facts, handed_in.flags, called, checks, walls, modules)


def reads_program(assignment: Assignment) -> bool:
    """Whether the text of the robot program is marked."""
    return any(isinstance(each, SourceRules) and each.part == "program" for each in assignment.criteria)


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


def _facts(source: Source, caller: Caller, meter: JobMeter) -> SourceFacts:
    reader = resources.files("responders") / "library" / "source_facts.py"
    code = Code("source_facts.py", reader.read_text("utf-8"))
    calls = [FunctionCall("facts", [source.text])]
    called = caller.call(code, {}, calls, _READER_LIMITS, _READER_OUTPUT, 0, meter)
    fault = called.fault or called.returned[0].fault
    if fault is not None:
        return SourceFacts(error=f"it cannot be taken apart ({fault_words(fault)})")
    return SourceFacts.read(called.returned[0].value)


def _called(
    criterion: Functions, handed_in: HandedIn, assignment: Assignment, caller: Caller, meter: JobMeter
) -> Called:
    limits, responder = assignment.limits, handed_in.responder
    assert responder is not None
    return caller.call(
        Code(responder.name, responder.text),
        handed_in.files,
        calls_of(criterion),
        ChildLimits(limits.responder_cpu, limits.responder_memory_mb * _MEGABYTE),
        limits.output_bytes,
        Stream(handed_in.child_seed, f"calls {criterion.id}").integer(0) >> 1,
        meter,
    )


def _check(
    criterion: PythonCheck, trial: TrialResult, assignment: Assignment, caller: Caller, meter: JobMeter
) -> Outcome:
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
    return checked(criterion, called.returned[0] if called.returned else Returned(fault=called.fault))


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
