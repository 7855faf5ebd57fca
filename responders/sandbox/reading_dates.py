"""Sees to it that reading leaves no trace: nothing that children may read is dated when one of them reads it.

Where the usual rule is in force (relatime), the date of the last reading stays as it is for a day once a file was read
after its last change. So the worker reads everything beforehand, every half day. It changes nothing but those dates.
"""

from __future__ import annotations

import contextlib
import os
import stat
import time
from collections.abc import Iterable
from pathlib import Path

#: For so long nothing that was read beforehand is dated, whoever reads it, and for an hour more.
HOLDS_SECONDS = 12 * 3600
_FRESH_SECONDS = 11 * 3600
_NEVER_DATED = os.ST_RDONLY | os.ST_NOATIME


def read_beforehand(paths: Iterable[str], listed: Iterable[str] = ()) -> str | None:
    """Read ``paths`` and all beneath them, list ``listed``, follow the links on the way to them.

    What would be dated all the same, in a sentence; None if nothing would.
    """
    alone = _and_links(listed)
    pending: list[tuple[str, int | None]] = [(path, None) for path in _and_links(paths) | alone]
    while pending:
        path, rule = pending.pop()
        # A file may come and go, or not be for us to read: then it is not for a child of ours either.
        with contextlib.suppress(OSError):
            status = os.lstat(path)
            mode = status.st_mode
            # A device's driver dates nothing, however it is mounted: containers have /dev with strictatime.
            if stat.S_ISCHR(mode):
                continue
            if rule is None or stat.S_ISDIR(mode):
                rule = os.statvfs(path).f_flag
            if not rule & (_NEVER_DATED | os.ST_RELATIME):
                return f"each reading of {path} is dated: it is mounted with neither relatime nor noatime"
            if not rule & _NEVER_DATED and _is_dated_again(path, status):
                return f"each reading of {path} is dated: its last change is dated in the future"
            if stat.S_ISDIR(mode) and path not in alone:
                pending += [(entry.path, rule) for entry in os.scandir(path)]
    return None


def _and_links(paths: Iterable[str]) -> set[str]:
    """Also where links lead, and the links that are passed on the way."""
    found = {each for path in paths for each in (path, os.path.realpath(path))}
    return found | {str(above) for path in found for above in Path(path).parents if above.is_symlink()}


def _is_dated_again(path: str, before: os.stat_result) -> bool:
    """Read it if that would be dated, and see whether it would be the next time too."""
    if not _is_due(before):
        return False
    mode = before.st_mode
    if stat.S_ISLNK(mode):
        Path(path).readlink()
    elif stat.S_ISDIR(mode):
        with os.scandir(path) as entries:
            next(entries, None)
    elif stat.S_ISREG(mode):
        with Path(path).open("rb", buffering=0) as file:
            file.read(1)
    after = os.lstat(path)
    return _is_due(after) and after.st_atime_ns != before.st_atime_ns


def _is_due(status: os.stat_result) -> bool:
    """As the kernel decides, but that to it only what is a whole day old is."""
    changed = max(status.st_mtime_ns, status.st_ctime_ns)
    return status.st_atime_ns <= changed or abs(time.time() - status.st_atime) > _FRESH_SECONDS
