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
from service.reports.diagnosis import describe_outcome, diagnose, format_excerpt
from service.reports.display_text import to_display_text, to_json_number
from service.reports.faults import describe_other_faults
from service.reports.formats.registry import register_document, register_refusal, register_table
from service.reports.rows import TableRow, select_student_rows
from service.reports.verdict_sentences import format_comments
from service.reports.view import GradebookView, build_gradebook_view
from submissions.submission import Submission


def build_gradescope_document(view: GradebookView, submission: Submission | None = None) -> dict[str, Any]:
    """Return the grade in the schema of gradescope-autograders.readthedocs.io (specifications, output format)."""
    grade = view.entry
    return {
        "score": to_json_number(view.marks or Decimal(0)),
        "output": _format_output(view, submission),
        "output_format": "text",
        "test_output_format": "text",
        "test_name_format": "text",
        "visibility": "visible",
        "stdout_visibility": "hidden",
        "tests": [_criterion_to_json(number, result) for number, result in enumerate(grade.criteria, start=1)],
        "extra_data": {
            "assignment": grade.assignment,
            "assignment_version": grade.assignment_version,
            "submission": grade.submission,
            "grader_version": grade.grader_version,
            "sandbox": grade.sandbox,
        },
    }


@register_document("gradescope", ".json", build_gradebook_view)
def render_gradescope(view: GradebookView, submission: Submission | None = None) -> str:
    """Return the document as indented ASCII JSON."""
    return _dump_json(build_gradescope_document(view, submission))


@register_refusal("gradescope")
def render_gradescope_refusal(row: TableRow[Grade]) -> str:
    """Return a document with 0 marks and the reason."""
    return _dump_json({"score": 0, **_ungraded_to_json(row.reason)})


@register_table("gradescope", ".json", build_gradebook_view)
def render_gradescope_list(rows: Sequence[TableRow[GradebookView]]) -> str:
    """Return the documents of several rows, each with its student and file, without a score if there is no grade."""
    return _dump_json([_row_to_json(row) for row in select_student_rows(rows)])


def _row_to_json(row: TableRow[GradebookView]) -> dict[str, Any]:
    document = build_gradescope_document(row.grade) if row.grade is not None else _ungraded_to_json(row.reason)
    student_fields = {
        "student": row.student.id,
        "name": row.student.name,
        "email": row.student.email,
        "file": row.source,
    }
    return {**document, "extra_data": {**student_fields, **document.get("extra_data", {"assignment": row.assignment})}}


def _ungraded_to_json(reason: str) -> dict[str, Any]:
    output = f"This submission was not graded: {to_display_text(reason)}"
    return {"output": output, "output_format": "text", "visibility": "visible", "stdout_visibility": "hidden"}


def _dump_json(value: object) -> str:
    return json.dumps(value, indent=2, allow_nan=False) + "\n"


def _criterion_to_json(number: int, result: CriterionResult) -> dict[str, Any]:
    return {
        "number": str(number),
        "name": to_display_text(result.title, 200),
        "score": to_json_number(result.marks),
        "max_score": to_json_number(result.max_marks),
        **({} if result.excused else {"status": "passed" if result.marks >= result.max_marks else "failed"}),
        "output": to_display_text(result.message),
        "visibility": result.visibility,
    }


def _format_output(view: GradebookView, submission: Submission | None) -> str:
    grade = view.shown
    diagnosis = diagnose(grade, submission)
    lines = [f"Comment: {comment}" for comment in format_comments(grade)]
    lines += [diagnosis.cause, *format_excerpt(diagnosis), f"Next: {diagnosis.next_step}"]
    lines += [*diagnosis.further, describe_outcome(grade, diagnosis)]
    for description, group in describe_other_faults(diagnosis.fault, grade):
        lines += [
            description,
            *([group.hint] if group.hint and description != group.where else []),
            f"({group.how_often})",
        ]
    lines += [f"Note: {to_display_text(note, 300)}" for note in grade.notes[:20]]
    return "\n".join([*lines, f"sandbox: {grade.sandbox}"])
