"""Reads the list that Gradescope puts beside the submissions of an export: YAML as Ruby writes it, as plain data.

Who is meant by what it says is ``downloads.py``'s.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sim.errors import UsageError
from sim.readers.unreadable import Unreadable
from sim.readers.yaml_text import MOST_BYTES, read_yaml


def read_list(path: Path) -> dict[str, Any]:
    """The submissions by their folders. Every value is text, whatever Ruby calls it, and nothing is merged or made.

    Raises UsageError for what cannot be read as such a list.
    """
    try:
        with path.open("rb") as stream:
            listed = read_yaml(stream.read(MOST_BYTES + 1))
    except OSError as error:
        raise UsageError(f"{path.name}: cannot be read: {error.strerror}.") from None
    except Unreadable as error:
        raise UsageError(
            f"{path.name}: cannot be read: {error}, expected Gradescope's list as it was exported."
        ) from None
    if not isinstance(listed, dict):
        raise UsageError(f"{path.name}: is no list of submissions, expected Gradescope's as it was exported.")
    return {name: own for name, own in listed.items() if isinstance(name, str)}
