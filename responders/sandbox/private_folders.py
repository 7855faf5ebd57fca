"""Folders of single trials, all in one folder of the worker's, and removed whatever was put into them.

What a student's process may do in its own is decided by the walls; that it cannot grow is seen to while it runs.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

_PREFIX = "robomark-trial-"
#: Others may pass through it, as a child that runs as a user of its own must, but not look round.
_MODE = 0o711
#: How many numbers are left out at most before a trial, several times what a child may use up.
_SKIPPED = 1500


class PrivateFolders:
    """The folder in which trials have theirs; made when first asked for."""

    def __init__(self) -> None:
        self._path: Path | None = None
        self._counting = False  # whether files there are numbered on and on

    @property
    def path(self) -> Path:
        """It, made again if somebody has tidied it away."""
        if self._path is None:
            self._path = Path(tempfile.mkdtemp(prefix=f"{_PREFIX}{os.getpid()}-"))
            self._path.chmod(_MODE)
            self._counting = len({_number(self._path) for _ in range(4)}) == 4
        with contextlib.suppress(FileExistsError):
            self._path.mkdir(_MODE)
        return self._path

    def _skip_numbers(self) -> None:
        """Where files are numbered on and on (tmpfs, Btrfs), the next number would tell how many a trial has made."""
        if self._counting:
            for _ in range(secrets.randbelow(_SKIPPED)):
                _number(self.path)

    @contextlib.contextmanager
    def one(self) -> Iterator[Path]:
        """A folder for one trial."""
        self._skip_numbers()
        folder = Path(tempfile.mkdtemp(dir=self.path))
        try:
            yield folder
        finally:
            _remove(folder)

    def close(self) -> None:
        if self._path is not None:
            _remove(self._path)
            self._path = None


def _number(folder: Path) -> int:
    """The number of a new file in ``folder``, which is gone again."""
    path = folder / "number"
    path.touch(0o600)
    try:
        return path.stat().st_ino
    finally:
        path.unlink()


def remove_left_overs() -> None:
    """Remove the folders of trials whose worker was killed before it could do so itself."""
    for folder in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*-*"):
        worker = folder.name.removeprefix(_PREFIX).partition("-")[0]
        # Another worker may be doing the same at this moment.
        with contextlib.suppress(FileNotFoundError):
            mine = folder.lstat().st_uid == os.getuid() and not folder.is_symlink()
            if worker.isdecimal() and mine and not Path(f"/proc/{worker}").exists():
                _remove(folder)


def _remove(folder: Path) -> None:
    try:
        shutil.rmtree(folder, ignore_errors=True)
    except RecursionError:
        # rmtree recurses; a chain of a thousand folders is a student's doing.
        subprocess.run(["rm", "-rf", "--", str(folder)], check=False)
