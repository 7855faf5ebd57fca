"""``robomark batch overview``: the results of a batch, as on its web page."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal
from typing import TYPE_CHECKING

from service.commands.batch.control import DEFAULT_PASS_MARK, BatchId, PassMark
from service.commands.installation import open_installation
from service.commands.output import create_table, print_json, print_line, print_renderables
from service.commands.statistics_tables import build_quality, build_statistics, format_names

if TYPE_CHECKING:
    from rich.table import Table

    from service.operations.batch_views import ClassOverview, TableLine
    from submissions.student_identity import Student

_OUTLIER_REASONS = {
    "low": "much lower than the others",
    "slow": "took much longer than the others",
    "close": "close to the pass mark",
}


def show_overview(
    batch: BatchId,
    pass_mark: PassMark = DEFAULT_PASS_MARK,
) -> None:
    """Show marks, criteria, causes, how good the task is, submissions that need review, and missing submissions."""
    from service.operations import batch_views, batches

    with open_installation() as (service, actor):
        stored_batch = batches.find(service, actor, batch)
        overview = batch_views.show_overview(
            service, actor, stored_batch.course_id, stored_batch.id, Decimal(pass_mark) / 100
        )
    classes, refusals = overview.classes, overview.batch.refusals
    print_json(batch=stored_batch.id, classes=classes, refusals=refusals, missing=overview.missing)
    lines_by_id = {line.id: line for line in overview.lines}
    for class_overview in classes:
        print_renderables(*build_statistics([class_overview.statistics]), _build_distribution(class_overview))
        print_line(f"{class_overview.passed} of {class_overview.statistics.n} have {pass_mark} % or more")
        print_renderables(*build_quality(class_overview.quality))
        if class_overview.outliers:
            print_renderables(_build_outliers(class_overview, lines_by_id))
        for identical_lines in class_overview.identical:
            print_line(f"identical: {format_names(tuple(line.student for line in identical_lines))}")
        _print_missing(class_overview.missing)
    _print_missing(overview.missing)
    for refusal in refusals:
        print_line(f"rejected: {refusal.source}: {refusal.reason}")


def _print_missing(students: Sequence[Student]) -> None:
    if students:
        print_line(f"not submitted: {format_names(tuple(student.name or student.id for student in students))}")


def _build_distribution(class_overview: ClassOverview) -> Table:
    table = create_table("marks", "students", right=("students",))
    for number, bin_ in enumerate(class_overview.distribution, start=1):
        low, high = (f"{edge.normalize():f}" for edge in (bin_.low, bin_.high))
        marks = f"{low} (all)" if number == len(class_overview.distribution) else f"{low} to below {high}"
        table.add_row(marks, str(bin_.count))
    return table


def _build_outliers(class_overview: ClassOverview, lines_by_id: dict[str, TableLine]) -> Table:
    table = create_table("needs review", "why", "grade")
    for outlier in class_overview.outliers:
        table.add_row(lines_by_id[outlier.id].student, _OUTLIER_REASONS[outlier.why], outlier.id)
    return table
