"""Programs that exceed limits: each ends at the right limit with the right verdict, and the next one runs normally."""

from __future__ import annotations

import math
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import pytest

import running
from hostile import FIND_WIRE, forged, packed
from responders.sandbox import running_child
from responders.sandbox.running_child import ChildLimits
from running import run_program
from service.grading.trial_runner import TrialRunner
from sim.recording import Recording, Verdict

HONEST_PROGRAM = 'from time import sleep\nprint("PY::hello")\nsleep(0.5)\ntank_drive.on_for_seconds(20, 20, 1)\n'
HONEST_RESPONDER = "def responder(text): return text.upper()\n"


@dataclass(frozen=True)
class Abuse:
    """A file that exceeds a limit in one of the roles, and its acceptable verdicts."""

    name: str
    text: str
    verdicts: tuple[Verdict, ...]
    role: Literal["program", "responder"] = "program"


def _abuses(verdicts: tuple[Verdict, ...], role: Literal["program", "responder"], **texts: str) -> list[Abuse]:
    return [Abuse(name.replace("_", " "), text, verdicts, role) for name, text in texts.items()]


def _frame(text: str) -> str:
    write = forged(text) if text.startswith("{") else f"os.write(3, {text.encode()!r} + b'\\n')"
    return f"{FIND_WIRE}{write}\nimport time; time.sleep(1)"


_IGNORE = "import signal\nfor n in (1, 2, 3, 14, 15, 24): signal.signal(n, signal.SIG_IGN)\n"
_WAIT_FOR_EVER = "import select; select.select([], [], [])\n"
_FILL = "import os\ndef responder(text):\n"

