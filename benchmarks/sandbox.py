"""Costs and precision of the sandbox, from the fork of a child to its end, with their budgets.

Times are real times, as medians and 95th percentiles. On a busy machine they mostly show its load.
"""

from __future__ import annotations

import functools
import mmap
import os
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.measurement import (
    KIBIBYTES,
    MEGABYTES,
    MILLISECONDS,
    SECONDS,
    Measurement,
    measure_wall_seconds,
    median,
)
from responders import wire
from responders.sandbox.inside import grants, lockdown
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import ChildStopped
from responders.sandbox.roles import ChildRole
from responders.sandbox.running_child import ChildLimits
from responders.sandbox.served_child import ServedChild
from sim.recording import TICK, Verdict

_LIMITS = {"robot": ChildLimits(2, 128 << 20), "responder with libraries": ChildLimits(2, 512 << 20)}
_SCHEMAS = {"robot": wire.ROBOT, "responder with libraries": wire.RESPONDER}
_CPU_LIMIT, _STALLED, _OUTPUT = 0.5, 5.0, 65536
_ECHO = "def responder(text): return text"
#: Counts its printed bytes in a file that remains after its end.
_FLOOD = """
import mmap, os
os.ftruncate(fd := os.open("count", os.O_RDWR | os.O_CREAT), 8)
count = mmap.mmap(fd, 8)
said = 0
while True:
    print("x" * 1000)
    said += 1001
    count[:] = said.to_bytes(8, "little")
"""
_WORKER = """
from responders.sandbox.manager import Sandboxes
from responders.sandbox.running_child import ChildLimits
from sim.recording import TICK
sandboxes = Sandboxes()
child = sandboxes.spawn("robot", ChildLimits(60, 64 << 20))
child.send({"name": "robot.py", "text": "while True: pass", "seed": 1, "preamble": "none", "sensors": {}, "modules": {},
            "tick": TICK})
print(child._pid, flush=True)
input()
"""


def measure(_times: int) -> list[Measurement]:
    """Measure the sandbox, in about twenty seconds."""
    with Sandboxes() as sandboxes, sandboxes.open_private_folder() as folder:
        cold_seconds = measure_wall_seconds(lambda: _spawn(sandboxes, "responder with libraries").close())
        light_samples = _collect_samples(100, lambda: _time_until_locked(sandboxes, "robot"))
        heavy_samples = _collect_samples(100, lambda: _time_until_locked(sandboxes, "responder with libraries"))
        answer_samples = _collect_samples(50, lambda: _time_until_answer(sandboxes, folder))
        end_samples = _collect_samples(100, lambda: _time_until_gone(sandboxes))
        turn_samples = _time_turns(sandboxes, folder)
        lockdown_seconds = _collect_samples(50, _time_lockdown)
        private_memory, memory_share = _measure_memory(sandboxes, folder)
        cpu_overshoot = max(
            _measure_cpu_overshoot(sandboxes, text) for text in ("while True: pass", "sum(range(10**12))")
        )
        stall_overshoot = _measure_stall_overshoot(sandboxes)
        output_overshoot = _measure_output_overshoot(sandboxes, folder)
    return [
        _build_row("fork to locked, robot", light_samples, 10),
        _build_row("fork to locked, responder with scikit-learn", heavy_samples, 15, 8),
        _build_row("fork to first answer, responder", answer_samples, 20),
        _build_row("Landlock and the filter alone", lockdown_seconds, 5),
        _build_row("message and answer", turn_samples, 0.2),
        _build_row("kill and reap, responder", end_samples, 15),
        Measurement("sandbox: zygote with scikit-learn, cold start", cold_seconds, SECONDS, 5),
        Measurement("sandbox: memory of an idle responder's own, one of ten", private_memory, MEGABYTES, 5),
        Measurement("sandbox: its share of all memory", memory_share, MEGABYTES, 20),
        Measurement("sandbox: CPU beyond the limit", 1000 * cpu_overshoot, MILLISECONDS, 100),
        Measurement("sandbox: waiting beyond the limit", 1000 * stall_overshoot, MILLISECONDS, 100),
        Measurement("sandbox: output beyond the limit", output_overshoot / 1024, KIBIBYTES, 128),
        Measurement("sandbox: worker killed, until nothing is left", _time_until_nothing_left(), SECONDS, 1),
    ]


