"""A grade as JUnit XML: one test case a criterion, for continuous-integration pages.

A criterion passes with full marks; one that could not be marked fairly is an error, not a failure.
"""

from __future__ import annotations

from xml.etree import ElementTree

from service.grading.grade import CriterionResult, Grade
from service.reports.formats.registry import document
from service.reports.readable import number, one_line, readable
from service.reports.view import View, staff_view
from sim.recording import Verdict

_NOT_MARKED = frozenset({Verdict.HOST_ERROR, Verdict.ASSIGNMENT_ERROR})


@document("junit", ".xml", staff_view)
def junit_text(view: View) -> str:
    """The grade as a ``testsuites`` document with one suite; times are simulated seconds."""
    grade = view.grade
    unmarked = grade.verdict in _NOT_MARKED
    missed = sum(result.marks < result.max_marks for result in grade.criteria)
    root = ElementTree.Element("testsuites")
    suite = ElementTree.SubElement(
        root,
        "testsuite",
        name=one_line(grade.assignment),
        tests=str(len(grade.criteria)),
        failures=str(0 if unmarked else missed),
        errors=str(missed if unmarked else 0),
        skipped="0",
        time=f"{sum(trial.recording.end_t for trial in grade.trials):.3f}",
    )
    properties = ElementTree.SubElement(suite, "properties")
    for name, value in _properties(grade):
        ElementTree.SubElement(properties, "property", name=name, value=readable(value, 300))
    for result in grade.criteria:
        _add_case(suite, grade, result, "error" if unmarked else "failure")
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _add_case(suite: ElementTree.Element, grade: Grade, result: CriterionResult, outcome: str) -> None:
    case = ElementTree.SubElement(
        suite, "testcase", classname=one_line(grade.assignment), name=one_line(result.title, 200), time="0"
    )
    if result.marks < result.max_marks:
        marks = f"{number(result.marks)} of {number(result.max_marks)} marks"
        element = ElementTree.SubElement(case, outcome, type=grade.verdict.value, message=marks)
        element.text = readable(result.message)


def _properties(grade: Grade) -> list[tuple[str, str]]:
    return [
        ("student", grade.student),
        ("marks", number(grade.marks)),
        ("max_marks", number(grade.max_marks)),
        ("verdict", grade.verdict.value),
        ("assignment_version", grade.assignment_version),
        ("submission", grade.submission),
        ("sandbox", grade.sandbox),
        ("grader_version", grade.grader_version),
    ]
