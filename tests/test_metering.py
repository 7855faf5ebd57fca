"""Nothing that a child sends is kept for free: floods of every kind of frame end at the job's budget.

Each flood is one submission; what the worker holds of it afterwards is measured, not asked for.
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass

import pytest

import running
from hostile import FIND_WIRE, flood, forged
from responders.conversation import Code
from responders.function_calls import FunctionCall
from responders.notebook_play import Played, Staged
from responders.notebook_process import NotebookOrder
from responders.sandbox.meter import JobLimits, JobMeter
from responders.sandbox.running_child import ChildLimits
from running import run_program
from service.grading.rig import Rig
from sim.recording import Fault, Recording, Verdict

BUDGET = 2 << 20
BIG = "x" * 60_000


def _long(frame: str, length: int = len(BIG)) -> str:
    """A frame with its ``@`` as long as that."""
    return frame.replace("@", "x" * length)


ECHO = "def responder(text): return text\n"
NOISY = 'for i in range(100_000): print(f"PY::{i}")'
CALL = _long('{"do":"call","depth":0,"caller":"a","callee":"b","argument":"@","result":"d"}')
DEEP_LIST = "JSON::[" + "[]," * 15_000 + "[]]"


@dataclass(frozen=True)
class Flood:
    """A submission that sends without end, and how that ends."""

    name: str
    program: str
    responder: str | None = None
    verdicts: tuple[Verdict, ...] = (Verdict.OUTPUT_LIMIT,)


def _program(name: str, frame: str, *verdicts: Verdict) -> Flood:
    return Flood(name, f"{flood(frame)}flood()", None, verdicts or (Verdict.OUTPUT_LIMIT,))


def _responder(name: str, frame: str, *verdicts: Verdict) -> Flood:
    text = f"{flood(frame)}def responder(text): flood()"
    return Flood(name, 'print("PY::x")', text, verdicts or (Verdict.OUTPUT_LIMIT,))


FLOODS = [
    _program("utterances", _long('{"do":"say","text":"@"}')),
    _program("short utterances", '{"do":"say","text":"x"}'),
    _program("lines", _long('{"do":"print","text":"@"}')),
    _program("short lines", '{"do":"print","text":""}'),
    _program("messages to nobody", '{"do":"print","text":"PY::"}'),
    _program("images that are sent", '{"do":"print","text":"IMG_DATA"}'),
    _program("images that are logged", '{"do":"print","text":"image_data both"}'),
    _program("refusals", _long('{"do":"refused","what":"@","line":1}')),
    _program("refusals that differ in length", _long('{"do":"refused","what":"@","line":null}', 1000)),
    _program(
        "padded waits", '{"do":"wait",@"units":0}'.replace("@", " " * 60_000), Verdict.CPU_LIMIT, Verdict.STALLED
    ),
    _program(
        "motor commands", _long('{"do":"motor","port":"outB","polarity":"@"}'), Verdict.CPU_LIMIT, Verdict.STALLED
    ),
    _responder("lines of a responder", _long('{"do":"print","text":"@"}')),
    _responder("calls", CALL),
    _responder("refusals of a responder", _long('{"do":"refused","what":"@","line":1}')),
    _responder("naps", '{"do":"sleep","units":0}', Verdict.CPU_LIMIT, Verdict.STALLED),
    Flood("long answers", NOISY, f"def responder(text): return {BIG!r}"),
    Flood("answers of a long type", NOISY, f"long = type({BIG!r}, (), {{}})\ndef responder(text): return long()"),
    Flood("errors with long words", NOISY, f"{FIND_WIRE}def responder(text):\n    "
        + forged(_long('{"do":"answer","kind":"error","error":{"type":"@","text":"@","line":1}}', 30_000))
        + "\n    line._sent += 1\n    line.send = lambda frame: None\n    raise ValueError"),
    Flood("answers that are many objects", NOISY, f"def responder(text): return {DEEP_LIST!r}"),
    Flood("short answers", NOISY, "def responder(text): return ''"),
    Flood("short errors", NOISY, "def responder(text): raise ValueError"),
]  # fmt: skip


@pytest.fixture(autouse=True)
def _limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """So much output is allowed a trial that only the job's budget is in the way."""
    monkeypatch.setattr(running, "PROGRAM_LIMITS", ChildLimits(1.5, 128 << 20))
    monkeypatch.setattr(running, "RESPONDER_LIMITS", ChildLimits(3.0, 256 << 20))


