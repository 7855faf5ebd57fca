"""Process trees, read from ``/proc``. Starts and ends no process."""

from __future__ import annotations

from pathlib import Path


def read_command_line(pid: int) -> str:
    """Return the command line of a process, or "" if it has ended."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
    except (FileNotFoundError, ProcessLookupError):
        return ""


def find_children(pid: int) -> list[int]:
    """Return the child processes that the main thread of a process has started."""
    try:
        return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except (FileNotFoundError, ProcessLookupError):
        return []


def find_descendants(pid: int) -> list[int]:
    """Return all processes below a process."""
    return [each for child in find_children(pid) for each in (child, *find_descendants(child))]
