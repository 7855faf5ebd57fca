"""Statistics of assignments for the terminal: a sentence and two tables for each.

``grading/class_statistics.py`` computes them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from service.commands.output import create_table
from service.reports.display_text import to_one_line

if TYPE_CHECKING:
    from rich.console import RenderableType

    from service.grading.class_statistics import AssignmentStatistics
    from service.grading.task_quality import Interval, TaskQuality

_MAX_CAUSES = 5
#: Maximum number of students that a row names.
_MAX_NAMED = 10


def build_statistics(statistics: Iterable[AssignmentStatistics]) -> Iterator[RenderableType]:
    """Yield the texts and tables of each assignment, each after an empty line."""
    for assignment_statistics in statistics:
        spread = (
            "" if assignment_statistics.spread is None else f", standard deviation {assignment_statistics.spread:.2f}"
        )
        yield (
            f"\n{assignment_statistics.assignment}: {assignment_statistics.n} graded; mean "
            f"{assignment_statistics.mean:.2f} of {assignment_statistics.max_marks.normalize():f}{spread}; "
            f"lowest {assignment_statistics.lowest:.2f}, median {assignment_statistics.median:.2f}, highest "
            f"{assignment_statistics.highest:.2f}"
        )
        criteria_table = create_table("criterion", "mean share of its marks", right=("mean share of its marks",))
        for criterion in assignment_statistics.criteria:
            criteria_table.add_row(to_one_line(criterion.title), f"{criterion.mean_share:.0%}")
        yield criteria_table
        if assignment_statistics.causes:
            causes_table = create_table("most common causes", "students", "who", right=("students",))
            for cause in assignment_statistics.causes[:_MAX_CAUSES]:
                causes_table.add_row(
                    to_one_line(cause.sentence), str(len(cause.students)), format_names(cause.students)
                )
            yield causes_table


def build_quality(quality: TaskQuality) -> Iterator[RenderableType]:
    """Yield the table on an assignment's criteria, then a line for each finding."""
    if quality.criteria:
        columns = ("facility", "discrimination", "intended weight", "effective weight")
        table = create_table("how good is the task?", *columns, right=columns)
        for criterion in quality.criteria:
            table.add_row(
                to_one_line(criterion.title),
                _format_share(criterion.facility, criterion.facility_interval),
                _format_number(criterion.discrimination, criterion.discrimination_interval),
                f"{criterion.intended_weight:.0%}",
                _format_share(criterion.effective_weight, criterion.effective_weight_interval),
            )
        yield table
    yield from (to_one_line(finding.sentence) for finding in quality.findings)
    if quality.hidden_shares is not None:
        shares = quality.hidden_shares
        yield f"mean share of marks: {shares.visible:.0%} without hidden trials, {shares.hidden:.0%} with them"
    if quality.note:
        yield quality.note


def _format_share(value: float | None, interval: Interval | None) -> str:
    if value is None or interval is None:
        return "-"
    return f"{value:.0%} ({interval.low:.0%} to {interval.high:.0%})"


def _format_number(value: float | None, interval: Interval | None) -> str:
    if value is None or interval is None:
        return "-"
    return f"{value:.2f} ({interval.low:.2f} to {interval.high:.2f})"


def format_names(students: tuple[str, ...]) -> str:
    """Return the first student names, and dots if there are more."""
    return ", ".join(students[:_MAX_NAMED]) + (" ..." if len(students) > _MAX_NAMED else "")
