"""A grade as plain text, for a terminal, a log or an e-mail: marks, verdict, messages.

Whoever reads it, it shows all of the view it is given.
"""

from __future__ import annotations

import textwrap

from service.reports.faults import FaultGroup, fault_groups
from service.reports.formats.registry import document
from service.reports.readable import number, one_line, readable
from service.reports.view import View, staff_view
from service.reports.words import accuracy_words, channel_words, comments_of, cost_words, grade_words, hints_of

_WIDTH = 96


@document("text", ".txt", staff_view)
def plain_text(view: View) -> str:
    """The grade in lines of at most 96 characters, without colour or control codes."""
    grade = view.grade
    title = f"{one_line(grade.assignment_title)}: {one_line(grade.student, 60)}"
    words = grade_words(grade)
    lines = [title, "=" * min(len(title), _WIDTH), ""]
    lines += [f"{number(grade.marks)} of {number(grade.max_marks)} marks; {words.short}", ""]
    for hint in hints_of(grade):
        lines += [*_wrapped(f"→ {hint}", indent=2), ""]
    for comment in comments_of(grade):
        lines += [*_wrapped(f"Comment: {comment}", indent=2), ""]
    for result in grade.criteria:
        marks = f"{number(result.marks)}/{number(result.max_marks)}"
        lines += _wrapped(f"{marks:>9}  {one_line(result.title)}", indent=11)
        lines += _wrapped(" " * 11 + readable(result.message, 600, lines=6), indent=11)
        if result.for_staff:
            lines += _wrapped(" " * 11 + f"For staff: {readable(result.for_staff, 600)}", indent=11)
    lines += ["", *_wrapped(f"{words.happened} {words.whose} {words.next_step}")]
    for group in fault_groups(grade):
        lines += ["", *_fault_lines(group)]
    if grade.accuracy is not None:
        lines += ["", accuracy_words(grade)]
    channel = channel_words(grade)
    lines += ["", *_wrapped(channel)] if channel else []
    for note in grade.notes[:20]:
        lines += _wrapped(f"Note: {readable(note, 300)}", indent=6)
    lines += ["", *_wrapped(cost_words(grade))] if grade.cost else []
    lines += ["", f"sandbox: {one_line(grade.sandbox)}", ""]
    return "\n".join(line.rstrip() for line in lines)


def _fault_lines(group: FaultGroup) -> list[str]:
    lines = _wrapped(f"{group.where}: {group.message}", indent=4)
    if group.hint:
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
