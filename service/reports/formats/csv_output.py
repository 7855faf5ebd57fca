"""The grades of a batch as comma-separated values: one row per submission, or one row per criterion.

Cells that a spreadsheet would interpret as a formula are neutralised. The caller selects the rows.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Iterator, Sequence

from service.grading.grade import Grade
from service.reports.formats.registry import table
from service.reports.readable import number, one_line
from service.reports.rows import TableRow
from service.reports.verdict_sentences import comments_of, hints_of
from service.reports.view import View, staff_view

#: The beginning of a formula in a cell. Spreadsheets that separate by semicolons (German Excel) or tabs split one of
#: our cells into several.
_FORMULA = re.compile(r"(^|[;\t])(?=[\s'\"]*[=+\-@\t\r\uff1d\uff0b\uff0d\uff20])")
_WHO = ("student", "name", "email", "assignment")
_MEASURED = ("accuracy", "accuracy_low", "accuracy_high", "accuracy_n", "submission", "assignment_version")


@table("csv", ".csv", staff_view)
def marks_csv(rows: Sequence[TableRow[View]]) -> str:
    """Return one row per submission: student, marks, verdict, accuracy, hashes, criteria, notes, hints and reason."""
    grades = [row.grade.grade for row in rows if row.grade is not None]
    criteria = list(dict.fromkeys(result.id for grade in grades for result in grade.criteria))
    header = [*_WHO, "marks", "max_marks", "verdict", *_MEASURED]
    header += [*(f"marks: {criterion}" for criterion in criteria), "for_staff", "notes", "hints", "file", "reason"]
    return csv_text([header, *(_wide(row, criteria) for row in rows)])


@table("csv-long", ".csv", staff_view)
def criteria_csv(rows: Sequence[TableRow[View]]) -> str:
    """Return one row per criterion of each submission; a submission without a grade has one row without marks."""
    header = [*_WHO, "criterion", "title", "marks", "max_marks", "message", "hints", "file", "reason"]
    return csv_text([header, *(cells for row in rows for cells in _long(row))])


def csv_text(rows: Iterable[Sequence[str]]) -> str:
    """Return the rows as a file that is safe to open in a spreadsheet."""
    return rows_as_given([safe_cell(value) for value in row] for row in rows)


def rows_as_given(rows: Iterable[Sequence[str]], separator: str = ",", ending: str = "\r\n") -> str:
    """Return the rows as a file with unchanged cells, for tables from others that are returned to them."""
    stream = io.StringIO()
    csv.writer(stream, delimiter=separator, lineterminator=ending).writerows(rows)
    return stream.getvalue()


def safe_cell(value: str) -> str:
    """Return the cell on one line, neutralised as a formula for any cell separator."""
    return _FORMULA.sub(r"\1'", one_line(value, 4000))


def _wide(row: TableRow[View], criteria: Sequence[str]) -> list[str]:
    grade = None if row.grade is None else row.grade.grade
    marked = _marked(grade, criteria) if grade is not None else [""] * (3 + len(_MEASURED) + len(criteria) + 3)
    return [*_who(row), *marked, row.source, row.reason]


def _marked(grade: Grade, criteria: Sequence[str]) -> list[str]:
    by_id = {result.id: "" if result.excused else number(result.marks) for result in grade.criteria}
    accuracy = grade.accuracy
    measured = [f"{accuracy.value:.4f}", f"{accuracy.low:.4f}", f"{accuracy.high:.4f}"] if accuracy else [""] * 3
    return [
        number(grade.marks),
        number(grade.max_marks),
        grade.verdict.value,
        *measured,
        str(accuracy.n) if accuracy else "",
        grade.submission,
        grade.assignment_version,
        *(by_id.get(criterion, "") for criterion in criteria),
        "; ".join(f"{result.id}: {result.for_staff}" for result in grade.criteria if result.for_staff),
        "; ".join([*(f"Comment: {comment}" for comment in comments_of(grade)), *grade.notes[:20]]),
        " ".join(hints_of(grade)),
    ]


def _long(row: TableRow[View]) -> Iterator[list[str]]:
    if row.grade is None:
        yield [*_who(row), "", "", "", "", "", "", row.source, row.reason]
        return
    hints = " ".join(hints_of(row.grade.grade))
    for result in row.grade.grade.criteria:
        marks = ["", ""] if result.excused else [number(result.marks), number(result.max_marks)]
        yield [*_who(row), result.id, result.title, *marks, result.message, hints, row.source, row.reason]


def _who(row: TableRow[View]) -> list[str]:
    return [row.student.id, row.student.name, row.student.email, row.assignment]
