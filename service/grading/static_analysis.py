"""Analysis without a robot run: reading the source, calling functions, and running an assignment's checks.

All of it runs inside the sandbox. The modules of the criterion families decide the marks.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

from responders.function_calls import CallResult, CallResults, FunctionCall
from responders.sandbox.meter import JobMeter
from responders.sandbox.running_child import ChildLimits
from responders.source_file import SourceFile
from responders.trial_spec import ResponderSpec
from service.grading.grade import TrialResult
from service.grading.judging.code import list_calls
from service.grading.judging.judge_declaration import StaticAnalysis, use_robot_recording
from service.grading.judging.message_parts import describe_fault
from service.grading.judging.source_answers import SPEECH, SourceAnswers
from service.grading.run_plan import RunPlan
from sim.random_streams import RandomStream
from sim.recording import Pose
from sim.recording_values import tick_to_seconds
from sim.sentences import Sentence
from submissions.assignment.definition import Assignment
from submissions.criteria.code import Functions, PythonCheck, SourceRules
from submissions.submission import Part

_MEGABYTE = 1 << 20
#: The limits are far above the needs of the longest text, so the speed of the machine makes no difference.
_READER = ResponderSpec(
    SourceFile("reader.py", "from inside.static_analysis.reader import read"),
    {},
    ChildLimits(30.0, 512 * _MEGABYTE),
    100_000,
)
#: Size limits for all files together and for one file. They exceed the reader's limits slightly, so that it reports
#: them.
_MAX_TOTAL_CHARACTERS, _MAX_FILE_CHARACTERS = 1_000_001, 300_001
#: The names of a responder's functions.
_RESPONDERS = ("responder", "*_responder")


class FunctionCaller(Protocol):
    """Calls functions inside the sandbox. Implemented by the trial runner."""

    def call_functions(
        self, module: ResponderSpec, calls: Sequence[FunctionCall], seed: int, meter: JobMeter
    ) -> CallResults:
        """Call a module's functions in sequence in a fresh child, and return their results."""


def analyse(plan: RunPlan, trials: Sequence[TrialResult], caller: FunctionCaller, meter: JobMeter) -> StaticAnalysis:
    """Return all data for the criteria that is not in the recordings.

    Raises:
        HostError: The machine failed.
    """
    assignment = plan.assignment
    answers: dict[str, SourceAnswers] = {}
    call_results: dict[str, CallResults] = {}
    checks: dict[tuple[str, int], CallResult] = {}
    # The instructor's checks have their own budget, separate from the submission's.
    check_meter = JobMeter(meter.limits, meter.heartbeat)
    # Source rules come last, because they consider which code was executed.
    for criterion in sorted(assignment.criteria, key=lambda each: isinstance(each, SourceRules)):
        if isinstance(criterion, SourceRules) and criterion.part in plan.read_as:
            answers[criterion.id] = _read_source_answers(criterion, plan, caller, meter)
        elif isinstance(criterion, Functions) and plan.functions is not None:
            call_results[criterion.id] = _call_functions(criterion, plan.functions, plan.child_seed, caller, meter)
        elif isinstance(criterion, PythonCheck):
            for index, trial in enumerate(trials):
                if not criterion.scenarios or trial.scenario in criterion.scenarios:
                    checked_trial = use_robot_recording(criterion.robot, trial)
                    checks[criterion.id, index] = _run_check(criterion, checked_trial, assignment, caller, check_meter)
    sandbox = next((each.sandbox for each in call_results.values()), "")
    return StaticAnalysis(answers, plan.flags, call_results, checks, sandbox, plan.missing)


def to_json_trial(trial: TrialResult) -> dict[str, Any]:
    """Return a trial's recording as JSON values, the input of an instructor's check."""
    recording = trial.recording
    return {
        "scenario": trial.scenario,
        "index": trial.index,
        "light_noise": trial.light_noise,
        "motor_noise": trial.motor_noise,
        "background": recording.background,
        "start": _to_json_pose(recording.start),
        "end": _to_json_pose(recording.end),
        "end_t": recording.end_t,
        "verdict": str(recording.verdict),
        "ticks": {name: column.tolist() for name, column in recording.ticks.to_displayed_columns().items()},
        "printed": [[line.t, line.text] for line in recording.printed],
        "spoken": [[line.t, line.text] for line in recording.spoken],
        "messages": [
            {"t": each.t, "sender": each.sender, "text": each.text, "delivered": each.delivered}
            for each in recording.messages
        ],
        "agent_messages": [
            {"t": each.t, "sender": each.sender, "receiver": each.receiver, "text": each.text}
            for each in recording.agent_messages
        ],
        "datalog": [
            [each.t, each.name, each.value, each.simtime] for each in recording.datalog if math.isfinite(each.value)
        ],
        "images": [{"t": each.t, "pose": _to_json_pose(each.pose), "truth": each.truth} for each in recording.images],
        "image_log": [[side, tick_to_seconds(recording, tick)] for side, _, tick in recording.image_log],
        "touches": [[each.t, each.what] for each in recording.touches],
        **({"partner": to_json_trial(replace(trial, recording=recording.partner))} if recording.partner else {}),
    }


