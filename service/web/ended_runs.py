"""Waiting for the ends of runs: requests wait without a thread, and one query at a time asks for all of them.

The number of queries does not depend on the number of requests that wait.
"""

from __future__ import annotations

import asyncio
import threading
from asyncio import AbstractEventLoop
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import dataclass

import structlog

_log = structlog.get_logger(__name__)
_QUERY_SECONDS = 0.05
#: More requests do not wait. They ask again later.
_MAX_WAITING = 2000


@dataclass(frozen=True, slots=True, eq=False)
class _Waiter:
    """A request that waits, in its event loop."""

    run_id: str
    loop: AbstractEventLoop
    ended: asyncio.Event

    def wake(self) -> None:
        # The loop of a request that has ended may be closed.
        with suppress(RuntimeError):
            self.loop.call_soon_threadsafe(self.ended.set)


class EndedRuns:
    """Lets requests wait until their runs have ended. ``find_ended`` returns those of some runs that have."""

    def __init__(self, find_ended: Callable[[Collection[str]], Collection[str]]) -> None:
        self._find_ended = find_ended
        self._lock = threading.Lock()
        self._waiters: set[_Waiter] = set()
        self._is_watching = False

    async def wait(self, run_id: str, seconds: float) -> None:
        """Return when the run has ended, or after ``seconds``."""
        waiter = _Waiter(run_id, asyncio.get_running_loop(), asyncio.Event())
        with self._lock:
            if len(self._waiters) >= _MAX_WAITING:
                return
            self._waiters.add(waiter)
            if not self._is_watching:
                self._is_watching = True
                threading.Thread(target=self._watch, name="ended runs", daemon=True).start()
        try:
            with suppress(TimeoutError):
                await asyncio.wait_for(waiter.ended.wait(), seconds)
        finally:
            with self._lock:
                self._waiters.discard(waiter)

    def _watch(self) -> None:
        """Wake the requests whose runs have ended, until nobody waits."""
        pause = threading.Event()
        while not pause.wait(_QUERY_SECONDS):
            with self._lock:
                waiters = tuple(self._waiters)
                if not waiters:
                    self._is_watching = False
                    return
            try:
                ended = frozenset(self._find_ended({each.run_id for each in waiters}))
            except Exception:
                # The database is away for a moment; the requests return at their own time.
                _log.exception("ended_runs.failed")
                continue
            for waiter in waiters:
                if waiter.run_id in ended:
                    waiter.wake()
