"""That a known answer was given rightly, in a file of the home: by one build, on one machine, since that was started.

It lets a worker that starts take work before it is asked again, and stands for nothing else: what is asked later, and
what the sandbox is asked, is asked each time. Where it is not there, one process of the home asks and the others wait.
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

from responders.sandbox.zygote import Role
from service.queue.processes import run_file
from service.version import grader_sha256

#: The submission and the assignment that are asked for.
QUESTION = Path(__file__).with_name("known_answer")
#: What the processes come from that answer it; whoever is to ask soon lets these begin, the slowest first.
ANSWERED_BY: tuple[Role, ...] = ("responder", "robot")
_HOLDS_SECONDS = 86_400
#: Who waits for another's answer longer than that asks as well: a pool child that begins has not for ever.
_LONGEST_WAIT_SECONDS = 20.0
_LOOK_SECONDS = 0.02
#: What tells a machine, and that it was not started anew.
_MACHINE = (Path("/proc/sys/kernel/random/boot_id"), Path("/proc/version"))
_PROCESSORS = Path("/proc/cpuinfo")


class RightAnswer:
    """Whether this build has answered rightly on this machine within a day."""

    def __init__(self, folder: Path, question: bytes) -> None:
        """``question`` is all that is asked and known."""
        self._folder = folder
        self._lock: IO[str] | None = None
        self._file = folder / f"right-answer-{_build_and_machine(question)}"

    @property
    def given(self) -> bool:
        """Whether it is written down."""
        try:
            return 0 <= time.time() - self._file.stat().st_mtime < _HOLDS_SECONDS
        except OSError:
            return False

    def is_ours_to_ask(self) -> bool:
        """Whether it is not given, and nobody else is asking; others wait then until we were ``alone``."""
        return not self.given and self._locks()

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Meanwhile no other process of the home asks, unless it takes too long."""
        until = time.monotonic() + _LONGEST_WAIT_SECONDS
        while self._lock is None and not self._locks() and time.monotonic() < until:
            time.sleep(_LOOK_SECONDS)
        try:
            yield
        finally:
            if self._lock is not None:
                self._lock.close()
                self._lock = None

    def _locks(self) -> bool:
        lock = run_file(self._folder / "right-answer.lock").open("a")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            lock.close()
            return False
        self._lock = lock
        return True

    def note(self) -> None:
        """Write down that it was given now."""
        # A full disk must not end a worker that has work to do.
        with suppress(OSError):
            run_file(self._file).touch()

    def forget(self) -> None:
        """Whoever starts next on this home is asked, whatever the build."""
        with suppress(OSError):
            for file in self._folder.glob("right-answer-*"):
                file.unlink(missing_ok=True)


def right_answer(folder: Path) -> RightAnswer:
    """Where in ``folder`` it stands that the known answer was given rightly."""
    asked = sorted(file for file in QUESTION.rglob("*") if file.is_file() and file.suffix in (".py", ".toml", ".json"))
    return RightAnswer(folder, b"".join(file.read_bytes() for file in asked))


def _build_and_machine(question: bytes) -> str:
    # The first processor's lines: they end before an empty one, and hold how fast it runs at the moment.
    first = _text(_PROCESSORS).partition("\n\n")[0].splitlines()
    processor = [line for line in first if "MHz" not in line]
    parts = [grader_sha256(), platform.node(), *map(_text, _MACHINE), *processor]
    return hashlib.sha256(question + "\n".join(parts).encode()).hexdigest()[:32]


def _text(file: Path) -> str:
    with suppress(OSError):
        return file.read_text()
    return ""
