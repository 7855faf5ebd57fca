"""Processes that tests start, watch and kill: the command line in the background, and all descendants of a process."""

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
PATIENCE = 300
COMMAND = [sys.executable, "-c", "from service.cli import main; main()"]


def until(look: Callable[[], Found | None], what: str = "it does not come") -> Found:
    """Return the first true result of ``look``."""
    begun = time.monotonic()
    while not (value := look()):
        assert time.monotonic() - begun < PATIENCE, what
        time.sleep(0.05)
    return value


def alive(pid: int) -> bool:
    """Return whether the process runs. A zombie does not count."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


@contextmanager
def robomark(*arguments: str | Path, **environment: str) -> Iterator[subprocess.Popen[str]]:
    """Run a command in the background, with its output in pipes. It is killed at the end if it still runs."""
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
