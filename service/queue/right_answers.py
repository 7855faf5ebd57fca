"""That a known answer was given rightly, in a file of the home: by one build, on one machine, since that was started.

It lets a worker that starts take work before it is asked again, and stands for nothing else: what is asked later, and
what the sandbox is asked, is asked each time.
"""

from __future__ import annotations

import hashlib
import platform
import time
from contextlib import suppress
from pathlib import Path

from service.queue.processes import run_file
from service.version import grader_sha256

_HOLDS_SECONDS = 86_400
#: What tells a machine, and that it was not started anew.
_MACHINE = (Path("/proc/sys/kernel/random/boot_id"), Path("/proc/version"))
_PROCESSORS = Path("/proc/cpuinfo")


class RightAnswer:
    """Whether this build has answered rightly on this machine within a day."""

    def __init__(self, folder: Path, question: bytes) -> None:
        """``question`` is all that is asked and known."""
        self._folder = folder
        self._file = folder / f"right-answer-{_build_and_machine(question)}"

    @property
    def given(self) -> bool:
        """Whether it is written down."""
        try:
            return 0 <= time.time() - self._file.stat().st_mtime < _HOLDS_SECONDS
        except OSError:
            return False

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
