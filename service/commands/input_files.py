"""Reading of files that are named on the command line and are not submissions."""

from __future__ import annotations

from pathlib import Path

from sim.errors import UsageError


def read_input_file(path: Path, max_bytes: int) -> bytes:
    """Return the bytes of a regular file. Raises UsageError if it cannot be read or is larger than ``max_bytes``."""
    try:
        if not path.is_file():
            raise UsageError(f"{path}: is not a file")
        with path.open("rb") as stream:
            content = stream.read(max_bytes + 1)
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
    if len(content) > max_bytes:
        raise UsageError(f"{path}: is larger than {max_bytes / 1e6:g} MB")
    return content