ABUSES = [
    *_abuses(
        (Verdict.MEMORY_LIMIT,),
        "program",
        a_list_that_grows="held = []\nwhile True: held.append('x' * 100_000)",
        bytes_all_at_once="bytes(10**12)",
        a_text_all_at_once="'a' * 2**40",
        a_number_of_many_digits="1 << (1 << 34)",
        a_bomb_of_zeros="import zlib\nsmall = zlib.compress(bytes(1 << 20), 9)\nheld = []\n"
        "while True: held.append(zlib.decompress(small))",
        shared_pages="import mmap\nheld = []\n"
        "while True: held.append(mmap.mmap(-1, 16 << 20)); held[-1].write(b'x' * (16 << 20))",
    ),
    *_abuses(
        (Verdict.MEMORY_LIMIT,),
        "responder",
        numpy_zeros_touched="import numpy\ndef responder(text):\n    held = []\n"
        "    while True: held.append(numpy.ones(10**7))",
    ),
    *_abuses(
        (Verdict.CPU_LIMIT,),
        "program",
        an_empty_loop="while True: pass",
        a_loop_that_ignores_the_limit=_IGNORE + "while True: pass",
        a_loop_in_C="sum(range(10**12))",
        a_power_in_C="9 ** 9 ** 8",
        a_catastrophic_expression="import re\nre.match(r'(a+)+$', 'a' * 40 + 'b')",
        a_storm_of_timers="import signal\nsignal.signal(signal.SIGALRM, lambda *_: None)\n"
        "signal.setitimer(signal.ITIMER_REAL, 1e-5, 1e-5)\nwhile True: pass",
        a_loop_that_catches_everything="while True:\n    try:\n        while True: pass\n"
        "    except BaseException: pass",
        a_sort_that_never_ends="class E:\n    def __lt__(self, other):\n        while True: pass\nsorted([E(), E()])",
    ),
    *_abuses(
        (Verdict.CPU_LIMIT,),
        "responder",
        a_matrix_product_without_end="import numpy\na = numpy.ones((900, 900))\n"
        "def responder(text):\n    while True: a @ a",
        a_module_that_never_loads="while True: pass",
    ),
    *_abuses(
        (Verdict.STALLED,),
        "program",
        sleeping_for_ever=_WAIT_FOR_EVER,
        stopping_itself="import os, signal\nos.kill(os.getpid(), signal.SIGSTOP)",
        ignoring_all_signals=_IGNORE + _WAIT_FOR_EVER,
        blocking_all_signals="import signal\nsignal.pthread_sigmask(signal.SIG_BLOCK, range(1, 65))\n" + _WAIT_FOR_EVER,
        reading_the_workers_replies="import os\nwhile True: os.read(4, 1000)",
    ),
    *_abuses(
        (Verdict.PROGRAM_ERROR,),
        "program",
        a_bomb_of_processes="import os\nwhile True: os.fork()",
        a_bomb_of_threads="import threading\nwhile True: threading.Thread(target=int).start()",
        all_descriptors="import os\nwhile True: os.dup(0)",
        all_pipes="import os\nwhile True: os.pipe()",
        endless_recursion="def f(): f()\nf()",
        recursion_past_the_stack="import sys\nsys.setrecursionlimit(10**9)\n"
        "class A:\n    def __getattr__(self, name): return getattr(self, name)\nA().x",
        a_null_pointer="import ctypes\nctypes.string_at(0)",
        an_abort="import os\nos.abort()",
        a_quit="import os, signal\nos.kill(os.getpid(), signal.SIGQUIT)",
        leaving_at_once="import os\nos._exit(0)",
        an_interrupt="raise KeyboardInterrupt",
        closing_the_wire="import os, time\nos.close(3)\ntime.sleep(1)",
        leaving_by_an_unknown_status="raise SystemExit(3)",
    ),
    *_abuses((Verdict.FINISHED,), "program", leaving_politely="import sys\nsys.exit(0)"),
    *_abuses(
        (Verdict.OUTPUT_LIMIT,),
        "program",
        a_flood_of_lines="while True: print('x' * 1000)",
        a_flood_of_errors="import sys\nwhile True: sys.stderr.write('x' * 1000)",
        a_flood_of_short_lines="while True: print('short')",
        a_flood_of_speech="while True: say('x' * 10000)",
    ),
    *_abuses(
        (Verdict.OUTPUT_LIMIT,),
        "responder",
        a_flood_of_a_responder="def responder(text):\n    while True: print('x' * 1000)",
        many_files=_FILL + "    n = 0\n    while True:\n        open(f'f{n}', 'wb').write(bytes(4 << 20)); n += 1",
        many_empty_files=_FILL + "    n = 0\n    while True:\n        os.close(os.open(f'f{n}', os.O_CREAT)); n += 1",
    ),
    *_abuses(
        (Verdict.STALLED,),
        "program",
        many_little_sleeps="import select\nwhile True: select.select([], [], [], 0.005)",
        sleeps_between_words="import select\nwhile True: select.select([], [], [], 0.005); print('x')",
        sleeps_between_questions=FIND_WIRE
        + "import select\nwhile True: select.select([], [], [], 0.005); left_motor_state = tank_drive.left_motor.state",
    ),
    *_abuses(
        (Verdict.RESPONDER_ERROR,),
        "responder",
        one_big_file=_FILL + "    open('f', 'wb').write(bytes(5 << 20))",
        files_without_a_name=_FILL + "    held = []\n    while True:\n"
        "        held.append(open('f', 'wb')); os.unlink('f'); os.write(held[-1].fileno(), b'x')",
        a_sparse_file=_FILL + "    os.ftruncate(os.open('f', os.O_CREAT | os.O_RDWR), 1 << 40)",
        nested_folders=_FILL + "    while True:\n        os.mkdir('d'); os.chdir('d')",
    ),
    *_abuses(
        (Verdict.SANDBOX_VIOLATION,),
        "program",
        a_frame_without_end="import os\nwhile True: os.write(3, b'x' * 60000)",
        noise_on_the_wire=_frame("hello"),
        a_mark=_frame('{"do":"mark","marks":10}'),
        a_verdict=_frame('{"do":"end","error":null,"verdict":"finished"}'),
        a_time=_frame('{"do":"until_said","t":99}'),
        a_frame_without_a_number=FIND_WIRE
        + 'line._write(b\'\'); os.write(3, b\'{"do":"print","text":"x"}\\n\'); import time; time.sleep(1)',
        a_number_of_the_past=FIND_WIRE + "print('x'); line._sent -= 1; print('x')",
        a_number_of_the_future=FIND_WIRE + "line._sent += 1; print('x')",
        sandbox_of_its_own=_frame('{"do":"sandbox","landlock":99,"seccomp":true,"own_user":true,"missing":null}'),
        a_responders_frame=_frame('{"do":"answer","kind":"text","text":"JSON::1"}'),
        the_same_key_twice=_frame('{"do":"print","text":"a","text":"b"}'),
        not_a_number=FIND_WIRE + packed((2, 0, 1, 3, math.nan)),
        no_such_act=FIND_WIRE + packed((4, 0, 0, 0, 0.0)),
        no_such_line=FIND_WIRE + packed((3, 0, 0, 0, -1.0)),
        acts_as_a_line=_frame('{"do":"acts","acts":[]}'),
        a_packet_without_acts=FIND_WIRE + "import os\nline._write(b''); os.write(3, bytes(16))",
        a_deep_frame=_frame("[" * 60_000),
        a_wait_of_an_age=FIND_WIRE + packed((1, 0, 0, 0, 1e16)),
        a_number_without_end=_frame('{"do":"until","port":"outB","state":"still","timeout":' + "9" * 4000 + "}"),
        an_instruction_of_32_bit_code="import ctypes, mmap\np = mmap.mmap(-1, 4096, prot=7)\n"
        "p.write(b'\\xb8\\x14\\0\\0\\0\\xcd\\x80\\xc3')\n"
        "ctypes.CFUNCTYPE(ctypes.c_long)(ctypes.addressof(ctypes.c_char.from_buffer(p)))()",
    ),
    *_abuses(
        (Verdict.SANDBOX_VIOLATION,),
        "responder",
        ready_again=FIND_WIRE
        + "def responder(text):\n    "
        + forged('{"do":"ready","error":null}')
        + "\n    return text",
        a_robots_frame=FIND_WIRE + "def responder(text):\n    " + forged('{"do":"until_said"}') + "\n    return text",
    ),
]


