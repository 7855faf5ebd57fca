"""Folders of single trials, all in one folder of the worker's, and removed whatever was put into them.

What a student's process may do in its own is decided by the sandbox; that it cannot grow is seen to while it runs.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import secrets
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

_PREFIX = "robomark-trials-"
#: Others may pass through it, as a child that runs as a user of its own must, but not look round.
_MODE = 0o711
#: How many numbers each trial takes up, with those that are left out after it: several times what a child may use up.
_NUMBERS = 1024
#: How many numbers are taken at most during a trial, several times what others make in the meantime.
_TAKEN = 64


class PrivateFolders:
    """The folder in which trials have theirs; made when first asked for, and locked as long as its worker lives."""

    def __init__(self) -> None:
        self._path: Path | None = None
        self._lock = -1
        self._counting = False  # whether files there are numbered on and on

    @property
    def path(self) -> Path:
        """It, made again if somebody has tidied it away."""
        if self._path is None or not self._path.is_dir():
            self._make(self._path)
        assert self._path is not None
        return self._path

    @contextlib.contextmanager
    def one(self) -> Iterator[Path]:
        """A folder for one trial."""
        with self._telling_nothing():
            folder = Path(tempfile.mkdtemp(dir=self.path))
            try:
                yield folder
            finally:
                _remove(folder)

    @contextlib.contextmanager
    def _telling_nothing(self) -> Iterator[None]:
        """Keep the number of a trial's next file from saying how many files an earlier trial has made.

        Where files are numbered on and on (tmpfs, Btrfs), every trial takes up as many numbers, whatever it makes.
        Where the lowest free number is taken (ext4) it would say whether others, who made files beside that trial,
        found the low ones taken; so a number of low ones that nobody knows is taken meanwhile.
        """
        folder = self.path
        if self._counting:
            end = _number(folder) + _NUMBERS
            try:
                yield
            finally:
                for _ in range(_NUMBERS):
                    if _number(folder) >= end:
                        break
            return
        taking = Path(tempfile.mkdtemp(dir=folder))
        try:
            for place in range(secrets.randbelow(_TAKEN)):
                (taking / str(place)).touch(0o600)
            yield
        finally:
            _remove(taking)

    def close(self) -> None:
        """Remove the folder and let go of its lock."""
        if self._path is not None:
            _remove(self._path)
            self._path = None
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def _make(self, path: Path | None) -> None:
        path, locked = locked_folder(_PREFIX, _MODE, path)
        if self._lock >= 0:
            os.close(self._lock)
        self._path, self._lock = path, locked
        self._counting = len({_number(path) for _ in range(4)}) == 4


def _number(folder: Path) -> int:
    """The number of a new file in ``folder``, which is gone again."""
    path = folder / "number"
    path.touch(0o600)
    try:
        return path.stat().st_ino
    finally:
        path.unlink()


def locked_folder(prefix: str, mode: int, path: Path | None = None) -> tuple[Path, int]:
    """Make a temporary folder, at ``path`` if given. Returns it and its lock, a descriptor to be closed at the end."""
    # Whoever looks for left-overs does not see it without its lock.
    hidden = Path(tempfile.mkdtemp(prefix=f".{prefix}"))
    hidden.chmod(mode)
    path = path or hidden.with_name(hidden.name.removeprefix("."))
    locked = os.open(hidden, os.O_RDONLY | os.O_DIRECTORY)
    fcntl.flock(locked, fcntl.LOCK_EX)
    hidden.rename(path)
    return path, locked


def remove_left_overs(prefix: str = _PREFIX) -> None:
    """Remove the locked folders whose process was killed before it could do so itself.

    It may live in another name space, where process ids say nothing: only the lock says that it is gone.
    """
    for folder in Path(tempfile.gettempdir()).glob(f"{prefix}*"):
        # Another worker may be doing the same at this moment.
        with contextlib.suppress(OSError), _opened(folder) as descriptor:
            if os.fstat(descriptor).st_uid == os.getuid():
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                _remove(folder)


@contextlib.contextmanager
def _opened(folder: Path) -> Iterator[int]:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def _remove(folder: Path) -> None:
    try:
        shutil.rmtree(folder, ignore_errors=True)
    except RecursionError:
        # rmtree recurses; a chain of a thousand folders is a student's doing.
        subprocess.run(["rm", "-rf", "--", str(folder)], check=False)
