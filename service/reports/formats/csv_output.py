"""The grades of a batch as comma-separated values: one row per submission, or one row per criterion.

If a criterion depends on a pool of trials, columns show its status, its trials and the bounds of its value (0 to 1).
Cells that a spreadsheet would interpret as a formula are neutralised. The caller selects the rows.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Iterator, Sequence

from service.grading.grade import CriterionResult, Grade
from service.reports.display_text import format_decimal, to_one_line
from service.reports.formats.registry import register_table
from service.reports.rows import TableRow
from service.reports.verdict_sentences import format_comments, format_hints
from service.reports.view import View, build_staff_view

#: The beginning of a formula in a cell. Spreadsheets that separate by semicolons (German Excel) or tabs split one of
#: our cells into several.
_FORMULA = re.compile(r"(^|[;\t])(?=[\s'\"]*[=+\-@\t\r\uff1d\uff0b\uff0d\uff20])")
_STUDENT_COLUMNS = ("student", "name", "email", "assignment")
_ACCURACY_COLUMNS = ("accuracy", "accuracy_low", "accuracy_high", "accuracy_n", "submission", "assignment_version")

_POOL_COLUMNS = ("status", "trials_run", "pool", "value_low", "value_high")


@register_table("csv", ".csv", build_staff_view)
def render_marks_csv(rows: Sequence[TableRow[View]]) -> str:
    """Return one row per submission: student, marks, verdict, accuracy, hashes, criteria, notes, hints and reason."""
    results = _list_results(rows)
    criteria = list(dict.fromkeys(result.id for result in results))
    pool_criteria = list(dict.fromkeys(result.id for result in results if result.pool is not None))
    header = [*_STUDENT_COLUMNS, "marks", "max_marks", "verdict", *_ACCURACY_COLUMNS]
    header += [f"marks: {criterion}" for criterion in criteria]
    header += [f"{column}: {criterion}" for criterion in pool_criteria for column in _POOL_COLUMNS]
    header += ["for_staff", "notes", "hints", "file", "reason"]
    return render_safe_csv([header, *(_format_submission_row(row, criteria, pool_criteria) for row in rows)])


@register_table("csv-long", ".csv", build_staff_view)
def render_criteria_csv(rows: Sequence[TableRow[View]]) -> str:
    """Return one row per criterion of each submission; a submission without a grade has one row without marks."""
    pool_columns = _POOL_COLUMNS if any(result.pool is not None for result in _list_results(rows)) else ()
    header = [*_STUDENT_COLUMNS, "criterion", "title", "marks", "max_marks", *pool_columns]
    header += ["message", "hints", "file", "reason"]
    has_pools = bool(pool_columns)
    return render_safe_csv([header, *(cells for row in rows for cells in _format_criterion_rows(row, has_pools))])


def render_safe_csv(rows: Iterable[Sequence[str]]) -> str:
    """Return the rows as a file that is safe to open in a spreadsheet."""
    return render_csv([to_safe_cell(value) for value in row] for row in rows)


def render_csv(rows: Iterable[Sequence[str]], separator: str = ",", ending: str = "\r\n") -> str:
    """Return the rows as a file with unchanged cells, for tables from others that are returned to them."""
    stream = io.StringIO()
    csv.writer(stream, delimiter=separator, lineterminator=ending).writerows(rows)
    return stream.getvalue()


def to_safe_cell(value: str) -> str:
    """Return the cell on one line, neutralised as a formula for any cell separator."""
    return _FORMULA.sub(r"\1'", to_one_line(value, 4000))


def _list_results(rows: Sequence[TableRow[View]]) -> list[CriterionResult]:
    return [result for row in rows if row.grade is not None for result in row.grade.grade.criteria]


def _format_submission_row(row: TableRow[View], criteria: Sequence[str], pool_criteria: Sequence[str]) -> list[str]:
    grade = None if row.grade is None else row.grade.grade
    column_count = 3 + len(_ACCURACY_COLUMNS) + len(criteria) + len(pool_criteria) * len(_POOL_COLUMNS) + 3
    grade_cells = [""] * column_count if grade is None else _format_grade_cells(grade, criteria, pool_criteria)
    return [*_format_student_cells(row), *grade_cells, row.source, row.reason]


def _format_grade_cells(grade: Grade, criteria: Sequence[str], pool_criteria: Sequence[str]) -> list[str]:
    results = {result.id: result for result in grade.criteria}
    by_id = {result.id: "" if result.excused else format_decimal(result.marks) for result in grade.criteria}
    accuracy = grade.accuracy
    measured = [f"{accuracy.value:.4f}", f"{accuracy.low:.4f}", f"{accuracy.high:.4f}"] if accuracy else [""] * 3
    return [
        format_decimal(grade.marks),
        format_decimal(grade.max_marks),
        grade.verdict.value,
        *measured,
        str(accuracy.n) if accuracy else "",
        grade.submission,
        grade.assignment_version,
        *(by_id.get(criterion, "") for criterion in criteria),
        *(cell for criterion in pool_criteria for cell in _format_pool_cells(results.get(criterion))),
        "; ".join(f"{result.id}: {result.for_staff}" for result in grade.criteria if result.for_staff),
        "; ".join([*(f"Comment: {comment}" for comment in format_comments(grade)), *grade.notes[:20]]),
        " ".join(format_hints(grade)),
    ]


def _format_pool_cells(result: CriterionResult | None) -> list[str]:
    """Return the cells of ``_POOL_COLUMNS``, which are empty for an excused criterion and for one without a pool."""
    if result is None or result.pool is None or result.excused:
        return [""] * len(_POOL_COLUMNS)
    pool = result.pool
    status = "exact" if pool.is_exact else "provisional"
    return [status, str(pool.drawn), str(pool.size), f"{pool.least:.4f}", f"{pool.most:.4f}"]


def _format_criterion_rows(row: TableRow[View], has_pools: bool) -> Iterator[list[str]]:
    if row.grade is None:
        pool_cells = [""] * len(_POOL_COLUMNS) if has_pools else []
        yield [*_format_student_cells(row), "", "", "", "", *pool_cells, "", "", row.source, row.reason]
        return
    hints = " ".join(format_hints(row.grade.grade))
    for result in row.grade.grade.criteria:
        marks = ["", ""] if result.excused else [format_decimal(result.marks), format_decimal(result.max_marks)]
        yield [
            *_format_student_cells(row),
            result.id,
            result.title,
            *marks,
            *(_format_pool_cells(result) if has_pools else []),
            result.message,
            hints,
            row.source,
            row.reason,
        ]


def _format_student_cells(row: TableRow[View]) -> list[str]:
    return [row.student.id, row.student.name, row.student.email, row.assignment]
