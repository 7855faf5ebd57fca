"""Dates and times on pages: parsing, and the server's time zone, which is shown with each of them."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from sim.errors import UsageError
from submissions.roster import parse_time


def parse_date_time(text: str) -> datetime | None:
    """Parse a date and time. A date alone means the end of that day.

    Returns:
        The moment, or None for an empty text.

    Raises:
        UsageError: The text is not a date.
    """
    if not text.strip():
        return None
    try:
        parsed_time = parse_time(text, end_of_day=True)
    except ValueError:
        parsed_time = None
    if parsed_time is None or not 2000 <= parsed_time.year < 2200:
        raise UsageError(f"{text[:40]!r} is not a date, expected a date like 2026-11-30 or 2026-11-30T17:00")
    return parsed_time


def format_utc_offset(moment: datetime) -> str:
    """Return the server's UTC offset at a moment: ``UTC``, ``UTC+1``, ``UTC-3:30``."""
    utc_offset = moment.astimezone().utcoffset() or timedelta()
    hours, minutes = divmod(abs(utc_offset) // timedelta(minutes=1), 60)
    if not hours and not minutes:
        return "UTC"
    return f"UTC{'-' if utc_offset < timedelta() else '+'}{hours}{f':{minutes:02}' if minutes else ''}"


def format_current_offset() -> str:
    """Return the server's current UTC offset."""
    return format_utc_offset(datetime.now(UTC))
