"""The grades of a batch as comma-separated values: one for spreadsheets, one that Moodle imports.

Cells that a spreadsheet would take for a formula are defused; nothing here decides who is in a batch.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence

from service.grading.grade import Grade
from service.reports.formats.registry import table
from service.reports.readable import number, one_line
from service.reports.view import GradebookView, View, gradebook_view, staff_view

_FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")


@table("csv", ".csv", staff_view)
def marks_csv(views: Sequence[View]) -> str:
    """One row a grade: student, assignment, marks, verdict, accuracy, hashes, a column a criterion, words for staff."""
    grades = [view.grade for view in views]
    criteria = list(dict.fromkeys(result.id for grade in grades for result in grade.criteria))
    header = ["student", "assignment", "marks", "max_marks", "verdict"]
    header += ["accuracy", "accuracy_low", "accuracy_high", "accuracy_n", "submission", "assignment_version"]
    header += [*(f"marks: {criterion}" for criterion in criteria), "for_staff"]
    return _table([header, *(_row(grade, criteria) for grade in grades)])


@table("moodle", ".csv", gradebook_view)
def moodle_csv(views: Sequence[GradebookView]) -> str:
    """What Moodle's grade import takes: ID number, grade, and feedback that tells nothing of hidden criteria."""
    rows = [["ID number", "Grade", "Feedback comments"]]
    for view in views:
        feedback = "; ".join(
            f"{result.title}: {number(result.marks)} of {number(result.max_marks)}. {result.message}"
            for result in view.shown.criteria
        )
        rows.append([view.entry.student, number(view.entry.marks), one_line(feedback, 2000)])
    return _table(rows)


def _row(grade: Grade, criteria: Sequence[str]) -> list[str]:
    by_id = {result.id: number(result.marks) for result in grade.criteria}
    accuracy = grade.accuracy
    measured = [f"{accuracy.value:.4f}", f"{accuracy.low:.4f}", f"{accuracy.high:.4f}"] if accuracy else [""] * 3
    return [
        grade.student,
        grade.assignment,
        number(grade.marks),
        number(grade.max_marks),
        grade.verdict.value,
        *measured,
        str(accuracy.n) if accuracy else "",
        grade.submission,
        grade.assignment_version,
        *(by_id.get(criterion, "") for criterion in criteria),
        "; ".join(f"{result.id}: {result.for_staff}" for result in grade.criteria if result.for_staff),
    ]


def _table(rows: Iterable[Sequence[str]]) -> str:
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\r\n")
    writer.writerows([_cell(value) for value in row] for row in rows)
    return stream.getvalue()


def _cell(value: str) -> str:
    text = one_line(value, 4000)
    return f"'{text}" if text.startswith(_FORMULA_STARTS) else text