def _read_source_answers(
    criterion: SourceRules, plan: RunPlan, caller: FunctionCaller, meter: JobMeter
) -> SourceAnswers:
    entries = _list_entry_points(plan.assignment) if criterion.part == "responder" else ()
    rules = {
        "uses": criterion.uses,
        "avoids": criterion.avoids,
        "in_loop": criterion.in_loop,
        "defines": criterion.defines,
        "shown": SPEECH,
        "entries": (*criterion.defines, *entries),
    }
    executed = plan.executed_statements.get(criterion.part)
    executed_places = sorted(executed.places) if executed is not None and executed.places else None
    calls = [FunctionCall("read", [list(_read_files(criterion.part, plan)), rules, executed_places])]
    call_results = caller.call_functions(_READER, calls, 0, meter)
    fault = call_results.fault or call_results.returned[0].fault
    if fault is not None:
        return SourceAnswers(error=Sentence("it cannot be analysed (%(fault)s)", fault=describe_fault(fault)))
    return SourceAnswers.read(call_results.returned[0].value, criterion)


def _read_files(part: Part, plan: RunPlan) -> Iterator[Mapping[str, Any]]:
    """Yield the part, and the submitted files that it can import.

    A responder may import any of them. They are passed as bytes, because they declare their own encoding.
    """
    yield {"name": "", **{kind: content[:_MAX_FILE_CHARACTERS] for kind, content in plan.read_as[part].items()}}
    spec = plan.program if part == "program" else plan.functions
    remaining_characters = _MAX_TOTAL_CHARACTERS - (len(spec.code.text) if spec is not None else 0)
    for name, kind, content in _list_neighbour_files(part, plan):
        if remaining_characters > 0:
            yield {"name": name, kind: content[:_MAX_FILE_CHARACTERS]}
        remaining_characters -= len(content)


def _list_neighbour_files(part: Part, plan: RunPlan) -> Iterator[tuple[str, str, str]]:
    if part == "responder":
        for name, data in plan.own_files.items():
            if name.lower().endswith(".py"):
                yield name, "bytes", data.decode("latin-1")
    elif plan.program is not None:
        for module, text in plan.program.modules.items():
            if f"{module}.py" in plan.own_files:
                yield f"{module}.py", "text", text


def _list_entry_points(assignment: Assignment) -> Iterator[str]:
    """Yield the names of a responder's functions that are called from outside."""
    yield from _RESPONDERS
    if assignment.training is not None:
        yield assignment.training.function
    for criterion in assignment.criteria:
        if isinstance(criterion, Functions):
            yield from {criterion.function, *(call.function for call in criterion.calls)} - {""}


def _call_functions(
    criterion: Functions, functions: ResponderSpec, seed: int, caller: FunctionCaller, meter: JobMeter
) -> CallResults:
    call_seed = RandomStream(seed, f"calls {criterion.id}").integer(0) >> 1
    return caller.call_functions(functions, list_calls(criterion), call_seed, meter)


def _run_check(
    criterion: PythonCheck, trial: TrialResult, assignment: Assignment, caller: FunctionCaller, meter: JobMeter
) -> CallResult:
    limits = assignment.limits
    check = ResponderSpec(
        SourceFile(criterion.file, assignment.given_parts[criterion.file]),
        assignment.given,
        ChildLimits(limits.responder_cpu, limits.responder_memory_mb * _MEGABYTE),
        limits.output_bytes,
    )
    call_results = caller.call_functions(check, [FunctionCall("check", [to_json_trial(trial)])], trial.seed, meter)
    return call_results.returned[0] if call_results.returned else CallResult(fault=call_results.fault)


def _to_json_pose(pose: Pose) -> dict[str, float]:
    return {"x": pose.x, "y": pose.y, "heading": pose.heading}
