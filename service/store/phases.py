"""Times at which each phase of a job ended, stored with the grade to show where time was spent.

All times are by the database's clock; a worker adds its own measurements to the time of its claim.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime, timedelta
from types import MappingProxyType
from typing import Any

QUEUED = "queued"
CLAIMED = "claimed"
TRIALS = "trials"  # the last trial ended
JUDGED = "judged"  # all criteria were marked
COMMITTED = "committed"  # the marks were stored
PLOTTED = "plotted"
#: In order. A copied grade, or one that is not plotted yet, does not have all of them.
NAMES = (QUEUED, CLAIMED, TRIALS, JUDGED, COMMITTED, PLOTTED)
#: Spans between two phases, by name.
SPANS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "waiting": (QUEUED, CLAIMED),
        "trials": (CLAIMED, TRIALS),
        "judging": (TRIALS, JUDGED),
        "committing": (JUDGED, COMMITTED),
        "plotting": (COMMITTED, PLOTTED),
    }
)


def encode_times(moments: Mapping[str, datetime | None]) -> dict[str, str]:
    """Return the times as stored: ISO 8601 by name, in order, without those that are None."""
    moments_by_name = {name: moments.get(name) for name in NAMES}
    return {name: moment.isoformat() for name, moment in moments_by_name.items() if moment is not None}


def compute_durations(stored_times: Any) -> dict[str, timedelta]:
    """Return the duration of each span in ``SPANS`` with both ends stored."""
    moments = {name: datetime.fromisoformat(text) for name, text in dict(stored_times or {}).items() if name in NAMES}
    return {
        span: moments[end] - moments[start]
        for span, (start, end) in SPANS.items()
        if start in moments and end in moments
    }
