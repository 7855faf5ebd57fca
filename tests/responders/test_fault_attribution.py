"""How the end of a child is attributed: its own actions to the submission, outside causes to the host.

A child that is killed from outside is run again, alone. An exception in our own code becomes a verdict and a sentence.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from benchmarks.harness.process_tree import find_children
from hostile import FIND_WIRE, forged, packed
from paths import HELPERS, ROOT
from processes import until
from responders.bridge import Bridge
from responders.conversation import Conversation
from responders.responder_process import ResponderProcess
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import JobLimits, JobMeter
from responders.source_file import SourceFile
from running import run_program
from service.grading.grader import grade
from service.grading.grader_locks import GraderLocks
from service.grading.trial_runner import TrialRunner
from sim.errors import Cancelled, HostError
from sim.recording import Verdict
from submissions.assignment.reader import find_assignment
from submissions.submission import Submission

HONEST = 'from time import sleep\nprint("PY::a")\nsleep(1)\ntank_drive.on_for_seconds(20, 20, 1)\n'
BUSY = f"sum(range(10**7))\n{HONEST}"
ECHO = "def responder(text): return text\n"
COUNTS = """
from time import sleep
from ev3dev2_glue import pyState
print('PY::x')
sleep(1)
print(len(pyState()['messages']))
"""
_STOPPING = {signal.SIGSTOP, signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU}
#: The effect of some signals. All others end the program with an error, or have no effect.
_VERDICTS: dict[int, Verdict] = {signal.SIGXCPU: Verdict.CPU_LIMIT, signal.SIGSYS: Verdict.SANDBOX_VIOLATION}


@pytest.mark.parametrize("number", sorted(set(range(1, 65)) - _STOPPING - {32, 33}))
def test_a_program_that_signals_itself_is_at_fault(number: int, runner: TrialRunner) -> None:
    recording = run_program(runner, f"import os\nos.kill(os.getpid(), {number})\nimport time; time.sleep(1)")
    expected = {_VERDICTS[number]} if number in _VERDICTS else {Verdict.FINISHED, Verdict.PROGRAM_ERROR}
    assert recording.verdict in expected, recording.faults
    assert "again" not in "".join(fault.message for fault in recording.faults)


@pytest.mark.parametrize(
    "responder",
    [
        "import os\nos.kill(os.getpid(), 40)\n",
        "import os\ndef responder(text): os.kill(os.getpid(), 40)\n",
        "import os\ndef responder(text): os._exit(3)\n",
        "import ctypes\ndef responder(text): ctypes.string_at(0)\n",
        "import os\ndef responder(text):\n    os.close(3)\n    import select; select.select([], [], [], 0.1)\n",
    ],
)
def test_a_responder_that_ends_itself_is_at_fault(responder: str, runner: TrialRunner) -> None:
    recording = run_program(runner, HONEST, responder=responder)
    assert [fault.verdict for fault in recording.faults] == [Verdict.RESPONDER_ERROR]


class _Killer:
    """Kills the newest child of the zygotes, up to a given number of times."""

    def __init__(self, times: int) -> None:
        self.left = times
        self._killed: set[int] = set()

    def __call__(self) -> None:
        zygotes = (zygote for doorkeeper in find_children(os.getpid()) for zygote in find_children(doorkeeper))
        for child in (child for zygote in zygotes for child in find_children(zygote)):
            if self.left and child not in self._killed:
                self._killed.add(child)
                self.left -= 1
                os.kill(child, signal.SIGKILL)


@pytest.fixture
def plain_runner() -> Iterator[TrialRunner]:
    """Yield a runner without bubblewrap, which would change the child's process id."""
    from responders.sandbox.isolation import Isolation

    with TrialRunner(Sandboxes(Isolation(bubblewrap=False))) as made:
        yield made


@pytest.mark.long
@pytest.mark.parametrize("times", [1, 2])
def test_a_child_that_is_killed_from_outside_is_run_again(times: int, plain_runner: TrialRunner) -> None:
    undisturbed = run_program(plain_runner, BUSY, responder=ECHO)
    killer = _Killer(times)
    meter = JobMeter(heartbeat=killer)
    recording = run_program(plain_runner, BUSY, responder=ECHO, meter=meter)
    assert killer.left == 0
    assert (recording.verdict, recording.sha256) == (Verdict.FINISHED, undisturbed.sha256)


def test_what_was_spent_on_a_killed_run_is_given_back(plain_runner: TrialRunner) -> None:
    program = f"print({'x' * 40_000!r})\nsum(range(10**7))"
    meter = JobMeter(JobLimits(kept_bytes=60_000), heartbeat=_Killer(2))
    assert run_program(plain_runner, program, meter=meter).verdict is Verdict.FINISHED


def test_a_child_that_is_killed_whenever_it_runs_alone_is_to_blame(plain_runner: TrialRunner) -> None:
    recording = run_program(plain_runner, BUSY, responder=ECHO, meter=JobMeter(heartbeat=_Killer(1000)))
    assert recording.verdict is Verdict.MEMORY_LIMIT
    assert "with nothing else running" in recording.faults[0].message


