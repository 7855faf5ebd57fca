"""Simulated time and seeded chance for student code: the same trial sees the same clock and the same dice.

It changes modules of the child's own process only, after the fork and before any student code.
"""

from __future__ import annotations

import datetime
import hashlib
import os
import random
import sys
import time
import uuid
from collections.abc import Callable
from typing import Any

SECOND = 3_000_000  # units of a third of a microsecond
EPOCH = 1_577_836_800  # 2020-01-01, UTC

_REAL_DATETIME = datetime.datetime
_REAL_DATE = datetime.date


def install_clock(now: Callable[[], int], sleep: Callable[[int], None]) -> None:
    """Let ``time`` and ``datetime`` read ``now()`` and sleep by ``sleep(units)``, both in units of simulated time."""

    def sleep_seconds(seconds: float) -> None:
        units = round(seconds * SECOND)
        if units < 0:
            raise ValueError("sleep length must be non-negative")
        sleep(units)

    def since_start() -> float:
        return now() / SECOND

    def wall() -> float:
        return EPOCH + now() / SECOND

    def nanoseconds(seconds: int) -> Callable[[], int]:
        return lambda: seconds * 10**9 + now() * 1000 // 3

    real_gmtime, real_strftime, real_asctime = time.gmtime, time.strftime, time.asctime
    changed: dict[str, Any] = {
        "sleep": sleep_seconds,
        "time": wall,
        "time_ns": nanoseconds(EPOCH),
        "clock_gettime": lambda _: since_start(),
        "clock_gettime_ns": lambda _: nanoseconds(0)(),
        "gmtime": lambda seconds=None: real_gmtime(wall() if seconds is None else seconds),
        "strftime": lambda form, moment=None: real_strftime(form, real_gmtime(wall()) if moment is None else moment),
        "asctime": lambda moment=None: real_asctime(real_gmtime(wall()) if moment is None else moment),
        "ctime": lambda seconds=None: real_asctime(real_gmtime(wall() if seconds is None else seconds)),
    }
    changed["localtime"] = changed["gmtime"]
    for name in ("monotonic", "perf_counter", "process_time", "thread_time"):
        changed[name] = since_start
        changed[name + "_ns"] = nanoseconds(0)
    for name, function in changed.items():
        setattr(time, name, function)

    moment_class, day_class = _clocked_classes(wall)
    datetime.datetime = moment_class  # type: ignore[misc]
    datetime.date = day_class  # type: ignore[misc]


def _clocked_classes(wall: Callable[[], float]) -> tuple[Any, Any]:
    """Stand-ins for datetime.datetime and datetime.date whose "now" is simulated; instances are the real classes'."""

    class DatetimeMeta(type):
        def __instancecheck__(cls, instance: object) -> bool:
            return isinstance(instance, _REAL_DATETIME)

        def __subclasscheck__(cls, subclass: type) -> bool:
            return issubclass(subclass, _REAL_DATETIME)

    class SimulatedDatetime(_REAL_DATETIME, metaclass=DatetimeMeta):
        def __new__(cls, *args: Any, **kwargs: Any) -> Any:
            return _REAL_DATETIME(*args, **kwargs)

        @classmethod
        def now(cls, tz: datetime.tzinfo | None = None) -> Any:
            utc = _REAL_DATETIME.fromtimestamp(wall(), datetime.UTC)
            return utc.replace(tzinfo=None) if tz is None else utc.astimezone(tz)

        @classmethod
        def utcnow(cls) -> Any:
            return cls.now()

        @classmethod
        def today(cls) -> Any:
            return cls.now()

    class DateMeta(type):
        def __instancecheck__(cls, instance: object) -> bool:
            return isinstance(instance, _REAL_DATE)

        def __subclasscheck__(cls, subclass: type) -> bool:
            return issubclass(subclass, _REAL_DATE)

    class SimulatedDate(_REAL_DATE, metaclass=DateMeta):
        def __new__(cls, *args: Any, **kwargs: Any) -> Any:
            return _REAL_DATE(*args, **kwargs)

        @classmethod
        def today(cls) -> Any:
            return SimulatedDatetime.now().date()

    return SimulatedDatetime, SimulatedDate


def install_chance(seed: int) -> None:
    """Seed ``random`` and numpy, and let everything that asks the system for chance draw from ``seed`` instead."""
    drawn = 0

    def urandom(size: int) -> bytes:
        nonlocal drawn
        drawn += 1
        return hashlib.shake_256(f"{seed}:{drawn}".encode()).digest(size)

    os.urandom = urandom
    random._urandom = urandom  # type: ignore[attr-defined]
    random.seed(seed)
    uuid._generate_time_safe = None  # type: ignore[attr-defined]
    uuid._UuidCreate = None  # type: ignore[attr-defined]
    uuid._node = seed & 0xFFFFFFFFFFFF | 0x010000000000  # type: ignore[attr-defined]
    numpy_random = sys.modules.get("numpy.random")
    if numpy_random is not None:
        numpy_random.seed(seed % 2**32)
