"""What one student handed in, after reading: sources, model files, and where they came from.

Plain data; reading archives and folders is ``bundle.py``, deciding what to do with it is the service's.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class Source:
    """A Python file of the student's: the name it was handed in under, and its text."""

    name: str
    text: str


@dataclass(frozen=True, slots=True)
class Cell:
    """A code cell of a notebook; ``number`` is what Jupyter shows beside it after Restart & Run All."""

    number: int
    source: str
    tags: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Notebook:
    """A notebook of the student's: the name it was handed in under, and its code cells from the top."""

    name: str
    cells: tuple[Cell, ...]


@dataclass(frozen=True, slots=True)
class Submission:
    """One hand-in. ``files`` are what lies beside the sources, by flat name; a notebook stands for both sources."""

    student: str
    program: Source | None = None
    responder: Source | None = None
    files: Mapping[str, bytes] = field(default_factory=lambda: MappingProxyType({}))
    assignment: str | None = None  # named by the hand-in's submission.toml or its parent folder
    notes: tuple[str, ...] = ()  # what was ignored, stepped into or renamed while reading
    notebook: Notebook | None = None

    @property
    def sha256(self) -> str:
        """Hash of what was handed in, whoever handed it in and however it was packed."""
        digest = hashlib.sha256()
        for part, source in (("program", self.program), ("responder", self.responder)):
            if source is not None:
                data = source.text.encode("utf-8", "surrogatepass")
                digest.update(f"{part}:{len(data)}:".encode() + data)
        for cell in self.notebook.cells if self.notebook is not None else ():
            data = cell.source.encode("utf-8", "surrogatepass")
            tags = "\n".join(cell.tags).encode("utf-8", "surrogatepass")
            digest.update(f"cell:{len(data)}:{len(tags)}:".encode() + data + tags)
        for name in sorted(self.files):
            digest.update(f"file:{len(self.files[name])}:{name}:".encode() + self.files[name])
        return digest.hexdigest()
