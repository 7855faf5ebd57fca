"""Reads the logger.txt that a process has written. All other files are deleted with the folder.

``trial.py`` decides when the process has ended and how the log is used.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

from responders.faults import build_stop_fault
from responders.sandbox.meter import ChildStopped, JobMeter
from sim.recording import Fault

LOG_FILE = "logger.txt"
_LOG_BYTES = 1 << 20


def read_log(folder: Path, meter: JobMeter, process_name: str = "responder") -> tuple[str, Fault | None]:
    """Return the content of logger.txt in the folder of an ended process, and the fault if it is unreadable.

    Only a regular file is read, never a link. The size is capped and charged to the meter.
    """
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
        meter.charge_bytes(len(data))
    except ChildStopped as stop:
        return "", build_stop_fault(stop, process_name, 0)
    return data.decode("utf-8", "replace"), None
