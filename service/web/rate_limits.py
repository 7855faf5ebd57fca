"""Rate limits by token bucket, with a bucket for each user or address. Each server process has its own."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NoReturn

from service.web.http_errors import TranslatableHTTPException
from sim.sentences import Sentence

_MAX_CLIENTS = 10_000


class RateLimit:
    """A rate limit with a burst size and a number of calls per minute."""

    def __init__(self, burst: int, per_minute: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._burst = float(burst)
        self._per_second = per_minute / 60
        self._clock = clock
        self._lock = threading.Lock()
        self._remaining_calls: OrderedDict[str, tuple[float, float]] = (
            OrderedDict()
        )  # calls left, and the time of that count

    def spend(self, client_key: str) -> None:
        """Count one call of ``client_key``. Raises HTTPException 429 with ``Retry-After`` if the bucket is empty."""
        with self._lock:
            remaining, current_time = self._compute_remaining(client_key)
            self._remaining_calls.pop(client_key, None)
            self._remaining_calls[client_key] = (max(0.0, remaining - 1), current_time)
            if len(self._remaining_calls) > _MAX_CLIENTS:
                self._remaining_calls.popitem(last=False)
        if remaining < 1:
            self._refuse(remaining)

    def _compute_remaining(self, client_key: str) -> tuple[float, float]:
        current_time = self._clock()
        remaining, last_time = self._remaining_calls.get(client_key, (self._burst, current_time))
        return min(self._burst, remaining + (current_time - last_time) * self._per_second), current_time

    def _refuse(self, remaining: float) -> NoReturn:
        seconds = max(1, round((1 - remaining) / self._per_second))
        message = Sentence("Too many requests. Try again in %(seconds)s s.", seconds=seconds)
        raise TranslatableHTTPException(429, message, {"retry-after": str(seconds)})


@dataclass(frozen=True, slots=True)
class RateLimits:
    """The rate limits of one web server."""

    #: Failed sign-ins, by address. Behind an untrusted proxy, all requests have the same address.
    failed_sign_ins: RateLimit = field(default_factory=lambda: RateLimit(burst=30, per_minute=30))
    #: Launches from unregistered platforms, by address.
    unknown_platforms: RateLimit = field(default_factory=lambda: RateLimit(burst=300, per_minute=300))
    #: Submissions of one person, in all courses, by page or API.
    submissions: RateLimit = field(default_factory=lambda: RateLimit(burst=10, per_minute=6))
    #: Test runs of one person. The store limits the total number.
    test_runs: RateLimit = field(default_factory=lambda: RateLimit(burst=10, per_minute=6))
    #: Runs of one person's notebook; each answer of a responder is one. The store limits the total number.
    notebook_runs: RateLimit = field(default_factory=lambda: RateLimit(burst=120, per_minute=120))
    #: Downloads of all own data, by person. One can have hundreds of megabytes.
    exports: RateLimit = field(default_factory=lambda: RateLimit(burst=3, per_minute=0.1))
    #: Downloads of the files of an own submission, by person. Readers that are slow keep them in memory.
    files: RateLimit = field(default_factory=lambda: RateLimit(burst=20, per_minute=6))
    #: Receipts and statements, by person. The place of a statement in the log is computed for each.
    statements: RateLimit = field(default_factory=lambda: RateLimit(burst=20, per_minute=6))
    #: API calls, by token. The settings define the limit.
    api_calls: RateLimit = field(default_factory=lambda: RateLimit(burst=600, per_minute=600))
    #: Pages and their images, by person. The limit is the same as for API calls.
    page_calls: RateLimit = field(default_factory=lambda: RateLimit(burst=600, per_minute=600))
