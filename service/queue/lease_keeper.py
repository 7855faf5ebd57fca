"""A lease, renewed from a thread for as long as something is done under it, however long that says nothing.

Whose lease it is, and how it is renewed in the database, is the caller's.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from threading import Event, Lock, Thread
from typing import Self

import structlog
from sqlalchemy.exc import DBAPIError

from sim.errors import Cancelled, HostError

_log = structlog.get_logger(__name__)
#: Whoever waits sees progress so often, however long the lease.
_PROGRESS_SECONDS = 2.0

#: After a renewal that failed, as one does that finds the database locked, the next is tried so soon.
_AGAIN_SECONDS = 0.2

# A process that is forked in the middle of a renewal would have its locks held for ever. Every fork waits for a running
# renewal, so a renewal may not wait long itself.
_renewing = Lock()
os.register_at_fork(before=_renewing.acquire, after_in_parent=_renewing.release, after_in_child=_renewing.release)


class LeaseKeeper:
    """Renews a lease while it is entered; ``check`` tells when what is done under it must stop."""

    def __init__(self, renew: Callable[[], None], lease_seconds: float, most_seconds: float) -> None:
        """``renew`` raises Cancelled when the lease is lost. After ``most_seconds`` it is no longer renewed."""
        self._renew = renew
        self._every = min(lease_seconds / 3, _PROGRESS_SECONDS)
        self._most = most_seconds
        self._until = time.monotonic() + most_seconds
        self._ended = Event()
        self._lost: Cancelled | None = None
        self._thread = Thread(target=self._run, name="lease keeper", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def check(self) -> None:
        """Raises Cancelled when the lease is lost, HostError when all has taken too long."""
        if self._lost is not None:
            raise self._lost
        if time.monotonic() > self._until:
            raise HostError(f"it took longer than {self._most:.0f} s")

    def _run(self) -> None:
        # What hangs for good must not be held for good.
        wait = self._every
        while not self._ended.wait(wait) and time.monotonic() <= self._until:
            wait = self._every
            with _renewing:
                try:
                    self._renew()
                except Cancelled as lost:
                    self._lost = lost
                    return
                except DBAPIError as error:
                    # The next renewal tries again; should the lease run out meanwhile, the token tells.
                    wait = min(self._every, _AGAIN_SECONDS)
                    _log.warning("heartbeat.failed", error=str(error))
                except Exception:
                    _log.exception("heartbeat.failed")
