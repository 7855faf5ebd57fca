"""A grade as Gradescope's ``results.json``: one test a criterion, with its own visibility.

Gradescope hides what is not ``visible`` by itself, so all criteria go in; the top-level text, which every student
reads, tells nothing of hidden parts, and a test's text nothing of trials that are hidden for longer than the test.
"""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

from service.grading.grade import CriterionResult, Grade
from service.reports.audience import BEFORE_PUBLICATION, student_view
from service.reports.faults import fault_groups
from service.reports.json_output import json_number
from service.reports.readable import readable
from service.reports.verdict_words import verdict_words


def gradescope_document(grade: Grade) -> dict[str, Any]:
    """``grade`` in the schema of gradescope-autograders.readthedocs.io (specifications, output format)."""
    return {
        "score": json_number(grade.marks),
        "output": _output(grade),
        "output_format": "text",
        "test_output_format": "text",
        "test_name_format": "text",
        "visibility": "visible",
        "stdout_visibility": "hidden",
        "tests": [_test(number, result, _told(grade, result)) for number, result in enumerate(grade.criteria, start=1)],
        "extra_data": {
            "assignment": grade.assignment,
            "assignment_version": grade.assignment_version,
            "submission": grade.submission,
            "grader_version": grade.grader_version,
            "sandbox": grade.sandbox,
        },
    }


def gradescope_text(grade: Grade) -> str:
    """The document as indented ASCII JSON."""
    return json.dumps(gradescope_document(grade), indent=2, allow_nan=False)


def _told(grade: Grade, result: CriterionResult) -> str:
    """What is told to whoever sees this criterion."""
    view = student_view(replace(grade, criteria=(result,)), BEFORE_PUBLICATION | {result.visibility})
    return view.criteria[0].message


def _test(number: int, result: CriterionResult, told: str) -> dict[str, Any]:
    return {
        "number": str(number),
        "name": readable(result.title, 200),
        "score": json_number(result.marks),
        "max_score": json_number(result.max_marks),
        "status": "passed" if result.marks >= result.max_marks else "failed",
        "output": readable(told),
        "visibility": result.visibility,
    }


def _output(grade: Grade) -> str:
    shown = student_view(grade)
    words = verdict_words(shown.verdict)
    lines = [words.happened, words.whose, words.next_step]
    for group in fault_groups(shown, limit=10):
        lines += [f"{group.where}: {group.message}", *([group.hint] if group.hint else []), f"({group.how_often})"]
    return "\n".join([*lines, f"sandbox: {grade.sandbox}"])