def test_whoever_runs_alone_waits_for_the_others_and_lets_nobody_begin(tmp_path: Path) -> None:
    slots = GraderLocks(tmp_path)
    other = """
import sys, time
from pathlib import Path
from service.grading.grader_locks import GraderLocks
folder = Path(sys.argv[1])
with getattr(GraderLocks(folder), sys.argv[2])(lambda: None):
    (folder / sys.argv[3]).touch()
    sys.stdin.read()
(folder / (sys.argv[3] + " ended")).touch()
"""

    def start(how: str, name: str) -> subprocess.Popen[str]:
        arguments = [sys.executable, "-c", other, str(tmp_path), how, name]
        return subprocess.Popen(arguments, stdin=subprocess.PIPE, text=True)

    beside = start("shared_lock", "beside")
    until((tmp_path / "beside").exists)
    with slots.shared_lock(lambda: None):
        alone = start("exclusive_lock", "alone")
        beside.communicate("")
        assert not (tmp_path / "alone").exists()
    until((tmp_path / "alone").exists)
    heartbeats: list[None] = []

    def count() -> None:
        heartbeats.append(None)
        if len(heartbeats) == 3:
            raise Cancelled("the lease is lost")

    with pytest.raises(Cancelled), slots.shared_lock(count):
        raise AssertionError
    alone.communicate("")
    with slots.shared_lock(lambda: None):
        pass


def _raising(error: Exception) -> Callable[..., Any]:
    def raise_it(*_: object, **__: object) -> None:
        raise error

    return raise_it


#: Code of ours that may raise an exception while it handles a child's data, and a program that reaches it.
_STUMBLES = [
    pytest.param(Bridge, "_execute_actions", "left_motor = tank_drive.on(5, 5)", None, id="a frame of the program's"),
    pytest.param(Bridge, "_say", "from ev3dev2.sound import Sound\nSound().speak('x')", None, id="an utterance"),
    pytest.param(Bridge, "_print", "print('x')", None, id="a line"),
    pytest.param(ResponderProcess, "_parse_answer", "print('PY::x')", ECHO, id="an answer"),
    pytest.param(Conversation, "deliver", "from time import sleep\nprint('PY::x')\nsleep(1)", ECHO, id="a delivery"),
]


