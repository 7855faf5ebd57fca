"""Reader of a notebook's diagram cells (``%%blockdiag`` and ``%%seqdiag``).

The cells are parsed, but not executed or drawn.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import cast

from sim.errors import UsageError
from sim.sentences import Sentence
from submissions.diagram import Diagram, DiagramKind
from submissions.diagram_text import read_diagram
from submissions.source_text import find_magic_line
from submissions.submission import Notebook

MAX_DIAGRAMS = 20
#: Limit for all diagrams of a notebook: six times the course's largest notebook. Drawing a part takes about 15 ms.
MAX_PARTS = 240
_MAGIC = re.compile(r"%%(?P<kind>blockdiag|seqdiag)\b")


@dataclass(frozen=True, slots=True)
class DiagramCell:
    """A cell number and its diagram."""

    cell: int
    diagram: Diagram


@dataclass(frozen=True, slots=True)
class NotebookDiagrams:
    """The diagrams of a notebook from the top, and a sentence for each cell that could not be read."""

    cells: tuple[DiagramCell, ...] = ()
    problems: tuple[str, ...] = ()


def read_diagrams(notebook: Notebook | None) -> NotebookDiagrams:
    """Read the first ``MAX_DIAGRAMS`` diagrams of a notebook; without a notebook there are none.

    A diagram is omitted if it exceeds ``MAX_PARTS`` together with the earlier ones.
    """
    remaining_parts = MAX_PARTS
    diagram_cells: list[DiagramCell] = []
    problems: list[str] = []
    for cell in notebook.cells if notebook is not None else ():
        magic_line = find_magic_line(cell.source)
        lines = cell.source.split("\n")
        magic = _MAGIC.match(lines[magic_line].lstrip("\ufeff").strip()) if magic_line is not None else None
        if magic_line is None or magic is None:
            continue
        if len(diagram_cells) + len(problems) == MAX_DIAGRAMS:
            problems.append(
                Sentence(
                    "cell %(cell)s: of all diagrams only the first %(count)s are drawn",
                    cell=cell.number,
                    count=MAX_DIAGRAMS,
                )
            )
            break
        kind = cast(DiagramKind, magic["kind"])
        try:
            diagram = read_diagram(kind, "\n".join(lines[magic_line + 1 :]), magic_line + 2)
        except UsageError as error:
            problems.append(
                Sentence("cell %(cell)s, %(error)s; the diagram is not drawn", cell=cell.number, error=error.message)
            )
            continue
        if diagram.parts > remaining_parts:
            problems.append(
                Sentence(
                    "cell %(cell)s: all diagrams together have more than %(count)s actors, steps and texts; this one "
                    "is not drawn",
                    cell=cell.number,
                    count=MAX_PARTS,
                )
            )
            continue
        remaining_parts -= diagram.parts
        diagram_cells.append(DiagramCell(cell.number, diagram))
    return NotebookDiagrams(tuple(diagram_cells), tuple(problems))
