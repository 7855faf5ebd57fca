"""The state of a child as the kernel reports it: processor time, time queued, wait status, folder content.

All functions only read. None relies on the process itself.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import signal
from pathlib import Path


def read_busy_seconds(pid: int) -> float:
    """Return the seconds that a process has run or waited for a processor; infinity if unknown."""
    try:
        return sum(_read_schedule(pid))
    except (OSError, ValueError):
        return math.inf


def read_queued_seconds() -> float:
    """Return the seconds that this thread has waited for a processor; 0 if unknown."""
    try:
        return _read_schedule("thread-self")[1]
    except (OSError, ValueError):
        return 0.0


def is_runnable(pid: int) -> bool:
    """Return whether the process is runnable: then the machine is busy, and the program isn't waiting."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (OSError, IndexError):
        return False
    return state == "R"


def find_signal_name(number: int) -> str:
    """Return the name of a signal, or its number."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def measure_folder(folder: Path, max_files: int) -> tuple[int, int]:
    """Return the total size in bytes and the number of files in a flat folder, up to ``max_files`` files."""
    size = count = 0
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in itertools.islice(entries, max_files):
            count += 1
            with contextlib.suppress(OSError):
                size += entry.stat(follow_symlinks=False).st_size
    return size, count


def _read_schedule(process: int | str) -> tuple[float, float]:
    """Return the seconds that a process has run and has waited for a processor, from ``/proc``."""
    run_time, queue_time, _ = Path(f"/proc/{process}/schedstat").read_text().split()
    return int(run_time) / 1e9, int(queue_time) / 1e9
