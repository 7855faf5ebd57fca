"""What processes there are below one, read from ``/proc``; starts and ends none."""

from __future__ import annotations

from pathlib import Path


def command_line(pid: int) -> str:
    """What the process was started as; empty when it has ended."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
    except (FileNotFoundError, ProcessLookupError):
        return ""


def children(pid: int) -> list[int]:
    """Those that the main thread of the process has started."""
    try:
        return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except (FileNotFoundError, ProcessLookupError):
        return []


def descendants(pid: int) -> list[int]:
    """All below the process."""
    return [each for child in children(pid) for each in (child, *descendants(child))]
