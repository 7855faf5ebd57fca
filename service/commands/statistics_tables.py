"""Statistics of assignments for the terminal: a sentence and two tables for each.

``grading/statistics.py`` computes them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from service.commands.output import create_table
from service.reports.display_text import to_one_line

if TYPE_CHECKING:
    from rich.console import RenderableType

    from service.grading.class_statistics import AssignmentStatistics

_MOST_CAUSES = 5
#: Maximum number of students that a row names.
_MOST_NAMED = 10


def build_statistics(found: Iterable[AssignmentStatistics]) -> Iterator[RenderableType]:
    """Yield the texts and tables of each assignment, each after an empty line."""
    for each in found:
        spread = "" if each.spread is None else f", standard deviation {each.spread:.2f}"
        yield (
            f"\n{each.assignment}: {each.n} graded; mean {each.mean:.2f} of {each.max_marks.normalize():f}{spread}; "
            f"lowest {each.lowest:.2f}, median {each.median:.2f}, highest {each.highest:.2f}"
        )
        shares = create_table("criterion", "mean share of its marks", right=("mean share of its marks",))
        for criterion in each.criteria:
            shares.add_row(to_one_line(criterion.title), f"{criterion.mean_share:.0%}")
        yield shares
        if each.causes:
            causes = create_table("most common causes", "students", "who", right=("students",))
            for cause in each.causes[:_MOST_CAUSES]:
                causes.add_row(to_one_line(cause.sentence), str(len(cause.students)), format_names(cause.students))
            yield causes


def format_names(students: tuple[str, ...]) -> str:
    """Return the first student names, and dots if there are more."""
    return ", ".join(students[:_MOST_NAMED]) + (" ..." if len(students) > _MOST_NAMED else "")