@pytest.mark.parametrize("each", FLOODS, ids=lambda each: each.name)
def test_a_flood_ends_at_the_budget(each: Flood, rig: Rig) -> None:
    meter = JobMeter(JobLimits(kept_bytes=BUDGET))
    collaborative = each.responder if each.responder is not None or "PY::" not in each.program else ECHO
    recording = run_program(rig, each.program, responder=collaborative, output_bytes=1 << 30, meter=meter)
    assert {fault.verdict for fault in recording.faults} & set(each.verdicts), recording.faults[:3]
    assert _held(recording) < 2 * BUDGET
    assert meter.spent.kept_bytes < BUDGET + (1 << 17)


@pytest.mark.parametrize(
    "frame",
    [
        pytest.param(_long('{"do":"raised","error":{"type":"E","text":"@","line":null}}'), id="cells that raise"),
        pytest.param(_long('{"do":"note","text":"@","line":null}'), id="notes"),
        pytest.param(_long('{"do":"print","text":"@"}'), id="lines"),
        pytest.param(CALL, id="calls"),
        pytest.param(
            _long('{"do":"magic","name":"sim_magic","arguments":"","body":"@","line":null,"missing":null}'), id="magics"
        ),
        pytest.param(_long('{"do":"refused","what":"@","line":null}'), id="refusals"),
    ],
)
def test_a_flood_of_a_notebook_ends_at_the_budget(frame: str, rig: Rig) -> None:
    meter = JobMeter(JobLimits(kept_bytes=BUDGET))
    order = NotebookOrder("n.ipynb", (f"{flood(frame)}flood()",), {}, running.RESPONDER_LIMITS, 1 << 30, 1)
    played = rig.play(order, _NoStage(), meter)
    assert played.stopped is not None
    assert played.stopped.verdict is Verdict.OUTPUT_LIMIT
    assert _held(played) < 2 * BUDGET


def test_a_flood_while_functions_are_called_ends_at_the_budget(rig: Rig) -> None:
    meter = JobMeter(JobLimits(kept_bytes=BUDGET))
    code = Code("responder.py", f"def f(): return {'x' * 50_000!r}")
    called = rig.call(code, {}, [FunctionCall("f")] * 200, running.RESPONDER_LIMITS, 1 << 30, 1, meter)
    faults = [returned.fault for returned in called.returned if returned.fault is not None]
    assert faults[0].verdict is Verdict.OUTPUT_LIMIT
    assert _held(called.returned) < 2 * BUDGET


def test_all_trials_of_a_job_have_one_budget(rig: Rig) -> None:
    meter = JobMeter(JobLimits(kept_bytes=BUDGET))
    program = f"print({'x' * 40_000!r})\n" * 20
    verdicts = [run_program(rig, program, meter=meter).verdict for _ in range(4)]
    assert verdicts == [Verdict.FINISHED] * 2 + [Verdict.OUTPUT_LIMIT] * 2


def test_a_log_file_is_paid_for_too(rig: Rig) -> None:
    meter = JobMeter(JobLimits(kept_bytes=BUDGET))
    responder = "open('logger.txt', 'w').write('x' * 900_000)\n" + ECHO
    recordings = [run_program(rig, "pass", responder=responder, meter=meter) for _ in range(3)]
    assert [len(each.responder_log) for each in recordings] == [900_000, 900_000, 0]
    assert recordings[2].verdict is Verdict.OUTPUT_LIMIT


def test_what_honest_programs_send_in_thousands_costs_nothing(rig: Rig) -> None:
    program = "for _ in range(3000): x = colorLeft.reflected_light_intensity\ntank_drive.on_for_seconds(20, 20, 1)"
    meter = JobMeter()
    assert run_program(rig, program, meter=meter).verdict is Verdict.FINISHED
    assert meter.spent.kept_bytes < 1000


class _NoStage:
    """Nothing that a notebook calls starts a robot."""

    def call(self, call: object) -> Staged:
        return Staged()

    def ran(self, recording: Recording) -> None:
        raise AssertionError

    def last(self) -> Staged:
        return Staged()


def _held(kept: Recording | Played | tuple[object, ...]) -> int:
    """Bytes of everything that hangs on it."""
    return len(pickle.dumps(kept))


def test_the_budget_is_named_in_the_fault(rig: Rig) -> None:
    meter = JobMeter(JobLimits(kept_bytes=BUDGET))
    fault: Fault = run_program(rig, FLOODS[2].program, output_bytes=1 << 30, meter=meter).faults[0]
    assert "all trials together said more than 2 MB" in fault.message
