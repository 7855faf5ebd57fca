"""``robomark batch overview``: the results of a batch, as on its web page."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal
from typing import TYPE_CHECKING, Annotated

import typer

from service.commands.batch.control import BatchId
from service.commands.operating import operating
from service.commands.shown import document, show, table, tell
from service.commands.statistics_shown import named, statistics_parts
from service.grading.statistics import PASS_SHARE

if TYPE_CHECKING:
    from rich.table import Table

    from service.operations.batch_views import ClassOverview, TableLine
    from submissions.student_identity import Student

_WHY = {
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

    with operating() as (service, actor):
        found = batches.find(service, actor, batch)
        shown = batch_views.show_overview(service, actor, found.course_id, found.id, Decimal(pass_mark) / 100)
    classes, refusals = shown.classes, shown.batch.refusals
    document(batch=found.id, classes=classes, refusals=refusals, missing=shown.missing)
    by_id = {line.id: line for line in shown.lines}
    for each in classes:
        show(*statistics_parts([each.statistics]), _distribution(each))
        tell(f"{each.passed} of {each.statistics.n} have {pass_mark} % or more")
        if each.outliers:
            show(_outliers(each, by_id))
        for same in each.identical:
            tell(f"identical: {named(tuple(line.student for line in same))}")
        _tell_missing(each.missing)
    _tell_missing(shown.missing)
    for refusal in refusals:
        tell(f"rejected: {refusal.source}: {refusal.reason}")


def _tell_missing(students: Sequence[Student]) -> None:
    if students:
        tell(f"not submitted: {named(tuple(student.name or student.id for student in students))}")


def _distribution(each: ClassOverview) -> Table:
    made = table("marks", "students", right=("students",))
    for place, bin_ in enumerate(each.distribution, start=1):
        low, high = (f"{edge.normalize():f}" for edge in (bin_.low, bin_.high))
        marks = f"{low} (all)" if place == len(each.distribution) else f"{low} to below {high}"
        made.add_row(marks, str(bin_.count))
    return made


def _outliers(each: ClassOverview, by_id: dict[str, TableLine]) -> Table:
    made = table("needs review", "why", "grade")
    for outlier in each.outliers:
        made.add_row(by_id[outlier.id].student, _WHY[outlier.why], outlier.id)
    return made
