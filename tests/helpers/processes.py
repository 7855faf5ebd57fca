"""Processes that tests start, watch and kill: the command line in the background, and all that hangs on a process."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

Found = TypeVar("Found")
PATIENCE = 120
COMMAND = [sys.executable, "-c", "from service.cli import main; main()"]


def until(look: Callable[[], Found | None], what: str = "it does not come") -> Found:
    """The first thing that ``look`` finds which is true."""
    begun = time.monotonic()
    while not (found := look()):
        assert time.monotonic() - begun < PATIENCE, what
        time.sleep(0.05)
    return found


def alive(pid: int) -> bool:
    """Whether the process runs; one that has ended and is not yet collected does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


@contextmanager
def robomark(*arguments: str | Path, **environment: str) -> Iterator[subprocess.Popen[str]]:
    """A command that runs meanwhile, with its output in pipes; killed at the end if it still runs."""
    with subprocess.Popen(
        [*COMMAND, *map(str, arguments)],
        env=os.environ | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            yield process
        finally:
            process.kill()
