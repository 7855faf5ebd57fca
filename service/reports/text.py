"""A grade as plain text, for a terminal, a log or an e-mail: marks, verdict, messages.

It shows all of the grade it is given; pass it a student's view where a student reads it.
"""

from __future__ import annotations

import textwrap

from service.grading.grade import Grade
from service.reports.faults import FaultGroup, fault_groups
from service.reports.readable import number, one_line, readable
from service.reports.verdict_words import grade_words

_WIDTH = 96
_MEGABYTE = 1 << 20


def plain_text(grade: Grade) -> str:
    """``grade`` in lines of at most 96 characters, without colour or control codes."""
    title = f"{one_line(grade.assignment_title)}: {one_line(grade.student, 60)}"
    words = grade_words(grade)
    lines = [title, "=" * min(len(title), _WIDTH), ""]
    lines += [f"{number(grade.marks)} of {number(grade.max_marks)} marks; {words.short}", ""]
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
    for note in grade.notes[:20]:
        lines += _wrapped(f"Note: {readable(note, 300)}", indent=6)
    lines += ["", *_wrapped(cost_words(grade))] if grade.cost else []
    lines += ["", f"sandbox: {one_line(grade.sandbox)}", ""]
    return "\n".join(line.rstrip() for line in lines)


def accuracy_words(grade: Grade) -> str:
    """One sentence with value, interval and n; empty without a classification."""
    accuracy = grade.accuracy
    if accuracy is None:
        return ""
    return (
        f"Accuracy {accuracy.value:.3f} (95 % interval {accuracy.low:.3f} to {accuracy.high:.3f}, "
        f"{accuracy.n} {accuracy.counts.of if accuracy.counts else 'images'})."
    )


def cost_words(grade: Grade) -> str:
    """One sentence with what all trials cost together, or may cost where that is not told; empty if nobody knows."""
    if grade.cost is None:
        return ""
    limits, spent = grade.cost.limits, grade.cost.spent
    if spent is None:
        return (
            f"All trials together may use {limits.cpu_seconds:g} s of CPU, {limits.sleep_seconds:g} s of sleep and "
            f"{limits.kept_bytes >> 20} MB of output."
        )
    return (
        f"Used {round(spent.cpu_seconds, 1):g} of {limits.cpu_seconds:g} s of CPU, "
        f"{round(spent.sleep_seconds, 1):g} of {limits.sleep_seconds:g} s of sleep, "
        f"{round(spent.kept_bytes / _MEGABYTE, 1):g} of {limits.kept_bytes >> 20} MB of output."
    )


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
