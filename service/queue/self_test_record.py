"""Cache of a passed self-test in the home, valid for one build on one machine until it restarts.

It lets a new worker take jobs before its own self-test; later self-tests and sandbox checks always run. Without the
cache, one process of the home runs the self-test and the others wait.
"""

from __future__ import annotations

import fcntl
import hashlib
import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from responders.sandbox.roles import ChildRole
from service.queue.processes import prepare_run_file
from service.version import hash_grader

#: The submission and the assignment of the self-test.
KNOWN_ANSWER_FOLDER = Path(__file__).with_name("known_answer")
#: Roles of the zygotes that the self-test needs, slowest first, so that they can be started in advance.
SELF_TEST_ROLES: tuple[ChildRole, ...] = ("responder", "robot")
_VALID_SECONDS = 86_400
#: A process that waits longer runs the self-test itself, because the start of a pool child has a time limit.
_MAX_WAIT_SECONDS = 20.0
_POLL_SECONDS = 0.02
#: Identify a machine and its current boot.
_MACHINE = (Path("/proc/sys/kernel/random/boot_id"), Path("/proc/version"))
_PROCESSORS = Path("/proc/cpuinfo")


class SelfTestRecord:
    """The record that this build has passed the self-test on this machine within a day."""

    def __init__(self, folder: Path, question: bytes) -> None:
        """Open the record. ``question`` is the content of the self-test, which is part of its key."""
        self._folder = folder
        self._lock: IO[str] | None = None
        self._file = folder / f"right-answer-{_hash_build_and_machine(question)}"

    @property
    def given(self) -> bool:
        """Return whether a passed self-test is recorded."""
        try:
            return 0 <= time.time() - self._file.stat().st_mtime < _VALID_SECONDS
        except OSError:
            return False

    def should_run_here(self) -> bool:
        """Return whether no pass is recorded and no other process runs the self-test.

        Others wait until ``alone`` ends.
        """
        return not self.given and self._try_lock()

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Prevent other processes of the home from running the self-test, within a time limit."""
        deadline = time.monotonic() + _MAX_WAIT_SECONDS
        while self._lock is None and not self._try_lock() and time.monotonic() < deadline:
            time.sleep(_POLL_SECONDS)
        try:
            yield
        finally:
            if self._lock is not None:
                self._lock.close()
                self._lock = None

    def _try_lock(self) -> bool:
        lock = prepare_run_file(self._folder / "right-answer.lock").open("a")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            lock.close()
            return False
        self._lock = lock
        return True

    def note(self) -> None:
        """Record that the self-test passed now."""
        # A full disk must not end a worker that has jobs.
        with suppress(OSError):
            prepare_run_file(self._file).touch()

    def forget(self) -> None:
        """Delete the record for all builds, so that the next process of this home runs the self-test."""
        with suppress(OSError):
            for file in self._folder.glob("right-answer-*"):
                file.unlink(missing_ok=True)


def open_self_test_record(folder: Path) -> SelfTestRecord:
    """Return the record of passed self-tests in ``folder``."""
    question_files = sorted(
        file for file in KNOWN_ANSWER_FOLDER.rglob("*") if file.is_file() and file.suffix in (".py", ".toml", ".json")
    )
    return SelfTestRecord(folder, b"".join(file.read_bytes() for file in question_files))


def _hash_build_and_machine(question: bytes) -> str:
    # Only the first processor, without its current clock rate. An empty line ends it.
    first_processor = _read_text(_PROCESSORS).partition("\n\n")[0].splitlines()
    processor = [line for line in first_processor if "MHz" not in line]
    parts = [hash_grader(), platform.node(), *map(_read_text, _MACHINE), *processor]
    return hashlib.sha256(question + "\n".join(parts).encode()).hexdigest()[:32]


def _read_text(file: Path) -> str:
    with suppress(OSError):
        return file.read_text()
    return ""