@pytest.fixture(scope="module")
def abused() -> Iterator[TrialRunner]:
    with TrialRunner() as runner:
        yield runner


@pytest.fixture(autouse=True)
def _small_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Use limits of tenths of seconds, which show the same as seconds would."""
    monkeypatch.setattr(running, "PROGRAM_LIMITS", ChildLimits(0.4, 64 << 20))
    monkeypatch.setattr(running, "RESPONDER_LIMITS", ChildLimits(0.6, 128 << 20))
    monkeypatch.setattr(running_child, "_STALLED_SECONDS", 1.0)


def _honest(runner: TrialRunner) -> Recording:
    return run_program(runner, HONEST_PROGRAM, responder=HONEST_RESPONDER)


@pytest.mark.long
@pytest.mark.parametrize("abuse", ABUSES, ids=lambda abuse: f"{abuse.role}: {abuse.name}")
def test_it_ends_at_its_limit_and_the_next_runs_well(abuse: Abuse, abused: TrialRunner) -> None:
    before = _honest(abused)
    program = abuse.text if abuse.role == "program" else HONEST_PROGRAM
    responder = abuse.text if abuse.role == "responder" else HONEST_RESPONDER
    recording = run_program(abused, program, responder=responder, output_bytes=100_000)
    assert recording.verdict in abuse.verdicts, [fault.message for fault in recording.faults]
    assert {fault.who for fault in recording.faults} <= {abuse.role}
    after = _honest(abused)
    assert (after.verdict, after.sha256) == (Verdict.FINISHED, before.sha256)
    assert [message.text for message in after.messages] == ["PY::hello", "PY::HELLO"]


def test_an_answer_too_many_is_noticed_when_the_next_is_due(abused: TrialRunner) -> None:
    answer = forged('{"do":"answer","kind":"text","text":"JSON::1"}')
    responder = f"{FIND_WIRE}def responder(text):\n    {answer}\n    return text\n"
    recording = run_program(abused, 'print("PY::one")\nprint("PY::two")', responder=responder)
    assert [fault.verdict for fault in recording.faults] == [Verdict.SANDBOX_VIOLATION]
    assert "where frame" in recording.faults[0].message


@pytest.mark.parametrize(
    ("frame", "role"),
    [
        ('{"do":"sleep","units":1000000000000000}', "responder"),
        ('{"do":"call","depth":0,"caller":"a","callee":"b","argument":"' + "c" * 5000 + '","result":"d"}', "responder"),
        ('{"do":"refused","what":"' + "x" * 5000 + '","line":1,"file":null}', "responder"),
        ('{"do":"refused","what":"' + "x" * 5000 + '","line":1,"file":null}', "program"),
        ('{"do":"until_said"}', "program"),
    ],
    ids=lambda value: value[:20],
)
def test_frames_without_end_are_paid_for(
    frame: str, role: str, abused: TrialRunner, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Thousands of frames per write cost the child almost nothing and the worker a lot. The worker must not grow."""
    monkeypatch.setattr(running_child, "_FRAME_CPU_SECONDS", 1e-4)
    flood = f"""{FIND_WIRE}
def flood():
    line._write(b"")
    n = line._sent
    while True:
        os.write(3, b"".join(b'{{"n":%d,' % (n + i) + {frame[1:].encode()!r} + b"\\n" for i in range(100)))
        n += 100
"""
    program = f"{flood}flood()" if role == "program" else 'print("PY::x")'
    responder = f"{flood}def responder(text): flood()" if role == "responder" else HONEST_RESPONDER
    recording = run_program(abused, program, responder=responder)
    assert [fault.verdict for fault in recording.faults] in ([Verdict.CPU_LIMIT], [Verdict.STALLED])
    assert sum(len(note) for note in recording.notes) < 100_000
    assert sum(len(call.argument) for call in recording.calls) <= 10_000 * 200


def test_answers_count_as_output(abused: TrialRunner) -> None:
    program = "for _ in range(100): print('PY::x')"
    recording = run_program(abused, program, responder="def responder(text): return 'x' * 5000", output_bytes=100_000)
    assert recording.verdict is Verdict.OUTPUT_LIMIT
    assert sum(len(message.text) for message in recording.messages) < 200_000


def test_signals_that_the_worker_ignores_end_a_program_all_the_same() -> None:
    """A shell starts background programs with these signals ignored."""
    before = signal.signal(signal.SIGQUIT, signal.SIG_IGN)
    try:
        with TrialRunner() as ignoring:
            recording = run_program(ignoring, "import os, signal\nos.kill(os.getpid(), signal.SIGQUIT)")
    finally:
        signal.signal(signal.SIGQUIT, before)
    assert recording.verdict is Verdict.PROGRAM_ERROR
