"""A grade as JUnit XML: one test case per criterion, for continuous-integration pages.

A criterion passes with full marks. One that could not be marked fairly is an error, not a failure.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree

from service.grading.grade import CriterionResult, Grade
from service.reports.diagnosis import diagnose, format_excerpt
from service.reports.display_text import format_decimal, to_display_text, to_one_line
from service.reports.formats.registry import register_document, register_refusal, register_table
from service.reports.rows import TableRow
from service.reports.verdict_sentences import format_comments, format_hints
from service.reports.view import View, build_staff_view
from sim.recording import Verdict
from submissions.submission import Submission

_NOT_MARKED = frozenset({Verdict.HOST_ERROR, Verdict.ASSIGNMENT_ERROR})


@register_document("junit", ".xml", build_staff_view)
def render_junit(view: View, submission: Submission | None = None) -> str:
    """Return the grade as a ``testsuites`` document with one suite. Times are simulated seconds."""
    return _render_document([_build_grade_suite(view.grade, [("student", view.grade.student)], submission)])


@register_refusal("junit")
def render_junit_refusal(row: TableRow[Grade]) -> str:
    """Return a document with one suite that contains an error."""
    return _render_document([_build_row_suite(row.apply_view(build_staff_view))])


@register_table("junit", ".xml", build_staff_view)
def render_junit_suites(rows: Sequence[TableRow[View]]) -> str:
    """Return one suite per submission. One without a grade has one test case with the reason."""
    return _render_document([_build_row_suite(row) for row in rows])


def _render_document(suites: Sequence[ElementTree.Element]) -> str:
    root = ElementTree.Element("testsuites")
    root.extend(suites)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _build_row_suite(row: TableRow[View]) -> ElementTree.Element:
    student = row.student
    student_properties = [
        ("student", student.id),
        ("name", student.name),
        ("email", student.email),
        ("file", row.source),
    ]
    student_properties += [("reason", row.reason)]
    properties = [(name, value) for name, value in student_properties if value]
    if row.grade is not None:
        return _build_grade_suite(row.grade.grade, properties)
    suite = _create_suite(row.assignment, 1, errors=int(row.refused), skipped=int(not row.refused))
    _add_properties(suite, properties)
    case = ElementTree.SubElement(
        suite,
        "testcase",
        classname=to_one_line(row.assignment),
        name=to_one_line(f"{row.who} is graded", 200),
        time="0",
    )
    kind = "error" if row.refused else "skipped"
    ElementTree.SubElement(case, kind, message=to_display_text(row.reason, 300))
    return suite


def _build_grade_suite(
    grade: Grade, student_properties: Sequence[tuple[str, str]], submission: Submission | None = None
) -> ElementTree.Element:
    is_unmarked = grade.verdict in _NOT_MARKED
    missed_count = sum(result.marks < result.max_marks for result in grade.criteria)
    seconds = sum(trial.recording.end_t for trial in grade.trials)
    failures, errors = (0, missed_count) if is_unmarked else (missed_count, 0)
    skipped = sum(result.excused for result in grade.criteria)
    suite = _create_suite(grade.assignment, len(grade.criteria), failures, errors, skipped, seconds=seconds)
    _add_properties(suite, [*student_properties, *_collect_properties(grade, submission)])
    for result in grade.criteria:
        _add_case(suite, grade, result, "error" if is_unmarked else "failure")
    return suite


def _create_suite(
    name: str, tests: int, failures: int = 0, errors: int = 0, skipped: int = 0, seconds: float = 0
) -> ElementTree.Element:
    counts = {"tests": tests, "failures": failures, "errors": errors, "skipped": skipped}
    attributes = {
        "name": to_one_line(name),
        **{key: str(value) for key, value in counts.items()},
        "time": f"{seconds:.3f}",
    }
    return ElementTree.Element("testsuite", attributes)


def _add_properties(suite: ElementTree.Element, pairs: Sequence[tuple[str, str]]) -> None:
    properties = ElementTree.SubElement(suite, "properties")
    for name, value in pairs:
        ElementTree.SubElement(properties, "property", name=name, value=to_display_text(value, 600))


def _add_case(suite: ElementTree.Element, grade: Grade, result: CriterionResult, outcome: str) -> None:
    case = ElementTree.SubElement(
        suite, "testcase", classname=to_one_line(grade.assignment), name=to_one_line(result.title, 200), time="0"
    )
    if result.excused:
        ElementTree.SubElement(case, "skipped", message="excused")
    elif result.marks < result.max_marks:
        marks = f"{format_decimal(result.marks)} of {format_decimal(result.max_marks)} marks"
        element = ElementTree.SubElement(case, outcome, type=grade.verdict.value, message=marks)
        element.text = to_display_text(result.message)


def _collect_properties(grade: Grade, submission: Submission | None) -> list[tuple[str, str]]:
    diagnosis = diagnose(grade, submission)
    return [
        ("marks", format_decimal(grade.marks)),
        ("max_marks", format_decimal(grade.max_marks)),
        ("verdict", grade.verdict.value),
        ("cause", diagnosis.cause),
        ("next_step", diagnosis.next_step),
        *(("excerpt", line) for line in format_excerpt(diagnosis)),
        *(("comment", comment) for comment in format_comments(grade)),
        *(("hint", hint) for hint in format_hints(grade)),
        ("assignment_version", grade.assignment_version),
        ("submission", grade.submission),
        ("sandbox", grade.sandbox),
        ("grader_version", grade.grader_version),
        *(("note", note) for note in grade.notes[:20]),
    ]
