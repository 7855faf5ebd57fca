"""Reads back what a process has written to its logger.txt; every other file of its folder goes with the folder.

When a process is gone, and what becomes of the log, is the trial's.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

from responders.faults import stopped
from responders.sandbox.meter import ChildStopped, JobMeter
from sim.recording import Fault

LOG_FILE = "logger.txt"
_LOG_BYTES = 1 << 20


def read_log(folder: Path, meter: JobMeter, who: str = "responder") -> tuple[str, Fault | None]:
    """The logger.txt in a process's folder, read when it is gone: a regular file only, no link, capped and paid for."""
    directory = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fd = os.open(LOG_FILE, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=directory)
    except OSError:
        return "", None
    finally:
        os.close(directory)
    with os.fdopen(fd, "rb") as file:
        if not stat.S_ISREG(os.fstat(fd).st_mode):
            return "", None
        data = file.read(_LOG_BYTES)
    try:
        meter.keep(len(data))
    except ChildStopped as stop:
        return "", stopped(stop, who, 0)
    return data.decode("utf-8", "replace"), None
