"""Stored programs of test runs: a packed submission, and before it the assignment of a run that has its own.

Such an assignment is deleted with the program, so that worlds that students choose leave no rows behind.
"""

from __future__ import annotations

_HEAD = b"robomark run 1\n"
_LENGTH_BYTES = 4


def add_assignment(packed_submission: bytes, content: bytes) -> bytes:
    """Return the stored program with this encoded assignment."""
    return b"".join((_HEAD, len(content).to_bytes(_LENGTH_BYTES, "big"), content, packed_submission))


def split_program(stored: bytes) -> tuple[bytes, bytes | None]:
    """Return the packed submission and the encoded assignment; None if the run has the assignment of its row."""
    if not stored.startswith(_HEAD):
        return stored, None
    start = len(_HEAD) + _LENGTH_BYTES
    end = start + int.from_bytes(stored[len(_HEAD) : start], "big")
    return stored[end:], stored[start:end]
