"""Paths that student code may read: entries of the standard library, named packages, and modules of its role.

A whole ``lib/python3.x`` is never granted, because site-packages may be below it and Landlock can't exclude subfolders.
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
        "ai_edge_litert",
        "onnxruntime",
        "tzdata",
        "pytz",
    }
)
_NOT_STANDARD = frozenset(
    {"site-packages", "dist-packages", "test", "idlelib", "ensurepip", "lib2to3", "tkinter", "turtledemo"}
)
_LIBRARY_FOLDERS = ("/lib64", "/usr/lib64", "/lib/x86_64-linux-gnu", "/usr/lib/x86_64-linux-gnu")
_SYSTEM_PATHS = (
    "/usr/share/zoneinfo",
    "/etc/localtime",
    "/dev/null",
    "/dev/zero",
    "/etc/ld.so.cache",
)


def list_readable_paths(roots: list[str], closed_paths: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Return the readable files and folders, except ``closed_paths``, even inside one of them."""
    granted_paths = {*roots, *_list_standard_library(), *_list_packages(), *_list_system_libraries(), *_SYSTEM_PATHS}
    return tuple(
        {
            path
            for place in granted_paths
            for path in _exclude_closed(place, {os.path.realpath(path) for path in closed_paths})
        }
    )


def list_listable_folders(roots: list[str], closed_paths: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Return the folders that may be listed, as the import system does. Parents of closed paths are only listable."""
    sites = _list_site_folders()
    tops = tuple(f"{folder}/" for folder in (*sites, *roots))
    closed_parents = {
        folder for path in closed_paths for folder in _list_parent_folders(path) if f"{folder}/".startswith(tops)
    }
    return tuple(sites | closed_parents)


def is_open_to_others(paths: tuple[str, ...]) -> bool:
    """Return whether a user without privileges can read and reach those of ``paths`` that exist."""
    existing_paths = [path for path in paths if os.path.exists(path)]
    folders = {os.path.dirname(os.path.realpath(path)) for path in existing_paths}
    while parents := {os.path.dirname(folder) for folder in folders} - folders:
        folders |= parents
    return all(_has_mode_bits(folder, 0o001) for folder in folders) and all(
        _has_mode_bits(path, 0o005 if os.path.isdir(path) else 0o004) for path in existing_paths
    )


def _has_mode_bits(path: str, bits: int) -> bool:
    try:
        return os.stat(path).st_mode & bits == bits
    except OSError:
        return False


def _list_system_libraries() -> Iterator[str]:
    """Yield the folders of system libraries; if Python's packages are below one, only the libraries in it."""
    for folder in _LIBRARY_FOLDERS:
        names = os.listdir(folder) if os.path.isdir(folder) else []
        if not any(name.startswith("python") for name in names):
            yield folder
        else:
            yield from (os.path.join(folder, name) for name in names if ".so" in name)


def _list_standard_library() -> Iterator[str]:
    for key in ("stdlib", "platstdlib"):
        folder = sysconfig.get_path(key)
        for name in os.listdir(folder):
            if name not in _NOT_STANDARD:
                yield os.path.join(folder, name)


def _exclude_closed(path: str, closed_paths: set[str]) -> Iterator[str]:
    """Yield ``path``, or its entries that are not closed."""
    real_path = os.path.realpath(path)
    if real_path in closed_paths:
        return
    if any(path.startswith(f"{real_path}/") for path in closed_paths):
        for name in os.listdir(path):
            yield from _exclude_closed(os.path.join(path, name), closed_paths)
    else:
        yield path


def _list_parent_folders(path: str) -> Iterator[str]:
    while (parent := os.path.dirname(path)) != path:
        yield parent
        path = parent


def _list_site_folders() -> set[str]:
    return {path for key in ("purelib", "platlib") if (path := sysconfig.get_path(key))}


def _list_packages() -> Iterator[str]:
    for folder in _list_site_folders():
        for name in os.listdir(folder):
            if name in _PACKAGES:
                yield os.path.join(folder, name)
