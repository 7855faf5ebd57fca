"""A control group with little memory for a process under test, version 2 or 1, if this user may create one."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

_ROOT = Path("/sys/fs/cgroup")


@dataclass(frozen=True)
class MemoryGroup:
    """The folder of the group and the names of its files."""

    folder: Path
    limit: str
    most: str
    events: str

    def enter(self) -> None:
        """Called in the process to be limited, before it executes another program."""
        (self.folder / "cgroup.procs").write_text(str(os.getpid()))

    @property
    def most_bytes(self) -> int:
        return int((self.folder / self.most).read_text())

    @property
    def killed(self) -> int:
        """Return the number of processes that the kernel's out-of-memory killer ended in the group."""
        lines = dict(line.split() for line in (self.folder / self.events).read_text().splitlines())
        return int(lines["oom_kill"])


@contextmanager
def memory_group(size: int) -> Iterator[MemoryGroup | None]:
    """Yield a group of ``size`` bytes, or None if none can be created."""
    made = _made(size)
    try:
        yield made
    finally:
        if made is not None:
            for _ in range(100):
                with suppress(OSError):
                    for inner in made.folder.glob("*/"):
                        inner.rmdir()
                    made.folder.rmdir()
                    break
                time.sleep(0.1)


def _made(size: int) -> MemoryGroup | None:
    name = f"robomark-test-{os.getpid()}"
    kinds = (
        MemoryGroup(_ROOT / name, "memory.max", "memory.peak", "memory.events"),
        MemoryGroup(
            _ROOT / "memory" / name, "memory.limit_in_bytes", "memory.max_usage_in_bytes", "memory.oom_control"
        ),
    )
    for kind in kinds:
        if not (kind.folder.parent / "cgroup.procs").exists():
            continue
        try:
            kind.folder.mkdir()
            (kind.folder / kind.limit).write_text(str(size))
        except OSError:
            with suppress(OSError):
                kind.folder.rmdir()
            continue
        return kind
    return None
