"""Locks between the graders on one machine: they usually run student code in parallel, sometimes exclusively.

There are two file locks, so the kernel releases those of a killed grader. This module runs nothing itself.
"""

from __future__ import annotations

import fcntl
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from sim.errors import HostError

_POLL_SECONDS = 0.02


class GraderLocks:
    """The locks in ``folder``, shared by all graders with the same home folder."""

    def __init__(self, folder: Path) -> None:
        self._gate, self._running = folder / "gate.lock", folder / "slots.lock"

    @contextmanager
    def shared_lock(self, heartbeat: Callable[[], None]) -> Iterator[None]:
        """Hold a shared lock. Waits while another grader has or wants the exclusive one, and calls ``heartbeat``."""
        with ExitStack() as running:
            with _locked(self._gate, fcntl.LOCK_SH, heartbeat):
                running.enter_context(_locked(self._running, fcntl.LOCK_SH, heartbeat))
            yield

    @contextmanager
    def exclusive_lock(self, heartbeat: Callable[[], None]) -> Iterator[None]:
        """Hold an exclusive lock: wait for the other graders, and block new ones."""
        with _locked(self._gate, fcntl.LOCK_EX, heartbeat), _locked(self._running, fcntl.LOCK_EX, heartbeat):
            yield


@contextmanager
def _locked(path: Path, operation: int, heartbeat: Callable[[], None]) -> Iterator[None]:
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        file = path.open("a")
    except OSError as error:
        raise HostError(f"the lock file cannot be used: {path}: {error.strerror}") from None
    with file:
        while True:
            try:
                fcntl.flock(file, operation | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                heartbeat()
                time.sleep(_POLL_SECONDS)
        yield
