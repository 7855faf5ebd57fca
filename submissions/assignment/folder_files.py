"""The files of an assignment's folder, without links that lead out of it.

This module opens no files.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from submissions.assignment.problems import AssignmentProblems


def walk_files(folder: Path) -> Iterator[tuple[tuple[str, ...], Path]]:
    """Yield the parts of the name and the path of each file in an assignment's folder, sorted.

    Dot files and Python's caches are omitted.

    Raises:
        AssignmentProblems: A link leads out of the folder. Its author could read files of whoever uses the assignment.
    """
    root = folder.resolve()
    for path in sorted(folder.rglob("*")):
        parts = path.relative_to(folder).parts
        if any(part.startswith(".") or part == "__pycache__" for part in parts):
            continue
        if path.is_symlink() and not path.resolve().is_relative_to(root):
            raise AssignmentProblems((f"{path}: is a link that leads out of the folder, expected the file itself",))
        if path.is_file():
            yield parts, path
