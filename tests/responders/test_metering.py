"""No data of a child is kept without charge: floods of every kind of frame end at the job's budget.

Each flood is one submission. The memory that the worker keeps for it afterwards is measured.
"""

from __future__ import annotations

import pickle
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import running
from floods import CALL, ECHO, FLOODS, Flood, long
from hostile import flood
from notebook_builder import notebook
from responders import notebook_executor
from responders.function_calls import FunctionCall
from responders.notebook_executor import ExecutedNotebook, PlannedRun
from responders.notebook_process import NotebookSpec
from responders.sandbox.meter import JobLimits, JobMeter
from responders.sandbox.running_child import ChildLimits
from responders.source_file import SourceFile
from responders.trial import build_recording
from responders.trial_spec import ResponderSpec
from rows import quick_first
from running import run_program
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from sim.recording import Fault, LineTrace, Recording, Verdict
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission

BUDGET = 2 << 20


@pytest.fixture(autouse=True)
def _limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Allow a trial enough output that only the job's budget applies."""
    monkeypatch.setattr(running, "PROGRAM_LIMITS", ChildLimits(1.5, 128 << 20))
    monkeypatch.setattr(running, "RESPONDER_LIMITS", ChildLimits(3.0, 256 << 20))


@pytest.mark.parametrize("each", quick_first(FLOODS, quick=4), ids=lambda each: each.name)
def test_a_flood_ends_at_the_budget(each: Flood, runner: TrialRunner) -> None:
    meter = JobMeter(JobLimits(kept_bytes=BUDGET))
    collaborative = each.responder if each.responder is not None or "PY::" not in each.program else ECHO
    before = time.process_time()
    recording = run_program(runner, each.program, responder=collaborative, output_bytes=1 << 30, meter=meter)
    own_seconds = time.process_time() - before
    assert {fault.verdict for fault in recording.faults} & set(each.verdicts), recording.faults[:3]
    # Charges limit the worker's own time: for computing and frames, and for stored data.
    assert own_seconds < 3 * meter.spent.cpu_seconds + 0.3 * (meter.spent.kept_bytes >> 20) + 0.5
    assert _held(recording) < 2 * BUDGET
    assert meter.spent.kept_bytes < BUDGET + (1 << 17)


@pytest.mark.parametrize(
    "frame",
    [
        pytest.param(
            long('{"do":"raised","error":{"type":"E","text":"@","line":null,"file":null}}'), id="cells that raise"
        ),
        pytest.param(long('{"do":"note","text":"@","line":null,"file":null}'), id="notes"),
        pytest.param(long('{"do":"print","text":"@"}'), id="lines"),
        pytest.param(CALL, id="calls"),
        pytest.param(
            long('{"do":"magic","name":"sim_magic","arguments":"","body":"@","line":null,"missing":null}'), id="magics"
        ),
        pytest.param(long('{"do":"refused","what":"@","line":null,"file":null}'), id="refusals"),
    ],
)
def test_a_flood_of_a_notebook_ends_at_the_budget(frame: str, runner: TrialRunner) -> None:
    meter = JobMeter(JobLimits(kept_bytes=BUDGET))
    spec = NotebookSpec("n.ipynb", (f"{flood(frame)}flood()",), {}, running.RESPONDER_LIMITS, 1 << 30, 1)
    executed = runner.execute_notebook(spec, _NoRuns(), meter)
    assert executed.stopped is not None
    assert executed.stopped.verdict is Verdict.OUTPUT_LIMIT
    assert _held(executed) < 2 * BUDGET


def test_a_flood_while_functions_are_called_ends_at_the_budget(runner: TrialRunner) -> None:
    meter = JobMeter(JobLimits(kept_bytes=BUDGET))
    code = SourceFile("responder.py", f"def f(): return {'x' * 50_000!r}")
    module = ResponderSpec(code, {}, running.RESPONDER_LIMITS, 1 << 30)
    called = runner.call_functions(module, [FunctionCall("f")] * 200, 1, meter)
    faults = [returned.fault for returned in called.returned if returned.fault is not None]
    assert faults[0].verdict is Verdict.OUTPUT_LIMIT
    assert _held(called.returned) < 2 * BUDGET


