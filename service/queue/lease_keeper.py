"""Lease that is renewed from a thread while work is in progress.

The caller provides the lease and the function that renews it in the database.
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
#: Maximum interval between progress updates, regardless of the lease.
_PROGRESS_SECONDS = 2.0

#: Delay after a failed renewal, for example because the database was locked.
_RETRY_SECONDS = 0.2

# A process forked during a renewal would keep its locks forever. Every fork waits for a running renewal, so a renewal
# must not wait long.
_renewal_lock = Lock()
os.register_at_fork(
    before=_renewal_lock.acquire, after_in_parent=_renewal_lock.release, after_in_child=_renewal_lock.release
)


class LeaseKeeper:
    """Renews a lease within a ``with`` block; ``check`` raises when the work must stop."""

    def __init__(self, renew: Callable[[], None], lease_seconds: float, max_seconds: float) -> None:
        """Create a keeper. ``renew`` raises Cancelled if the lease is lost. Renewals stop after ``max_seconds``."""
        self._renew = renew
        self._renewal_seconds = min(lease_seconds / 3, _PROGRESS_SECONDS)
        self._max_seconds = max_seconds
        self._deadline = time.monotonic() + max_seconds
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
        """Raise Cancelled if the lease is lost, HostError if the time limit has passed."""
        if self._lost is not None:
            raise self._lost
        if time.monotonic() > self._deadline:
            raise HostError(f"it took longer than {self._max_seconds:.0f} s")

    def _run(self) -> None:
        # A task that hangs forever must not keep its lease.
        wait = self._renewal_seconds
        while not self._ended.wait(wait) and time.monotonic() <= self._deadline:
            wait = self._renewal_seconds
            with _renewal_lock:
                try:
                    self._renew()
                except Cancelled as lost:
                    self._lost = lost
                    return
                except DBAPIError as error:
                    # The next renewal tries again. If the lease expires meanwhile, its token is rejected.
                    wait = min(self._renewal_seconds, _RETRY_SECONDS)
                    _log.warning("heartbeat.failed", error=str(error))
                except Exception:
                    _log.exception("heartbeat.failed")
