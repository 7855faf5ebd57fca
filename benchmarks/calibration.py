"""Calibration, for comparing machines: a loop of ten million additions, and a round trip over a socket pair."""

from __future__ import annotations

import os
import socket

from benchmarks.measurement import (
    MICROSECONDS,
    SECONDS,
    Measurement,
    measure_cpu_seconds,
    measure_median,
    measure_wall_seconds,
)

LOOP = "a Python loop of ten million additions, CPU"
#: At module level, where variables are looked up by name, as in ``python -c``.
_LOOP = compile("total = 0\nfor number in range(10_000_000):\n    total += number\n", "loop", "exec")
_TURNS = 5000
_BYTES = 80


def measure(times: int) -> list[Measurement]:
    """Measure the loop, which is the scale between two machines, and the round trip, which shows the kernel's share."""
    return [
        Measurement(LOOP, measure_loop(times), SECONDS),
        Measurement(
            f"a turn of {_BYTES} bytes on a bare socket pair, both ends",
            measure_median(times, lambda: measure_wall_seconds(_make_round_trips)) / _TURNS * 1e6,
            MICROSECONDS,
        ),
    ]


def measure_loop(times: int) -> float:
    return measure_median(times, lambda: measure_cpu_seconds(_run_loop))


def _run_loop() -> None:
    exec(_LOOP, {})


def _make_round_trips() -> None:
    """Make round trips between this process and an echo process."""
    parent_end, child_end = socket.socketpair()
    pid = os.fork()
    if pid == 0:
        parent_end.close()
        while text := child_end.recv(_BYTES):
            child_end.sendall(text)
        os._exit(0)
    child_end.close()
    for _ in range(_TURNS):
        parent_end.sendall(b"x" * _BYTES)
        parent_end.recv(_BYTES)
    parent_end.close()
    os.waitpid(pid, 0)
