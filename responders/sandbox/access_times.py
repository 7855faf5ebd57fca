"""Access times: keeps reads by children from changing them, so that reading leaves no trace for later trials.

With the usual relatime mount option, a file's access time stays unchanged for a day once it is newer than the last
change. So the worker reads every file in advance, every half day. Only access times change.
"""

from __future__ import annotations

import contextlib
import os
import stat
import time
from collections.abc import Iterable
from pathlib import Path

#: Time for which reading in advance is effective, with an hour in reserve.
VALID_SECONDS = 12 * 3600
_FRESH_SECONDS = 11 * 3600
_NO_ACCESS_TIMES = os.ST_RDONLY | os.ST_NOATIME


def read_beforehand(paths: Iterable[str], listed_paths: Iterable[str] = ()) -> str | None:
    """Read ``paths`` and everything below, list ``listed_paths``, and follow the links to them.

    Return a sentence about a file whose access time would still change, or None.
    """
    shallow_paths = _add_links(listed_paths)
    pending: list[tuple[str, int | None]] = [(path, None) for path in _add_links(paths) | shallow_paths]
    while pending:
        path, rule = pending.pop()
        # Files may disappear, or be unreadable. Children can't read those either.
        with contextlib.suppress(OSError):
            status = os.lstat(path)
            mode = status.st_mode
            # Device drivers don't update access times, whatever the mount options: containers mount /dev with
            # strictatime.
            if stat.S_ISCHR(mode):
                continue
            if rule is None or stat.S_ISDIR(mode):
                rule = os.statvfs(path).f_flag
            if not rule & (_NO_ACCESS_TIMES | os.ST_RELATIME):
                return f"each reading of {path} is dated: it is mounted with neither relatime nor noatime"
            if not rule & _NO_ACCESS_TIMES and _is_updated_again(path, status):
                return f"each reading of {path} is dated: its last change is dated in the future"
            if stat.S_ISDIR(mode) and path not in shallow_paths:
                pending += [(entry.path, rule) for entry in os.scandir(path)]
    return None


def _add_links(paths: Iterable[str]) -> set[str]:
    """Return the paths, the targets of links, and the links on the way."""
    targets = {each for path in paths for each in (path, os.path.realpath(path))}
    return targets | {str(above) for path in targets for above in Path(path).parents if above.is_symlink()}


def _is_updated_again(path: str, status: os.stat_result) -> bool:
    """Read the path if that would update its access time. Return whether the next read would update it too."""
    if not _is_due(status):
        return False
    mode = status.st_mode
    if stat.S_ISLNK(mode):
        Path(path).readlink()
    elif stat.S_ISDIR(mode):
        with os.scandir(path) as entries:
            next(entries, None)
    elif stat.S_ISREG(mode):
        with Path(path).open("rb", buffering=0) as file:
            file.read(1)
    new_status = os.lstat(path)
    return _is_due(new_status) and new_status.st_atime_ns != status.st_atime_ns


def _is_due(status: os.stat_result) -> bool:
    """Return whether the kernel would update the access time, with a margin before its limit of a day."""
    change_time = max(status.st_mtime_ns, status.st_ctime_ns)
    return status.st_atime_ns <= change_time or abs(time.time() - status.st_atime) > _FRESH_SECONDS