@pytest.mark.parametrize(("where", "what", "program", "responder"), _STUMBLES)
def test_what_our_code_stumbles_over_is_a_verdict(
    where: type, what: str, program: str, responder: str | None, runner: TrialRunner, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(where, what, _raising(ValueError("41 is not a valid Signals")))
    recording = run_program(runner, program, responder=responder)
    (fault,) = recording.faults
    assert (fault.verdict, fault.staff) == (Verdict.SANDBOX_VIOLATION, "ValueError: 41 is not a valid Signals")
    assert "Signals" not in fault.message


@pytest.mark.parametrize("error", [OSError("no space left"), MemoryError(), HostError("the camera is gone")])
def test_what_the_machine_stumbles_over_is_not(
    error: Exception, runner: TrialRunner, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Bridge, "_print", _raising(error))
    with pytest.raises(type(error)):
        run_program(runner, "print('x')")


@pytest.mark.parametrize(
    "program",
    [
        FIND_WIRE + packed((2, 0, 2, 5, 1e308)),
        FIND_WIRE + packed((2, 0, 3, 0, -1e308), (2, 0, 4, 4, 1e308)),
        FIND_WIRE + forged('{"do":"end","error":{"type":"\\\\ud800","text":"\\\\udfff","line":9,"file":null}}'),
        FIND_WIRE + forged('{"do":"refused","what":"\\\\ud800\\\\u0000","line":null,"file":null}'),
        "print('Light_left: ' + '9' * 400 + ' 1e999')\nprint('Gyro: nan inf')",
        "print('\\ud800\\x00')\nprint('PY::\\ud800')",
        "raise Exception('\\ud800\\x00' * 1000)",
    ],
)  # fmt: skip
def test_numbers_and_texts_at_the_edge_are_no_surprise(program: str, runner: TrialRunner) -> None:
    recording = run_program(runner, f"{program}\nfrom time import sleep\nsleep(2)", responder=ECHO)
    assert all(not fault.staff for fault in recording.faults)
    str(recording).encode("utf-8", "strict")


@pytest.mark.parametrize(
    "answer",
    [
        '"JSON::" + "[" * 900 + "]" * 900',
        '"JSON::" + "[" * 20_000 + "]" * 20_000',
        '"JSON::" + "9" * 5000',
        '"JSON::1e999"',
        '"JSON::" + chr(0xd800)',
        '\'JSON::{"a": "\\\\ud800"}\'',
    ],
)
def test_answers_at_the_edge_are_delivered_or_malformed(answer: str, runner: TrialRunner) -> None:
    recording = run_program(runner, COUNTS, responder=f"def responder(text): return {answer}")
    assert {fault.verdict for fault in recording.faults} <= {Verdict.PROTOCOL_ERROR}
    assert recording.printed[-1].text == str(1 - len(recording.faults))


NAP = "import select\nselect.select([], [], [], 0.9)\n"


def test_naps_in_all_trials_together_are_counted(runner: TrialRunner) -> None:
    meter = JobMeter(JobLimits(sleep_seconds=1.0))
    verdicts = [run_program(runner, NAP, meter=meter).verdict for _ in range(6)]
    assert verdicts[:2] == [Verdict.FINISHED] * 2
    assert verdicts[-1] is Verdict.STALLED
    assert meter.spent.sleep_seconds < 2.5


@pytest.mark.long
@pytest.mark.parametrize(
    "responder",
    [
        f"{NAP}def responder(text): return text",
        "import select\ndef responder(text):\n    for _ in range(90): select.select([], [], [], 0.01)\n    return text",
        *(
            pytest.param(text, marks=pytest.mark.long)
            for text in (
                f"def responder(text):\n    {NAP.splitlines()[0]}\n    {NAP.splitlines()[1]}\n    return text",
                "import signal\ndef responder(text):\n    signal.setitimer(signal.ITIMER_REAL, 0.9)\n"
                "    signal.signal(signal.SIGALRM, lambda *_: None)\n    signal.pause()\n    return text",
                "import select\ndef responder(text):\n    select.poll().poll(900)\n    return text",
            )
        ),
    ],
)
def test_a_responder_sleeps_at_the_expense_of_all_trials(responder: str, runner: TrialRunner) -> None:
    meter = JobMeter(JobLimits(sleep_seconds=0.7))
    verdicts = [run_program(runner, HONEST, responder=responder, meter=meter).verdict for _ in range(4)]
    assert verdicts[0] is Verdict.FINISHED
    assert verdicts[-1] is Verdict.STALLED


def test_a_grade_has_what_its_trials_cost_and_is_compared_without(runner: TrialRunner) -> None:
    assignment = find_assignment("echo-responder")
    program = SourceFile("robot.py", f"{NAP}print('PY::x')\n")
    submission = Submission("ada", program, SourceFile("responder.py", ECHO))
    first, second = (grade(submission, assignment, runner=runner) for _ in range(2))
    cost = first.cost
    assert cost is not None
    assert cost.spent is not None
    assert cost.limits.cpu_seconds == assignment.limits.compute_total_cpu(len(first.trials))
    assert cost.limits.sleep_seconds == assignment.limits.all_sleep
    # The sleep, minus the free half second of each process.
    assert 0.2 * len(first.trials) < cost.spent.sleep_seconds < cost.limits.sleep_seconds
    assert 0 < cost.spent.cpu_seconds < cost.limits.cpu_seconds
    assert 256 < cost.spent.kept_bytes < cost.limits.kept_bytes
    assert second.cost is not None
    assert (second.marks, second.criteria) == (first.marks, first.criteria)
    assert replace(second, trials=()) == replace(first, trials=())
    assert second.cost != cost


def test_computing_in_all_trials_together_is_counted(runner: TrialRunner) -> None:
    meter = JobMeter(JobLimits(cpu_seconds=0.5))
    recordings = [run_program(runner, "sum(range(10**7))", meter=meter) for _ in range(8)]
    assert recordings[0].verdict is Verdict.FINISHED
    assert recordings[-1].verdict is Verdict.CPU_LIMIT
    assert "all trials together" in recordings[-1].faults[0].message


def test_honest_trials_sleep_next_to_nothing(runner: TrialRunner) -> None:
    meter = JobMeter()
    for _ in range(5):
        run_program(runner, HONEST, responder=ECHO, meter=meter)
    assert meter.spent.sleep_seconds < 0.5


_STARVED = textwrap.dedent("""
    from responders.sandbox.meter import JobLimits, JobMeter
    from running import run_program
    from service.grading.trial_runner import TrialRunner
    program = "while True:\\n    colorLeft.reflected_light_intensity\\n    time.sleep(0.01)\\n"
    with TrialRunner() as runner:
        meter = JobMeter(JobLimits(sleep_seconds=4.0))
        print(run_program(runner, "import time\\n" + program, seconds=6, meter=meter).verdict.value)
""")


@pytest.mark.long
def test_a_worker_that_waits_for_a_processor_itself_calls_nobody_asleep() -> None:
    """It takes several times as long as a program may sleep."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(6)]
    try:
        ended = subprocess.run(
            ["nice", "-n", "10", sys.executable, "-c", _STARVED],
            env=os.environ | {"PYTHONPATH": str(HELPERS)},
            cwd=ROOT,
            capture_output=True,
            text=True,
            timeout=500,
            check=True,
        )
    finally:
        for each in busy:
            each.kill()
            each.wait()
    assert ended.stdout.strip() == Verdict.TIME_LIMIT.value