def test_all_trials_of_a_job_have_one_budget(runner: TrialRunner) -> None:
    meter = JobMeter(JobLimits(kept_bytes=BUDGET))
    program = f"print({'x' * 40_000!r})\n" * 20
    verdicts = [run_program(runner, program, meter=meter).verdict for _ in range(4)]
    assert verdicts == [Verdict.FINISHED] * 2 + [Verdict.OUTPUT_LIMIT] * 2


def test_a_log_file_is_paid_for_too(runner: TrialRunner) -> None:
    meter = JobMeter(JobLimits(kept_bytes=BUDGET))
    responder = "open('logger.txt', 'w').write('x' * 900_000)\n" + ECHO
    recordings = [run_program(runner, "pass", responder=responder, meter=meter) for _ in range(3)]
    assert [len(each.responder_log) for each in recordings] == [900_000, 900_000, 0]
    assert recordings[2].verdict is Verdict.OUTPUT_LIMIT


def test_what_honest_programs_send_in_thousands_costs_nothing(runner: TrialRunner) -> None:
    program = "for _ in range(3000): x = colorLeft.reflected_light_intensity\ntank_drive.on_for_seconds(20, 20, 1)"
    meter = JobMeter()
    assert run_program(runner, program, meter=meter).verdict is Verdict.FINISHED
    assert meter.spent.kept_bytes < 1000


TWO_LINES = """from ev3dev2.motor import Motor, OUTPUT_B
motor = Motor(OUTPUT_B)
for _ in range(2000):
    motor.speed_sp = 1
    motor.speed_sp = 2
"""


def test_the_lines_of_a_program_are_paid_for_and_take_little_memory(runner: TrialRunner) -> None:
    meter = JobMeter()
    recording = run_program(runner, TWO_LINES, meter=meter)
    assert len(recording.places) > 4000
    assert 16 * len(recording.places) <= meter.spent.kept_bytes < 20 * len(recording.places)
    assert _held((recording.places,)) < 20 * len(recording.places)
    assert run_program(runner, TWO_LINES, meter=JobMeter(JobLimits(kept_bytes=60_000))).verdict is Verdict.OUTPUT_LIMIT


def test_a_trace_of_lines_is_a_sequence() -> None:
    trace = LineTrace()
    assert not trace
    trace.append(0.5, 3, 1)
    trace.append(1.0, (1 << 20) - 1, 0)
    assert list(trace) == [trace[0], trace[-1]] == list(trace[:]) == [(0.5, 3, 1), (1.0, (1 << 20) - 1, 0)]
    assert [each.line for each in reversed(trace)] == [(1 << 20) - 1, 3]


def test_only_the_marked_run_of_a_notebook_has_lines(
    runner: TrialRunner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Recording] = []

    def keep(*given: Any) -> Recording:
        made.append(build_recording(*given))
        return made[-1]

    monkeypatch.setattr(notebook_executor, "build_recording", keep)
    run = '%%sim_magic_preloaded -b Empty_Map -R\nprint("PY::1")\n'
    path = notebook(tmp_path / "eve.ipynb", ["def responder(text):\n    return text\n", run, run])
    assignment = find_assignment("echo-responder")
    assignment = replace(
        assignment, scenarios=tuple(replace(each, poses=each.poses[:1]) for each in assignment.scenarios[:1])
    )
    grade(read_submission(path, required_parts=assignment.parts), assignment, runner=runner)
    assert sorted({bool(each.places) for each in made}) == [False, True]


class _NoRuns:
    """A notebook environment in which no call starts a robot."""

    def plan_call(self, call: object) -> PlannedRun:
        return PlannedRun()

    def plan_standstill(self) -> PlannedRun:
        raise AssertionError

    def record_run(self, recording: Recording) -> None:
        raise AssertionError

    def plan_last_run(self) -> PlannedRun:
        return PlannedRun()


def _held(kept: Recording | ExecutedNotebook | tuple[object, ...]) -> int:
    """Return the bytes of all objects reachable from ``kept``."""
    return len(pickle.dumps(kept))


def test_the_budget_is_named_in_the_fault(runner: TrialRunner) -> None:
    meter = JobMeter(JobLimits(kept_bytes=BUDGET))
    fault: Fault = run_program(runner, FLOODS[2].program, output_bytes=1 << 30, meter=meter).faults[0]
    assert "all trials together said more than 2 MB" in fault.message
