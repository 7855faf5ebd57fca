"""One line of the table, its unit, and the ways time is taken. Says nothing of what is measured."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Unit:
    """How a value is shown, and what a machine that is twice as slow makes of it."""

    word: str
    decimals: int
    slowness: int = 0  # 1: twice as much; -1: half; 0: it says nothing of the machine
    more_is_better: bool = False

    def shown(self, value: float) -> str:
        return f"{value:,.{self.decimals}f}{self.word}"


RATIO = Unit(" times", 2)
GAIN = Unit(" times", 2, more_is_better=True)
SECONDS = Unit(" s", 3, slowness=1)
MILLISECONDS = Unit(" ms", 2, slowness=1)
MICROSECONDS = Unit(" us", 1, slowness=1)
SPEED = Unit("x real time", 0, slowness=-1, more_is_better=True)
A_MINUTE = Unit(" a minute", 0, slowness=-1, more_is_better=True)
MEGABYTES = Unit(" MB", 2)
KIBIBYTES = Unit(" KiB", 0)
COUNT = Unit("", 0)


@dataclass(frozen=True, slots=True)
class Measurement:
    """What was measured, beside what it should be."""

    what: str
    value: float
    unit: Unit
    budget: float | None = None
    beyond: float | None = None
    told: str = ""  # how it spreads

    @property
    def misses(self) -> bool:
        """Whether the budget is not kept."""
        if self.budget is None:
            return False
        return self.value < self.budget if self.unit.more_is_better else self.value > self.budget

    @property
    def gates(self) -> bool:
        """Whether it is a ratio that misses its budget: the machine is then no excuse."""
        return self.misses and self.unit in (RATIO, GAIN)


def median(values: Sequence[float]) -> float:
    return sorted(values)[len(values) // 2]


def median_of(count: int, measure: Callable[[], float]) -> float:
    """The middle one of ``count`` measurements, after one that only warms up."""
    measure()
    return median([measure() for _ in range(count)])


def cpu_seconds(work: Callable[[], object]) -> float:
    """CPU seconds of this process."""
    start = time.process_time()
    work()
    return time.process_time() - start


def wall_seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def users_environment() -> dict[str, str]:
    """As a user has it, who lets Python keep the bytecode of what it has compiled."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


def command_cpu_seconds(command: Sequence[str], environment: dict[str, str]) -> float:
    """CPU seconds of a command and of all that it waited for. Raises RuntimeError when it fails."""
    process = subprocess.Popen(
        command, env=users_environment() | environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    said = process.stderr.read()
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    process.stderr.close()
    if process.returncode:
        raise RuntimeError(f"{' '.join(command)} ends with {process.returncode}: {said}")
    return used.ru_utime + used.ru_stime
