"""How often somebody may do something: a bucket that fills with time, for each who asks. Kept by one process alone."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Callable

from starlette.exceptions import HTTPException

_MOST_KNOWN = 10_000


class RateLimit:
    """So many at once, and so many a minute after that."""

    def __init__(self, burst: int, per_minute: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._burst = float(burst)
        self._per_second = per_minute / 60
        self._clock = clock
        self._lock = threading.Lock()
        self._left: OrderedDict[str, tuple[float, float]] = OrderedDict()  # what is left, and when that was

    def spend(self, who: str) -> None:
        """Count one for ``who``. Raises HTTPException 429, which says when to come again."""
        with self._lock:
            at = self._clock()
            left, since = self._left.pop(who, (self._burst, at))
            left = min(self._burst, left + (at - since) * self._per_second)
            self._left[who] = (max(0.0, left - 1), at)
            if len(self._left) > _MOST_KNOWN:
                self._left.popitem(last=False)
        if left < 1:
            seconds = max(1, round((1 - left) / self._per_second))
            raise HTTPException(429, f"That is too often; come again in {seconds} s.", {"retry-after": str(seconds)})
