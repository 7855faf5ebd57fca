"""``robomark batch overview``: what came of a batch at a glance, as its page on the web has it.

What is in it is ``store/overview.py``'s.
"""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal
from typing import TYPE_CHECKING, Annotated

import typer

from service.commands.batch.control import BatchId
from service.commands.shown import document, show, table, tell
from service.commands.statistics_shown import named, statistics_parts
from service.settings import load_settings
from service.store.batches import batches
from service.store.batches.batch_table import table_lines
from service.store.batches.overview import PASS_SHARE, missing, overview
from service.store.courses.hidden_names import hidden_names
from service.store.engine import open_store
from service.store.installation import secret_of
from service.store.models import Batch

if TYPE_CHECKING:
    from rich.table import Table

    from service.store.batches.batch_table import TableLine
    from service.store.batches.overview import ClassOverview
    from submissions.people import Student

_WHY = {"low": "far below the others", "slow": "took far longer than the others", "close": "close to the pass mark"}


def show_overview(
    batch: BatchId,
    pass_mark: Annotated[
        int, typer.Option("--pass", min=0, max=100, help="The pass mark, per cent of all marks.")
    ] = int(PASS_SHARE * 100),
) -> None:
    """Marks and their distribution, criteria, causes, whom to look at, and who has not submitted."""
    with open_store(load_settings()) as store:
        secret = secret_of(store)
        with store.reading() as session:
            batch_id = batches.find_batch(session, batch)
            course_id = session.get_one(Batch, batch_id).course_id
            own = batches.batch(session, batch_id)
            lines = table_lines(session, batch_id, own.refusals, hidden_names(session, course_id, secret))
            classes = overview(session, course_id, lines, Decimal(pass_mark) / 100)
            asked = own.web_assignment if not classes else None
            nobody = missing(session, course_id, asked) if asked else ()
    document(batch=batch_id, classes=classes, refusals=own.refusals, missing=nobody)
    by_id = {line.id: line for line in lines}
    for each in classes:
        show(*statistics_parts([each.statistics]), _distribution(each))
        tell(f"{each.passed} of {each.statistics.n} have {pass_mark} % or more")
        if each.outliers:
            show(_outliers(each, by_id))
        for same in each.identical:
            tell(f"the very same: {named(tuple(line.student for line in same))}")
        _tell_missing(each.missing)
    _tell_missing(nobody)
    for refusal in own.refusals:
        tell(f"refused: {refusal.source}: {refusal.reason}")


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
    made = table("to be looked at", "why", "grade")
    for outlier in each.outliers:
        made.add_row(by_id[outlier.id].student, _WHY[outlier.why], outlier.id)
    return made
