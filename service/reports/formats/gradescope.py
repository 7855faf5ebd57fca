"""A grade as Gradescope's ``results.json``: one test per criterion, with its own visibility.

Gradescope itself hides tests that are not ``visible``, so all criteria are included. The top-level text, which every
student reads, has nothing about hidden parts. A test's text has nothing about trials that stay hidden longer.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from decimal import Decimal
from typing import Any

from service.grading.grade import CriterionResult, Grade
from service.reports.cause import diagnose, ended, excerpt_lines
from service.reports.faults import faults_beside
from service.reports.formats.registry import document, refusal, table
from service.reports.readable import json_number, readable
from service.reports.rows import TableRow, rows_for_students
from service.reports.verdict_sentences import comments_of
from service.reports.view import GradebookView, gradebook_view
from submissions.submission import Submission


def gradescope_document(view: GradebookView, submission: Submission | None = None) -> dict[str, Any]:
    """Return the grade in the schema of gradescope-autograders.readthedocs.io (specifications, output format)."""
    grade = view.entry
    return {
        "score": json_number(view.marks or Decimal(0)),
        "output": _output(view, submission),
        "output_format": "text",
        "test_output_format": "text",
        "test_name_format": "text",
        "visibility": "visible",
        "stdout_visibility": "hidden",
        "tests": [_test(number, result) for number, result in enumerate(grade.criteria, start=1)],
        "extra_data": {
            "assignment": grade.assignment,
            "assignment_version": grade.assignment_version,
            "submission": grade.submission,
            "grader_version": grade.grader_version,
            "sandbox": grade.sandbox,
        },
    }


@document("gradescope", ".json", gradebook_view)
def gradescope_text(view: GradebookView, submission: Submission | None = None) -> str:
    """Return the document as indented ASCII JSON."""
    return _text(gradescope_document(view, submission))


@refusal("gradescope")
def gradescope_refusal(row: TableRow[Grade]) -> str:
    """Return a document with 0 marks and the reason."""
    return _text({"score": 0, **_told(row.reason)})


@table("gradescope", ".json", gradebook_view)
def gradescope_list(rows: Sequence[TableRow[GradebookView]]) -> str:
    """Return the documents of several rows, each with its student and file, without a score if there is no grade."""
    return _text([_of_several(row) for row in rows_for_students(rows)])


def _of_several(row: TableRow[GradebookView]) -> dict[str, Any]:
    document = gradescope_document(row.grade) if row.grade is not None else _told(row.reason)
    who = {"student": row.student.id, "name": row.student.name, "email": row.student.email, "file": row.source}
    return {**document, "extra_data": {**who, **document.get("extra_data", {"assignment": row.assignment})}}


def _told(reason: str) -> dict[str, Any]:
    output = f"This submission was not graded: {readable(reason)}"
    return {"output": output, "output_format": "text", "visibility": "visible", "stdout_visibility": "hidden"}


def _text(value: object) -> str:
    return json.dumps(value, indent=2, allow_nan=False) + "\n"


def _test(number: int, result: CriterionResult) -> dict[str, Any]:
    return {
        "number": str(number),
        "name": readable(result.title, 200),
        "score": json_number(result.marks),
        "max_score": json_number(result.max_marks),
        **({} if result.excused else {"status": "passed" if result.marks >= result.max_marks else "failed"}),
        "output": readable(result.message),
        "visibility": result.visibility,
    }


def _output(view: GradebookView, submission: Submission | None) -> str:
    shown = view.shown
    diagnosis = diagnose(shown, submission)
    lines = [f"Comment: {comment}" for comment in comments_of(shown)]
    lines += [diagnosis.cause, *excerpt_lines(diagnosis), f"Next: {diagnosis.next_step}"]
    lines += [*diagnosis.further, ended(shown, diagnosis)]
    for told, group in faults_beside(diagnosis.cause, shown):
        lines += [told, *([group.hint] if group.hint and told != group.where else []), f"({group.how_often})"]
    lines += [f"Note: {readable(note, 300)}" for note in shown.notes[:20]]
    return "\n".join([*lines, f"sandbox: {shown.sandbox}"])
