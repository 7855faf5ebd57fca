"""Measurements: a row of the table, its unit, and ways of taking time."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Unit:
    """The format of a value, and how it depends on the speed of the machine."""

    word: str
    decimals: int
    slowness: int = 0  # 1: doubles on a machine of half the speed; -1: halves; 0: independent
    more_is_better: bool = False

    def format_value(self, value: float) -> str:
        return f"{value:,.{self.decimals}f}{self.word}"


RATIO = Unit(" times", 2)
EXPONENT = Unit("", 2)
GAIN = Unit(" times", 2, more_is_better=True)
SECONDS = Unit(" s", 3, slowness=1)
MILLISECONDS = Unit(" ms", 2, slowness=1)
MICROSECONDS = Unit(" us", 1, slowness=1)
SPEED = Unit("x real time", 0, slowness=-1, more_is_better=True)
A_MINUTE = Unit(" a minute", 0, slowness=-1, more_is_better=True)
A_SECOND = Unit(" a second", 0, slowness=-1, more_is_better=True)
MEGABYTES = Unit(" MB", 2)
KIBIBYTES = Unit(" KiB", 0)
COUNT = Unit("", 0)


@dataclass(frozen=True, slots=True)
class Measurement:
    """A measured value with its budget."""

    what: str
    value: float
    unit: Unit
    budget: float | None = None
    beyond: float | None = None
    details: str = ""  # the spread, or another detail

    @property
    def misses(self) -> bool:
        """Whether the value misses its budget."""
        if self.budget is None:
            return False
        return self.value < self.budget if self.unit.more_is_better else self.value > self.budget

    @property
    def gates(self) -> bool:
        """Whether a ratio misses its budget, which a slow machine does not explain."""
        return self.misses and self.unit in (RATIO, GAIN, EXPONENT)


def median(values: Sequence[float]) -> float:
    return sorted(values)[len(values) // 2]


def measure_median(count: int, measure: Callable[[], float]) -> float:
    """Return the median of ``count`` measurements, after a warm-up."""
    measure()
    return median([measure() for _ in range(count)])


def measure_cpu_seconds(work: Callable[[], object]) -> float:
    """Return the CPU seconds of this process for ``work``."""
    start = time.process_time()
    work()
    return time.process_time() - start


def measure_wall_seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def build_user_environment() -> dict[str, str]:
    """Return a user's environment, in which Python stores bytecode."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


def measure_command_cpu(command: Sequence[str], environment: dict[str, str]) -> float:
    """Return the CPU seconds of a command and of all processes that it waited for.

    Raises:
        RuntimeError: If the command fails.
    """
    process = subprocess.Popen(
        command,
        env=build_user_environment() | environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    errors = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    process.stderr.close()
    if process.returncode:
        raise RuntimeError(f"{' '.join(command)} ends with {process.returncode}: {errors}")
    return usage.ru_utime + usage.ru_stime
