"""A grade as plain text, for a terminal, a log or an e-mail: marks, verdict, messages. On a terminal it has colours.

It contains everything in the view, for every reader.
"""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from service.grading.grade import CriterionResult
from service.reports.diagnosis import (
    Diagnosis,
    describe_outcome,
    describe_withheld_marks,
    diagnose,
    format_excerpt,
    list_further_proofs,
)
from service.reports.display_text import format_decimal, to_display_text, to_one_line
from service.reports.faults import FaultGroup, describe_other_faults
from service.reports.formats.registry import register_document, register_terminal
from service.reports.verdict_sentences import (
    describe_accuracy,
    describe_channel_losses,
    describe_cost,
    describe_grade,
    format_comments,
)
from service.reports.view import View, build_staff_view
from submissions.submission import Submission

if TYPE_CHECKING:
    from rich.text import Text

_WIDTH = 96
_TONES = {"good": "green", "notice": "yellow", "bad": "red"}


@dataclass(frozen=True, slots=True)
class _Block:
    """A paragraph, whose further lines are indented. ``style`` is that of Rich."""

    text: str
    indent: int = 0
    style: str = ""

    def wrap(self, width: int) -> list[str]:
        lines: list[str] = []
        for piece in self.text.split("\n"):
            first_indent = "" if not lines else " " * self.indent
            lines += textwrap.wrap(
                piece,
                width,
                initial_indent=first_indent,
                subsequent_indent=" " * self.indent,
                break_on_hyphens=False,
            ) or [""]
        return [line.rstrip() for line in lines]


class _Line(_Block):
    """A line that is not wrapped."""

    def wrap(self, width: int) -> list[str]:
        return [self.text.rstrip()]


_BLANK = _Line("")


@register_document("text", ".txt", build_staff_view)
def render_plain_text(view: View, submission: Submission | None = None) -> str:
    """Return the grade in lines of at most 96 characters, without colour or control codes."""
    return "\n".join(line for block in _build_blocks(view, submission) for line in block.wrap(_WIDTH))


@register_terminal("text", build_staff_view)
def render_coloured_text(view: View, submission: Submission | None = None) -> Text:
    """Return the same text with colours, in lines that fit the terminal. Text of students is never markup."""
    from rich.text import Text

    width = min(_WIDTH, shutil.get_terminal_size().columns)
    blocks = _build_blocks(view, submission)
    return Text("\n").join(Text("\n".join(block.wrap(width)), style=block.style) for block in blocks)


def _build_blocks(view: View, submission: Submission | None) -> Iterator[_Block]:
    grade = view.grade
    title = f"{to_one_line(grade.assignment_title)}: {to_one_line(grade.student, 60)}"
    title += " (provisional marks)" if grade.is_provisional else ""
    verdict_words, diagnosis = describe_grade(grade), diagnose(grade, submission)
    yield from (_Line(title, style="bold"), _Line("=" * min(len(title), _WIDTH)), _BLANK)
    total = f"{format_decimal(grade.marks)} of {format_decimal(grade.max_marks)} marks; {verdict_words.short}"
    yield from (_Line(total, style=_TONES[verdict_words.tone]), _BLANK)
    yield _Block(f"→ {diagnosis.cause}", 2, "bold")
    yield from _build_excerpt(diagnosis)
    if diagnosis.proof:
        yield _Block(f"  Shown by running it again: {diagnosis.proof}", 2)
    yield from (_Block(f"  Next: {diagnosis.next_step}", 2), _BLANK)
    for comment in format_comments(grade):
        yield from (_Block(f"Comment: {comment}", 2), _BLANK)
    proofs = list_further_proofs(grade, diagnosis)
    if diagnosis.lost:
        yield _Line("Affected criteria:")
    for index in sorted(diagnosis.lost):
        result = grade.criteria[index]
        yield from _build_criterion(result, describe_withheld_marks(result), proofs.get(index, ""))
    other_indices = [index for index in range(len(grade.criteria)) if index not in diagnosis.lost]
    if diagnosis.lost and other_indices:
        yield _BLANK
    for index in other_indices:
        message = to_display_text(grade.criteria[index].message, 600, lines=6)
        yield from _build_criterion(grade.criteria[index], message, proofs.get(index, ""))
    yield from (_BLANK, _Block(describe_outcome(grade, diagnosis)))
    for cause in diagnosis.further:
        yield from (_BLANK, _Block(cause))
    for description, group in describe_other_faults(diagnosis.fault, grade):
        yield _BLANK
        yield from _build_fault(description, group)
    if grade.accuracy is not None:
        yield from (_BLANK, _Line(describe_accuracy(grade)))
    channel = describe_channel_losses(grade)
    if channel:
        yield from (_BLANK, _Block(channel))
    for note in grade.notes[:20]:
        yield _Block(f"Note: {to_display_text(note, 300)}", 6, "dim")
    if grade.cost:
        yield from (_BLANK, _Block(describe_cost(grade), style="dim"))
    yield from (_BLANK, _Line(f"sandbox: {to_one_line(grade.sandbox)}", style="dim"), _BLANK)


def _build_criterion(result: CriterionResult, message: str, proof: str) -> Iterator[_Block]:
    marks = f"{format_decimal(result.marks)}/{format_decimal(result.max_marks)}"
    style = "green" if result.marks >= result.max_marks else "yellow" if result.marks else "red"
    yield _Block(f"{marks:>9}  {to_one_line(result.title)}", 11, style)
    details = (
        message,
        f"Shown by running it again: {proof}" if proof else "",
        result.pool.note if result.pool is not None else "",
        f"For staff: {to_display_text(result.for_staff, 600)}" if result.for_staff else "",
    )
    yield from (_Block(" " * 11 + detail, 11) for detail in details if detail)


def _build_excerpt(diagnosis: Diagnosis) -> Iterator[_Block]:
    lines = [_Line(f"    {line}"[:_WIDTH]) for line in format_excerpt(diagnosis)]
    yield from (_BLANK, *lines, _BLANK) if lines else ()


def _build_fault(description: str, group: FaultGroup) -> Iterator[_Block]:
    yield _Block(description, 4)
    if group.hint and description != group.where:
        yield _Block(f"    {group.hint}", 4)
    yield _Line(f"    ({group.how_often})")
