"""What the kernel tells of a child: its time on processors and in their queue, how it ended, what is in its folder.

Nothing here is asked of the process itself, and nothing is done to it.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import signal
from pathlib import Path


def busy_seconds(pid: int) -> float:
    """What it has run, and waited for a processor; endless where the kernel does not say."""
    try:
        return sum(_scheduled(pid))
    except (OSError, ValueError):
        return math.inf


def seconds_queued() -> float:
    """For how long this thread has stood in the queue for a processor; 0 where the kernel does not say."""
    try:
        return _scheduled("thread-self")[1]
    except (OSError, ValueError):
        return 0.0


def runnable(pid: int) -> bool:
    """Whether it would run if it got a processor: then a busy machine is to blame, not the program."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (OSError, IndexError):
        return False
    return state == "R"


def signal_name(number: int) -> str:
    """What the signal is called, or its number."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def folder_content(folder: Path, most: int) -> tuple[int, int]:
    """The bytes and the number of the files in a flat folder, of at most ``most`` files."""
    size = count = 0
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in itertools.islice(entries, most):
            count += 1
            with contextlib.suppress(OSError):
                size += entry.stat(follow_symlinks=False).st_size
    return size, count


def _scheduled(process: int | str) -> tuple[float, float]:
    """Seconds that a process has run, and stood in the queue for a processor, by ``/proc``."""
    run, queued, _ = Path(f"/proc/{process}/schedstat").read_text().split()
    return int(run) / 1e9, int(queued) / 1e9
