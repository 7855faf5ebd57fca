"""Calendar days by the wall clock of a time zone, in which a day may have 23 or 25 hours.

Independent of policies and tables.
"""

from __future__ import annotations

import math
import os
from datetime import UTC, datetime, timedelta, tzinfo
from functools import cache
from pathlib import Path
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

_ONE_DAY = timedelta(days=1)
_LOCALTIME = Path("/etc/localtime")


def find_local_zone() -> str:
    """Return this server's time zone, such as Europe/Berlin; empty if unknown."""
    zone_name = os.environ.get("TZ", "").removeprefix(":")
    if not zone_name:
        _, separator, zone_name = os.fspath(_LOCALTIME.resolve()).rpartition("zoneinfo/")
        zone_name = zone_name if separator else ""
    return zone_name if _load_zone(zone_name) is not None else ""


def add_days(moment: datetime, days: int, zone: str) -> datetime:
    """Return the moment ``days`` later at the same local time; the later one if that time occurs twice."""
    if not days:
        return moment
    local_time = _to_local_time(moment, zone)
    tz = _load_zone(zone)
    later_time = local_time + timedelta(days=days)
    return max(later_time.replace(tzinfo=tz, fold=fold).astimezone(UTC) for fold in (0, 1))


def count_days_after(moment: datetime, later_moment: datetime, zone: str) -> int:
    """Return the number of local days, rounded up, that ``later_moment`` is after ``moment``; 0 if it is not after."""
    if later_moment <= moment:
        return 0
    days = max(1, math.ceil((_to_local_time(later_moment, zone) - _to_local_time(moment, zone)) / _ONE_DAY))
    while add_days(moment, days, zone) < later_moment:
        days += 1
    while days > 1 and add_days(moment, days - 1, zone) >= later_moment:
        days -= 1
    return days


def _to_local_time(moment: datetime, zone: str) -> datetime:
    """Return the local time in the zone, as a naive datetime."""
    return moment.astimezone(_load_zone(zone)).replace(tzinfo=None)


@cache
def _load_zone(name: str) -> tzinfo | None:
    """Return the zone of this name; None, which means the server's zone, if it is unknown."""
    try:
        return ZoneInfo(name) if name else None
    except (ZoneInfoNotFoundError, ValueError, OSError):
        return None