def _build_row(title: str, seconds: list[float], budget: float, beyond: float | None = None) -> Measurement:
    sorted_seconds = sorted(seconds)
    late_seconds = sorted_seconds[len(sorted_seconds) * 95 // 100]
    return Measurement(
        f"sandbox: {title}",
        1000 * median(sorted_seconds),
        MILLISECONDS,
        budget,
        beyond,
        f"p95 {1000 * late_seconds:.2f} ms",
    )


def _collect_samples(count: int, sample: Callable[[], float]) -> list[float]:
    """Return samples, after a few for warm-up."""
    for _ in range(5):
        sample()
    return [sample() for _ in range(count)]


def _spawn(sandboxes: Sandboxes, role: ChildRole, folder: Path | None = None) -> ServedChild:
    return sandboxes.spawn(role, _LIMITS[role], folder)


def _time_until_locked(sandboxes: Sandboxes, role: ChildRole) -> float:
    start = time.perf_counter()
    child = _spawn(sandboxes, role)
    duration = time.perf_counter() - start
    child.close()
    return duration


def _time_until_gone(sandboxes: Sandboxes) -> float:
    return measure_wall_seconds(_spawn(sandboxes, "responder with libraries").close)


def _time_until_answer(sandboxes: Sandboxes, folder: Path) -> float:
    start = time.perf_counter()
    child = _start_echo(sandboxes, folder)
    _make_turn(child)
    duration = time.perf_counter() - start
    child.close()
    return duration


def _time_turns(sandboxes: Sandboxes, folder: Path) -> list[float]:
    child = _start_echo(sandboxes, folder)
    try:
        return _collect_samples(500, lambda: measure_wall_seconds(lambda: _make_turn(child)))
    finally:
        child.close()


def _start_echo(sandboxes: Sandboxes, folder: Path) -> ServedChild:
    child = _spawn(sandboxes, "responder with libraries", folder)
    _start(child, "responder with libraries", _ECHO)
    while child.receive(wire.RESPONDER)["do"] != "ready":
        pass
    return child


def _start(child: ServedChild, role: ChildRole, text: str) -> None:
    settings = (
        {"preamble": "none", "sensors": {}, "modules": {}, "tick": TICK} if role == "robot" else {"function": None}
    )
    child.send({"name": f"{role}.py", "text": text, "seed": 1, **settings})


def _make_turn(child: ServedChild) -> None:
    child.send({"do": "message", "t": 0, "text": "hello"})
    child.receive(wire.RESPONDER)


def _time_lockdown() -> float:
    """Return the seconds for the lockdown of a fork of this process, with the grants of a robot program."""
    rules = _prepare_rules()
    read_end, write_end = os.pipe()
    pid = os.fork()
    if pid == 0:
        start = time.perf_counter()
        lockdown.drop_capabilities()
        lockdown.forbid_new_privileges()
        lockdown.restrict_files(rules)
        lockdown.restrict_system_calls()
        os.write(write_end, struct.pack("=d", time.perf_counter() - start))
        os._exit(0)
    os.waitpid(pid, 0)
    duration: float = struct.unpack("=d", os.read(read_end, 8))[0]
    os.close(read_end)
    os.close(write_end)
    return duration


@functools.cache
def _prepare_rules() -> tuple[bytes, ...]:
    """Prepare the rules, as a zygote does once."""
    return lockdown.build_reading_rules(
        lockdown.Grants(grants.list_readable_paths([]), grants.list_listable_folders([]))
    )


def _measure_memory(sandboxes: Sandboxes, folder: Path) -> tuple[float, float]:
    """Return megabytes: a child's private memory, and its share of all when it is one of ten.

    Not every user may read these values.
    """
    children = [_start_echo(sandboxes, folder) for _ in range(10)]
    try:
        lines = Path(f"/proc/{children[0]._pid}/smaps_rollup").read_text().splitlines()  # type: ignore[attr-defined]
    except PermissionError:
        return float("nan"), float("nan")
    finally:
        for child in children:
            child.close()
    sizes = {line.split(":")[0]: int(line.split()[1]) / 1024 for line in lines if line.endswith("kB")}
    return sizes["Private_Dirty"], sizes["Pss"]


def _run_until(sandboxes: Sandboxes, text: str, limits: ChildLimits, verdict: Verdict) -> None:
    child = sandboxes.spawn("robot", limits)
    _start(child, "robot", text)
    try:
        while True:
            child.receive(wire.ROBOT)
    except ChildStopped as stop:
        child.close()
        if stop.verdict is not verdict:
            raise RuntimeError(f"expected {verdict}, but {stop.message}") from None


def _measure_cpu_overshoot(sandboxes: Sandboxes, text: str) -> float:
    cpu_before = sandboxes.children_cpu_seconds
    _run_until(sandboxes, text, ChildLimits(_CPU_LIMIT, 64 << 20), Verdict.CPU_LIMIT)
    return sandboxes.children_cpu_seconds - cpu_before - _CPU_LIMIT


def _measure_stall_overshoot(sandboxes: Sandboxes) -> float:
    text = "import select; select.select([], [], [])"
    return measure_wall_seconds(lambda: _run_until(sandboxes, text, _LIMITS["robot"], Verdict.STALLED)) - _STALLED


def _measure_output_overshoot(sandboxes: Sandboxes, folder: Path) -> int:
    """Return the bytes that a program could print after the worker had stopped reading."""
    child = _spawn(sandboxes, "robot", folder)
    _start(child, "robot", _FLOOD)
    received_bytes = 0
    while received_bytes <= _OUTPUT:
        frame = child.receive(wire.ROBOT)
        if frame["do"] != "acts":  # the lines that run, between what is printed
            received_bytes += len(frame["text"]) + 1
    child.close()
    with (folder / "count").open("rb") as file, mmap.mmap(file.fileno(), 8, prot=mmap.PROT_READ) as count:
        return int.from_bytes(count[:], "little") - _OUTPUT


def _time_until_nothing_left() -> float:
    worker = subprocess.Popen([sys.executable, "-c", _WORKER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert worker.stdout is not None
    assert worker.stdin is not None
    child = Path(f"/proc/{int(worker.stdout.readline())}")
    zygote = Path(f"/proc/{(child / 'stat').read_text().rpartition(')')[2].split()[1]}")
    start = time.perf_counter()
    worker.kill()
    worker.wait()
    while _is_running(child) or _is_running(zygote):
        time.sleep(0.0005)
    duration = time.perf_counter() - start
    worker.stdin.close()
    worker.stdout.close()
    return duration


def _is_running(process: Path) -> bool:
    try:
        return (process / "stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
