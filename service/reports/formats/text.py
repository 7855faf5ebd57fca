"""A grade as plain text, for a terminal, a log or an e-mail: marks, verdict, messages.

It contains everything in the view, for every reader.
"""

from __future__ import annotations

import textwrap

from service.grading.grade import CriterionResult
from service.reports.cause import Diagnosis, diagnose, ended, excerpt_lines
from service.reports.faults import FaultGroup, faults_beside
from service.reports.formats.registry import document
from service.reports.readable import number, one_line, readable
from service.reports.verdict_sentences import accuracy_words, channel_words, comments_of, cost_words, grade_words
from service.reports.view import View, staff_view
from submissions.submission import Submission

_WIDTH = 96


@document("text", ".txt", staff_view)
def plain_text(view: View, submission: Submission | None = None) -> str:
    """Return the grade in lines of at most 96 characters, without colour or control codes."""
    grade = view.grade
    title = f"{one_line(grade.assignment_title)}: {one_line(grade.student, 60)}"
    words, diagnosis = grade_words(grade), diagnose(grade, submission)
    lines = [title, "=" * min(len(title), _WIDTH), ""]
    lines += [f"{number(grade.marks)} of {number(grade.max_marks)} marks; {words.short}", ""]
    lines += [*_wrapped(f"→ {diagnosis.cause}", indent=2), *_excerpt(diagnosis)]
    lines += [*_wrapped(f"  Next: {diagnosis.next_step}", indent=2), ""]
    for comment in comments_of(grade):
        lines += [*_wrapped(f"Comment: {comment}", indent=2), ""]
    of_the_cause = [grade.criteria[index] for index in sorted(diagnosis.lost)]
    for result in of_the_cause:
        lines += _criterion_lines(result, "")
    others = [each for index, each in enumerate(grade.criteria) if index not in diagnosis.lost]
    lines += [""] if of_the_cause and others else []
    for result in others:
        lines += _criterion_lines(result, readable(result.message, 600, lines=6))
    lines += ["", *_wrapped(ended(grade, diagnosis))]
    for cause in diagnosis.further:
        lines += ["", *_wrapped(cause)]
    for told, group in faults_beside(diagnosis.cause, grade):
        lines += ["", *_fault_lines(told, group)]
    if grade.accuracy is not None:
        lines += ["", accuracy_words(grade)]
    channel = channel_words(grade)
    lines += ["", *_wrapped(channel)] if channel else []
    for note in grade.notes[:20]:
        lines += _wrapped(f"Note: {readable(note, 300)}", indent=6)
    lines += ["", *_wrapped(cost_words(grade))] if grade.cost else []
    lines += ["", f"sandbox: {one_line(grade.sandbox)}", ""]
    return "\n".join(line.rstrip() for line in lines)


def _criterion_lines(result: CriterionResult, message: str) -> list[str]:
    marks = f"{number(result.marks)}/{number(result.max_marks)}"
    lines = _wrapped(f"{marks:>9}  {one_line(result.title)}", indent=11)
    lines += _wrapped(" " * 11 + message, indent=11) if message else []
    staff = f"For staff: {readable(result.for_staff, 600)}"
    return [*lines, *(_wrapped(" " * 11 + staff, indent=11) if result.for_staff else [])]


def _excerpt(diagnosis: Diagnosis) -> list[str]:
    lines = [f"    {line}"[:_WIDTH] for line in excerpt_lines(diagnosis)]
    return ["", *lines, ""] if lines else []


def _fault_lines(told: str, group: FaultGroup) -> list[str]:
    lines = _wrapped(told, indent=4)
    if group.hint and told != group.where:
        lines += _wrapped(f"    {group.hint}", indent=4)
    return [*lines, f"    ({group.how_often})"]


def _wrapped(text: str, indent: int = 0) -> list[str]:
    lines: list[str] = []
    for piece in text.split("\n"):
        first = "" if not lines else " " * indent
        lines += textwrap.wrap(
            piece, _WIDTH, initial_indent=first, subsequent_indent=" " * indent, break_on_hyphens=False
        ) or [""]
    return lines
