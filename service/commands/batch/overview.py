"""``robomark batch overview``: the results of a batch, as on its web page."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal
from typing import TYPE_CHECKING, Annotated

import typer

from service.commands.batch.control import BatchId
from service.commands.installation import open_installation
from service.commands.output import create_table, print_json, print_line, print_renderables
from service.commands.statistics_tables import build_statistics, format_names
from service.grading.class_statistics import PASS_SHARE

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
    pass_mark: Annotated[
        int, typer.Option("--pass", min=0, max=100, help="The pass mark, in percent of all marks.")
    ] = int(PASS_SHARE * 100),
) -> None:
    """Show marks and their distribution, criteria, causes, students who need attention, and missing submissions."""
    from service.operations import batch_views, batches

    with open_installation() as (service, actor):
        found = batches.find(service, actor, batch)
        shown = batch_views.show_overview(service, actor, found.course_id, found.id, Decimal(pass_mark) / 100)
    classes, refusals = shown.classes, shown.batch.refusals
    print_json(batch=found.id, classes=classes, refusals=refusals, missing=shown.missing)
    by_id = {line.id: line for line in shown.lines}
    for each in classes:
        print_renderables(*build_statistics([each.statistics]), _build_distribution(each))
        print_line(f"{each.passed} of {each.statistics.n} have {pass_mark} % or more")
        if each.outliers:
            print_renderables(_build_outliers(each, by_id))
        for same in each.identical:
            print_line(f"identical: {format_names(tuple(line.student for line in same))}")
        _print_missing(each.missing)
    _print_missing(shown.missing)
    for refusal in refusals:
        print_line(f"rejected: {refusal.source}: {refusal.reason}")


def _print_missing(students: Sequence[Student]) -> None:
    if students:
        print_line(f"not submitted: {format_names(tuple(student.name or student.id for student in students))}")


def _build_distribution(each: ClassOverview) -> Table:
    made = create_table("marks", "students", right=("students",))
    for place, bin_ in enumerate(each.distribution, start=1):
        low, high = (f"{edge.normalize():f}" for edge in (bin_.low, bin_.high))
        marks = f"{low} (all)" if place == len(each.distribution) else f"{low} to below {high}"
        made.add_row(marks, str(bin_.count))
    return made


def _build_outliers(each: ClassOverview, by_id: dict[str, TableLine]) -> Table:
    made = create_table("needs review", "why", "grade")
    for outlier in each.outliers:
        made.add_row(by_id[outlier.id].student, _OUTLIER_REASONS[outlier.why], outlier.id)
    return made
