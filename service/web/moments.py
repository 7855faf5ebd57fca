"""Moments that people read and write on pages: in the zone of this server, which is said with each."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

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


def zone_of(moment: datetime) -> str:
    """The zone that this server is in at a moment, by its offset: UTC, UTC+1, UTC-3:30."""
    ahead = moment.astimezone().utcoffset() or timedelta()
    hours, minutes = divmod(abs(ahead) // timedelta(minutes=1), 60)
    if not hours and not minutes:
        return "UTC"
    return f"UTC{'-' if ahead < timedelta() else '+'}{hours}{f':{minutes:02}' if minutes else ''}"


def zone_now() -> str:
    """The zone that this server is in."""
    return zone_of(datetime.now(UTC))
