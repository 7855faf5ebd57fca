"""Simulated time and seeded randomness for student code, identical in every run of a trial.

It patches modules of the child's own process, after the fork and before any student code.
"""

from __future__ import annotations

import ctypes
import datetime
import gc
import hashlib
import os
import random
import sys
import time
import uuid
from collections.abc import Callable
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

SECOND = 3_000_000  # units of a third of a microsecond
EPOCH = 1_577_836_800  # 2020-01-01, UTC
#: Clocks that count from 1970: CLOCK_REALTIME, CLOCK_REALTIME_COARSE and CLOCK_TAI.
_WALL_CLOCKS = frozenset({0, 5, 11})


def install_clock(now: Callable[[], int], sleep: Callable[[int], None]) -> None:
    """Replace the clocks of ``time`` and ``datetime`` by ``now()``, and sleeping by ``sleep(units)``.

    Both use units of simulated time.
    """

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

    def times() -> os.times_result:
        return os.times_result((since_start(), 0.0, 0.0, 0.0, since_start()))

    wall_nanoseconds, nanoseconds_since_start = nanoseconds(EPOCH), nanoseconds(0)

    real_gmtime, real_strftime, real_asctime = time.gmtime, time.strftime, time.asctime
    replacements: dict[str, Any] = {
        "sleep": sleep_seconds,
        "time": wall,
        "time_ns": wall_nanoseconds,
        "clock_gettime": lambda clock: wall() if clock in _WALL_CLOCKS else since_start(),
        "clock_gettime_ns": lambda clock: wall_nanoseconds() if clock in _WALL_CLOCKS else nanoseconds_since_start(),
        "gmtime": lambda seconds=None: real_gmtime(wall() if seconds is None else seconds),
        "strftime": lambda form, moment=None: real_strftime(form, real_gmtime(wall()) if moment is None else moment),
        "asctime": lambda moment=None: real_asctime(real_gmtime(wall()) if moment is None else moment),
        "ctime": lambda seconds=None: real_asctime(real_gmtime(wall() if seconds is None else seconds)),
    }
    replacements["localtime"] = replacements["gmtime"]
    for name in ("monotonic", "perf_counter", "process_time", "thread_time"):
        replacements[name] = since_start
        replacements[name + "_ns"] = nanoseconds_since_start
    for name, function in replacements.items():
        setattr(time, name, function)
    os.times = times
    timeit_module = sys.modules.get("timeit")
    if timeit_module is not None:
        timeit_module.default_timer = since_start  # type: ignore[attr-defined]

    def moment(cls: type[datetime.datetime], tz: datetime.tzinfo | None = None) -> datetime.datetime:
        utc = cls.fromtimestamp(wall(), datetime.UTC)
        return utc.replace(tzinfo=None) if tz is None else utc.astimezone(tz)

    def naive_moment(cls: type[datetime.datetime]) -> datetime.datetime:
        return moment(cls)

    def day(cls: type[datetime.date]) -> datetime.date:
        today = moment(datetime.datetime)
        return cls(today.year, today.month, today.day)

    _replace_methods(datetime.datetime, now=moment, utcnow=naive_moment, today=naive_moment)
    _replace_methods(datetime.date, today=day)


def _replace_methods(kind: type, **methods: Callable[..., Any]) -> None:
    """Replace class methods of a built-in type. It remains the same type for imports, type checks and subclasses.

    Python refuses to set them, so they are written into its dictionary, which only the garbage collector returns.
    """
    (attributes,) = gc.get_referents(kind.__dict__)
    for name, method in methods.items():
        method.__name__, method.__qualname__ = name, f"{kind.__name__}.{name}"
        attributes[name] = classmethod(method)
    ctypes.pythonapi.PyType_Modified(ctypes.py_object(kind))


_real_seed = random.Random.seed


def _seed(self: random.Random, a: Any = None, version: int = 2) -> None:
    """Seed a generator. Without a seed, Python would ask the kernel for one through a name that can't be replaced."""
    _real_seed(self, int.from_bytes(os.urandom(32), "little") if a is None else a, version)


def install_randomness(seed: int) -> None:
    """Seed ``random``, numpy and onnxruntime, and replace all system sources of randomness by draws from ``seed``."""
    draw_count = 0

    def urandom(size: int) -> bytes:
        nonlocal draw_count
        draw_count += 1
        return hashlib.shake_256(f"{seed}:{draw_count}".encode()).digest(size)

    os.urandom = urandom
    random._urandom = urandom  # type: ignore[attr-defined]
    random.Random.seed = _seed  # type: ignore[method-assign]
    random.seed = random._inst.seed
    random.seed(seed)
    uuid._generate_time_safe = None  # type: ignore[attr-defined]
    uuid._UuidCreate = None  # type: ignore[attr-defined]
    uuid._node = seed & 0xFFFFFFFFFFFF | 0x010000000000  # type: ignore[attr-defined]
    numpy_random = sys.modules.get("numpy.random")
    if numpy_random is not None:
        numpy_random.seed(seed % 2**32)
    _seed_onnxruntime(seed % 2**63)


def _seed_onnxruntime(seed: int) -> None:
    """Seed the random operators of ONNX, such as Dropout in training mode. Otherwise they start from the real time."""
    onnxruntime = sys.modules.get("onnxruntime")
    if onnxruntime is not None:
        onnxruntime.set_seed(seed)
        return
    _SeedingFinder.seed = seed
    if _SeedingFinder not in sys.meta_path:
        sys.meta_path.insert(sys.meta_path.index(PathFinder), _SeedingFinder)


class _SeedingFinder:
    """Finds onnxruntime, and seeds it after its import."""

    seed = 0

    @classmethod
    def find_spec(cls, fullname: str, path: Any, target: ModuleType | None = None) -> ModuleSpec | None:
        specification = PathFinder.find_spec(fullname, path, target) if fullname == "onnxruntime" else None
        if specification is not None:
            loader: Any = specification.loader
            execute = loader.exec_module

            def execute_and_seed(module: Any) -> None:
                execute(module)
                module.set_seed(cls.seed)

            loader.exec_module = execute_and_seed
        return specification
