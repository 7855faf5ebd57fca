"""The diagrams that a notebook draws: its ``%%blockdiag`` and ``%%seqdiag`` cells, read.

Nothing is run for it, and nothing is drawn here.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import cast

from sim.errors import UsageError
from submissions.diagram import Diagram, DiagramKind
from submissions.diagram_text import read_diagram
from submissions.source_text import magic_place
from submissions.submission import Notebook

MOST_DIAGRAMS = 20
#: Of all diagrams of a notebook together: six times what the course's largest notebook has; a part takes about 15 ms.
MOST_PARTS = 240
_MAGIC = re.compile(r"%%(?P<kind>blockdiag|seqdiag)\b")


@dataclass(frozen=True, slots=True)
class DiagramCell:
    """A cell, by its number, and what it draws."""

    cell: int
    diagram: Diagram


@dataclass(frozen=True, slots=True)
class NotebookDiagrams:
    """A notebook's diagrams from the top, and a sentence on each cell that could not be read as one."""

    cells: tuple[DiagramCell, ...] = ()
    problems: tuple[str, ...] = ()


def diagrams_in(notebook: Notebook | None) -> NotebookDiagrams:
    """What the cells of a notebook draw; of more than ``MOST_DIAGRAMS`` the first ones. None without a notebook.

    One that does not fit into ``MOST_PARTS`` with those before it is left out.
    """
    left = MOST_PARTS
    found: list[DiagramCell] = []
    problems: list[str] = []
    for cell in notebook.cells if notebook is not None else ():
        place = magic_place(cell.source)
        lines = cell.source.split("\n")
        magic = _MAGIC.match(lines[place].lstrip("\ufeff").strip()) if place is not None else None
        if place is None or magic is None:
            continue
        if len(found) + len(problems) == MOST_DIAGRAMS:
            problems.append(f"cell {cell.number}: of all diagrams only the first {MOST_DIAGRAMS} are drawn")
            break
        kind = cast(DiagramKind, magic["kind"])
        try:
            diagram = read_diagram(kind, "\n".join(lines[place + 1 :]), place + 2)
        except UsageError as error:
            problems.append(f"cell {cell.number}, {error}; the diagram is not drawn")
            continue
        if diagram.parts > left:
            problems.append(
                f"cell {cell.number}: all diagrams together have more than {MOST_PARTS} actors, steps and texts; "
                "this one is not drawn"
            )
            continue
        left -= diagram.parts
        found.append(DiagramCell(cell.number, diagram))
    return NotebookDiagrams(tuple(found), tuple(problems))
