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
        "onnxruntime",
        "tzdata",
        "pytz",
    }
)
_NOT_STANDARD = frozenset(
    {"site-packages", "dist-packages", "test", "idlelib", "ensurepip", "lib2to3", "tkinter", "turtledemo"}
)
_LIBRARIES = ("/lib64", "/usr/lib64", "/lib/x86_64-linux-gnu", "/usr/lib/x86_64-linux-gnu")
_SYSTEM = (
    "/usr/share/zoneinfo",
    "/etc/localtime",
    "/dev/null",
    "/dev/zero",
    "/dev/urandom",
    "/etc/ld.so.cache",
)


def readable(roots: list[str]) -> tuple[str, ...]:
    """Files and folders that may be read."""
    return tuple({*roots, *_standard_library(), *_packages(), *_system_libraries(), *_SYSTEM})


def listable() -> tuple[str, ...]:
    """Folders whose names may be listed, as the import system does."""
    return tuple({path for key in ("purelib", "platlib") if (path := sysconfig.get_path(key))})


def open_to_others(paths: tuple[str, ...]) -> bool:
    """Whether a user who owns nothing here can read those of ``paths`` that there are, and reach them."""
    there = [path for path in paths if os.path.exists(path)]
    folders = {os.path.dirname(os.path.realpath(path)) for path in there}
    while more := {os.path.dirname(folder) for folder in folders} - folders:
        folders |= more
    return all(_has(folder, 0o001) for folder in folders) and all(
        _has(path, 0o005 if os.path.isdir(path) else 0o004) for path in there
    )


def _has(path: str, bits: int) -> bool:
    try:
        return os.stat(path).st_mode & bits == bits
    except OSError:
        return False


def _system_libraries() -> Iterator[str]:
    """Whole folders; but where Python keeps packages beneath one, only the libraries in it."""
    for folder in _LIBRARIES:
        names = os.listdir(folder) if os.path.isdir(folder) else []
        if not any(name.startswith("python") for name in names):
            yield folder
        else:
            yield from (os.path.join(folder, name) for name in names if ".so" in name)


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
