"""Moments that people write into forms: as a browser's field has them, in the zone of this server."""

from __future__ import annotations

from datetime import datetime

from sim.errors import UsageError
from submissions.roster import moment


def written_moment(text: str) -> datetime | None:
    """The moment, the end of a day that has no time; None for nothing. Raises UsageError for anything else."""
    if not text.strip():
        return None
    try:
        read = moment(text, end_of_day=True)
    except (ValueError, OverflowError):
        read = None
    if read is None or not 2000 <= read.year < 2200:
        raise UsageError(f"{text[:40]!r} is no date, expected one like 2026-11-30 or 2026-11-30T17:00")
    return read
