"""Where the example hand-ins lie that come with Robomark.

They are hand-ins like any other: nothing here reads or grades them.
"""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from sim.errors import UsageError


def examples(assignment: str) -> Path:
    """The folder with the example hand-ins of an assignment. Raises UsageError if there are none."""
    root = Path(str(resources.files("submissions"))) / "examples"
    folders = sorted(folder.name for folder in root.iterdir() if folder.is_dir())
    if assignment not in folders:
        raise UsageError(f"There are no examples for {assignment!r}, expected one of {', '.join(folders)}.")
    return root / assignment
