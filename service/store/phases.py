"""When each phase of a job came to its end: kept with the grade, so that it can be told where the time went.

All moments are by the database's clock; a worker adds what it measured itself to the moment of its claim.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime, timedelta
from types import MappingProxyType
from typing import Any

QUEUED = "queued"
CLAIMED = "claimed"
TRIALS = "trials"  # the last trial had been run
JUDGED = "judged"  # every criterion had been marked
COMMITTED = "committed"  # the marks were in the database
PLOTTED = "plotted"
#: In their order. A grade that was copied, or is not plotted yet, lacks some.
NAMES = (QUEUED, CLAIMED, TRIALS, JUDGED, COMMITTED, PLOTTED)
#: What is done from the phase before, where that is there, to the end of each.
SPANS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "waiting": (QUEUED, CLAIMED),
        "trials": (CLAIMED, TRIALS),
        "judging": (TRIALS, JUDGED),
        "committing": (JUDGED, COMMITTED),
        "plotting": (COMMITTED, PLOTTED),
    }
)


def written(moments: Mapping[str, datetime | None]) -> dict[str, str]:
    """Moments as they are stored: ISO 8601 by name, in order; those that are None are left out."""
    present = {name: moments.get(name) for name in NAMES}
    return {name: moment.isoformat() for name, moment in present.items() if moment is not None}


def durations(stored: Any) -> dict[str, timedelta]:
    """How long each span took, by the names of ``SPANS``; only those of which both ends are stored."""
    moments = {name: datetime.fromisoformat(text) for name, text in dict(stored or {}).items() if name in NAMES}
    return {
        span: moments[end] - moments[start]
        for span, (start, end) in SPANS.items()
        if start in moments and end in moments
    }
