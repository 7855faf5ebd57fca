"""How often somebody may do something: a bucket that fills with time, for each who asks. Kept by one process alone."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NoReturn

from service.web.refusing import Declined
from sim.sentences import Sentence

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
        """Count one for ``who``. Raises HTTPException 429, which says when to come again, where nothing is left."""
        with self._lock:
            left, at = self._now(who)
            self._left.pop(who, None)
            self._left[who] = (max(0.0, left - 1), at)
            if len(self._left) > _MOST_KNOWN:
                self._left.popitem(last=False)
        if left < 1:
            self._refuse(left)

    def _now(self, who: str) -> tuple[float, float]:
        at = self._clock()
        left, since = self._left.get(who, (self._burst, at))
        return min(self._burst, left + (at - since) * self._per_second), at

    def _refuse(self, left: float) -> NoReturn:
        seconds = max(1, round((1 - left) / self._per_second))
        said = Sentence("That is too often; come again in %(seconds)s s.", {"seconds": seconds})
        raise Declined(429, said, {"retry-after": str(seconds)})


@dataclass(frozen=True, slots=True)
class RateLimits:
    """Those of one web server, by what they count."""

    #: Tries to sign in that failed, by address; behind a proxy that is not trusted all come from one.
    failed_sign_ins: RateLimit = field(default_factory=lambda: RateLimit(burst=30, per_minute=30))
    #: Launches from platforms that are not registered, by address.
    unknown_platforms: RateLimit = field(default_factory=lambda: RateLimit(burst=300, per_minute=300))
    #: Submissions of one person, whatever the course and the way.
    submissions: RateLimit = field(default_factory=lambda: RateLimit(burst=10, per_minute=6))
    #: Programs of one person that are tried; how many are run in all is the store's to say.
    tryouts: RateLimit = field(default_factory=lambda: RateLimit(burst=10, per_minute=6))
    #: Calls of the API, by token; the settings say how many.
    api_calls: RateLimit = field(default_factory=lambda: RateLimit(burst=600, per_minute=600))
    #: Pages and their images, by person; as many as calls of the API.
    page_calls: RateLimit = field(default_factory=lambda: RateLimit(burst=600, per_minute=600))
