"""A grade as plain text, for a terminal, a log or an e-mail: marks, verdict, messages.

It contains everything in the view, for every reader.
"""

from __future__ import annotations

import textwrap

from service.grading.grade import CriterionResult
from service.reports.diagnosis import Diagnosis, describe_outcome, diagnose, format_excerpt, list_further_proofs
from service.reports.display_text import format_decimal, to_display_text, to_one_line
from service.reports.faults import FaultGroup, describe_other_faults
from service.reports.formats.registry import register_document
from service.reports.verdict_sentences import (
    describe_accuracy,
    describe_channel_losses,
    describe_cost,
    describe_grade,
    format_comments,
)
from service.reports.view import View, build_staff_view
from submissions.submission import Submission

_WIDTH = 96


@register_document("text", ".txt", build_staff_view)
def render_plain_text(view: View, submission: Submission | None = None) -> str:
    """Return the grade in lines of at most 96 characters, without colour or control codes."""
    grade = view.grade
    title = f"{to_one_line(grade.assignment_title)}: {to_one_line(grade.student, 60)}"
    title += " (provisional marks)" if grade.is_provisional else ""
    verdict_words, diagnosis = describe_grade(grade), diagnose(grade, submission)
    lines = [title, "=" * min(len(title), _WIDTH), ""]
    lines += [f"{format_decimal(grade.marks)} of {format_decimal(grade.max_marks)} marks; {verdict_words.short}", ""]
    lines += [*_wrap_text(f"→ {diagnosis.cause}", indent=2), *_format_excerpt_block(diagnosis)]
    lines += _wrap_text(f"  Shown by running it again: {diagnosis.proof}", indent=2) if diagnosis.proof else []
    lines += [*_wrap_text(f"  Next: {diagnosis.next_step}", indent=2), ""]
    for comment in format_comments(grade):
        lines += [*_wrap_text(f"Comment: {comment}", indent=2), ""]
    proofs = list_further_proofs(grade, diagnosis)
    for index in sorted(diagnosis.lost):
        lines += _format_criterion(grade.criteria[index], "", proofs.get(index, ""))
    other_indices = [index for index in range(len(grade.criteria)) if index not in diagnosis.lost]
    lines += [""] if diagnosis.lost and other_indices else []
    for index in other_indices:
        message = to_display_text(grade.criteria[index].message, 600, lines=6)
        lines += _format_criterion(grade.criteria[index], message, proofs.get(index, ""))
    lines += ["", *_wrap_text(describe_outcome(grade, diagnosis))]
    for cause in diagnosis.further:
        lines += ["", *_wrap_text(cause)]
    for description, group in describe_other_faults(diagnosis.fault, grade):
        lines += ["", *_format_fault(description, group)]
    if grade.accuracy is not None:
        lines += ["", describe_accuracy(grade)]
    channel = describe_channel_losses(grade)
    lines += ["", *_wrap_text(channel)] if channel else []
    for note in grade.notes[:20]:
        lines += _wrap_text(f"Note: {to_display_text(note, 300)}", indent=6)
    lines += ["", *_wrap_text(describe_cost(grade))] if grade.cost else []
    lines += ["", f"sandbox: {to_one_line(grade.sandbox)}", ""]
    return "\n".join(line.rstrip() for line in lines)


def _format_criterion(result: CriterionResult, message: str, proof: str) -> list[str]:
    marks = f"{format_decimal(result.marks)}/{format_decimal(result.max_marks)}"
    lines = _wrap_text(f"{marks:>9}  {to_one_line(result.title)}", indent=11)
    lines += _wrap_text(" " * 11 + message, indent=11) if message else []
    lines += _wrap_text(f"{' ' * 11}Shown by running it again: {proof}", indent=11) if proof else []
    if result.pool is not None and result.pool.note:
        lines += _wrap_text(f"{' ' * 11}{result.pool.note}", indent=11)
    staff = f"For staff: {to_display_text(result.for_staff, 600)}"
    return [*lines, *(_wrap_text(" " * 11 + staff, indent=11) if result.for_staff else [])]


def _format_excerpt_block(diagnosis: Diagnosis) -> list[str]:
    lines = [f"    {line}"[:_WIDTH] for line in format_excerpt(diagnosis)]
    return ["", *lines, ""] if lines else []


def _format_fault(description: str, group: FaultGroup) -> list[str]:
    lines = _wrap_text(description, indent=4)
    if group.hint and description != group.where:
        lines += _wrap_text(f"    {group.hint}", indent=4)
    return [*lines, f"    ({group.how_often})"]


def _wrap_text(text: str, indent: int = 0) -> list[str]:
    lines: list[str] = []
    for piece in text.split("\n"):
        first_indent = "" if not lines else " " * indent
        lines += textwrap.wrap(
            piece, _WIDTH, initial_indent=first_indent, subsequent_indent=" " * indent, break_on_hyphens=False
        ) or [""]
    return lines
