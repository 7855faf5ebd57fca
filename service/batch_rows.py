"""Rows of a batch for tables: the grade of each submission, or the reason why it has none.

``service.reports`` renders the rows; the database is only read.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from service.grading.grade import Grade
from service.reports.rows import TableRow, describe_missing_part
from service.store.batches.job_lines import JobLine
from service.store.engine import Store
from service.store.grades import results
from service.store.states import JobState
from submissions.student_identity import RejectedSubmission, Student


def build_rows(
    store: Store, lines: Sequence[JobLine], refusals: Sequence[RejectedSubmission] = (), *, published: bool = False
) -> list[TableRow[Grade]]:
    """Return a row for each submission and rejection; ``published`` hides unpublished grades."""
    reasons = {line.id: describe_missing_grade(line, published=published) for line in lines}
    with store.reading() as session:
        grades = dict(results.load_each_grade(session, [line.id for line in lines if not reasons[line.id]]))
    rows = [build_rejected_row(refusal) for refusal in refusals]
    for line in lines:
        grade = grades.get(line.id)
        line_grade = None if grade is None else replace(grade, student=line.student)
        rows.append(build_row(line, line_grade, reasons[line.id]))
    return sorted(rows, key=lambda row: (row.who, row.assignment))


def build_row(line: JobLine, grade: Grade | None, reason: str = "") -> TableRow[Grade]:
    """Return the row of one job."""
    student = Student(line.student, line.name, line.email)
    reason = reason or describe_missing_part(line.missing)
    student_reason, for_staff = _describe_for_students(line), line.staff_only is not None
    return TableRow(
        student, line.source, line.assignment, grade, reason, student_reason=student_reason, for_staff=for_staff
    )


def build_rejected_row(refusal: RejectedSubmission) -> TableRow[Grade]:
    """Return the row of a rejected file."""
    return TableRow(refusal.student, refusal.source, refusal.assignment, reason=refusal.reason, refused=True)


def describe_missing_grade(line: JobLine, *, published: bool = False) -> str:
    """Return the reason why a job has no visible grade; empty if it has one."""
    match line.state:
        case JobState.QUEUED:
            return "queued"
        case JobState.RUNNING:
            return "running"
        case JobState.DEAD | JobState.CANCELLED:
            return f"{line.state.value}: {line.error}" if line.error else line.state.value
    if line.suspect is not None:
        return "is graded again, because the machine that graded it gave wrong grades"
    if line.staff_only is not None:
        return f"for staff only: {line.staff_only}"
    return "not published" if published and line.published_at is None else ""


def _describe_for_students(line: JobLine) -> str:
    """Return the reason for students if it differs from the one for staff, who also see host faults."""
    match line.state:
        case JobState.DEAD:
            return "could not be graded yet; your instructors can see the reason"
        case JobState.CANCELLED:
            return "was cancelled"
    return "is graded again" if line.suspect is not None else ""
