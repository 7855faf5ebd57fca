"""Private folders of trials, all in one folder of the worker, and removed with their content.

The sandbox decides which operations a student's process may perform in its folder. Here, its size is limited.
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

from responders.sandbox import process_state
from responders.sandbox.meter import ChildStopped
from sim.recording import Verdict

_PREFIX = "robomark-trials-"
#: Other users may traverse the folder, as children with their own user must, but not list it.
_MODE = 0o711
#: Number of inodes that each trial consumes where they are counted up: several times the limit for a child.
_INODES_PER_TRIAL = 1024
#: Maximum number of low inodes reserved during a trial, several times the number that others use meanwhile.
_MAX_RESERVED_INODES = 64
#: Space for a child in its folder, in addition to the given files.
_MAX_WRITTEN_BYTES = 16 << 20
_MAX_WRITTEN_FILES = 256
_MAX_GIVEN_FILES = 10_000


class PrivateFolders:
    """The parent folder of private folders, created on first use and locked while its worker runs."""

    def __init__(self) -> None:
        self._path: Path | None = None
        self._lock = -1
        self._counting = False  # whether the file system counts inode numbers up

    @property
    def path(self) -> Path:
        """The parent folder, created again if it was deleted."""
        if self._path is None or not self._path.is_dir():
            self._create_parent(self._path)
        assert self._path is not None
        return self._path

    @contextlib.contextmanager
    def one(self) -> Iterator[Path]:
        """Yield the folder of one trial and remove it afterwards."""
        with self._hidden_inode_numbers():
            folder = Path(tempfile.mkdtemp(dir=self.path))
            try:
                yield folder
            finally:
                _remove_folder(folder)

    @contextlib.contextmanager
    def _hidden_inode_numbers(self) -> Iterator[None]:
        """Prevent inode numbers from revealing how many files an earlier trial has created.

        Some file systems count up (tmpfs, Btrfs): there every trial consumes the same number of inodes. Others reuse
        the lowest free number (ext4), which would reveal the files created beside an earlier trial. There a random
        number of low inodes is reserved during the trial.
        """
        folder = self.path
        if self._counting:
            end = _read_inode_number(folder) + _INODES_PER_TRIAL
            try:
                yield
            finally:
                for _ in range(_INODES_PER_TRIAL):
                    if _read_inode_number(folder) >= end:
                        break
            return
        reserve = Path(tempfile.mkdtemp(dir=folder))
        try:
            for number in range(secrets.randbelow(_MAX_RESERVED_INODES)):
                (reserve / str(number)).touch(0o600)
            yield
        finally:
            _remove_folder(reserve)

    def close(self) -> None:
        """Remove the folder and release its lock."""
        if self._path is not None:
            _remove_folder(self._path)
            self._path = None
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def _create_parent(self, path: Path | None) -> None:
        path, lock = create_locked_folder(_PREFIX, _MODE, path)
        if self._lock >= 0:
            os.close(self._lock)
        self._path, self._lock = path, lock
        self._counting = len({_read_inode_number(path) for _ in range(4)}) == 4


class FolderLimit:
    """The limit on the files that a child adds to its folder."""

    def __init__(self, folder: Path) -> None:
        """``folder`` contains the given files."""
        self._folder = folder
        given_bytes, given_files = process_state.measure_folder(folder, _MAX_GIVEN_FILES)
        self._max_bytes, self._max_files = given_bytes + _MAX_WRITTEN_BYTES, given_files + _MAX_WRITTEN_FILES

    def check(self) -> None:
        """Check the size of the folder, which is flat: the sandbox allows neither subfolders nor links.

        Raises:
            ChildStopped: If it has grown too large.
        """
        size, count = process_state.measure_folder(self._folder, self._max_files + 1)
        if size > self._max_bytes or count > self._max_files:
            raise ChildStopped(
                Verdict.OUTPUT_LIMIT,
                f"it wrote more than {_MAX_WRITTEN_BYTES >> 20} MB or {_MAX_WRITTEN_FILES} files into its folder",
            )


def _read_inode_number(folder: Path) -> int:
    """Return the inode number of a new file in ``folder``; the file is deleted."""
    path = folder / "number"
    path.touch(0o600)
    try:
        return path.stat().st_ino
    finally:
        path.unlink()


def create_locked_folder(prefix: str, mode: int, path: Path | None = None) -> tuple[Path, int]:
    """Create a temporary folder, at ``path`` if given.

    Returns:
        The folder, and its lock: a descriptor to close at the end.
    """
    # The hidden name protects it from the removal of left-overs until it is locked.
    hidden_folder = Path(tempfile.mkdtemp(prefix=f".{prefix}"))
    hidden_folder.chmod(mode)
    path = path or hidden_folder.with_name(hidden_folder.name.removeprefix("."))
    lock = os.open(hidden_folder, os.O_RDONLY | os.O_DIRECTORY)
    fcntl.flock(lock, fcntl.LOCK_EX)
    hidden_folder.rename(path)
    return path, lock


def remove_stale_folders(prefix: str = _PREFIX) -> None:
    """Remove the locked folders whose process was killed before it could remove them.

    The process may be in another namespace, where process ids mean nothing. So a released lock is the only criterion.
    """
    for folder in Path(tempfile.gettempdir()).glob(f"{prefix}*"):
        # Another worker may be removing it at the same time.
        with contextlib.suppress(OSError), _open_folder(folder) as descriptor:
            if os.fstat(descriptor).st_uid == os.getuid():
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                _remove_folder(folder)


@contextlib.contextmanager
def _open_folder(folder: Path) -> Iterator[int]:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def _remove_folder(folder: Path) -> None:
    try:
        shutil.rmtree(folder, ignore_errors=True)
    except RecursionError:
        # rmtree recurses, and student code can nest a thousand folders.
        subprocess.run(["rm", "-rf", "--", str(folder)], check=False)
