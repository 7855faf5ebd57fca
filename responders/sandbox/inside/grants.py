"""What student code may read: the standard library entry by entry, named packages, and its own role's modules.

Never a whole ``lib/python3.x``: site-packages may lie beneath it, and Landlock cannot take back what a rule gives.
"""

from __future__ import annotations

import os
import sysconfig
from collections.abc import Iterator

_PACKAGES = frozenset(
    {
        "numpy",
        "numpy.libs",
        "scipy",
        "scipy.libs",
        "sklearn",
        "scikit_learn.libs",
        "joblib",
        "pandas",
        "pandas.libs",
        "PIL",
        "pillow.libs",
        "threadpoolctl.py",
        "dateutil",
        "six.py",
        "narwhals",
        "tzdata",
        "pytz",
    }
)
_NOT_STANDARD = frozenset(
    {"site-packages", "dist-packages", "test", "idlelib", "ensurepip", "lib2to3", "tkinter", "turtledemo"}
)
_SYSTEM = (
    "/lib",
    "/lib64",
    "/usr/lib/x86_64-linux-gnu",
    "/lib/x86_64-linux-gnu",
    "/usr/share/zoneinfo",
    "/etc/localtime",
    "/dev/null",
    "/dev/zero",
    "/dev/urandom",
    "/etc/ld.so.cache",
)


def readable(roots: list[str]) -> tuple[str, ...]:
    """Files and folders that may be read."""
    return tuple({*roots, *_standard_library(), *_packages(), *_SYSTEM})


def listable() -> tuple[str, ...]:
    """Folders whose names may be listed, as the import system does."""
    return tuple({path for key in ("purelib", "platlib") if (path := sysconfig.get_path(key))})


def _standard_library() -> Iterator[str]:
    for key in ("stdlib", "platstdlib"):
        folder = sysconfig.get_path(key)
        for name in os.listdir(folder):
            if name not in _NOT_STANDARD:
                yield os.path.join(folder, name)


def _packages() -> Iterator[str]:
    for folder in listable():
        for name in os.listdir(folder):
            if name in _PACKAGES:
                yield os.path.join(folder, name)
