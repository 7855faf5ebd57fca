"""A grade in a terminal with Rich: marks table, verdict, faults.

Student text is passed as ``rich.text.Text``, so square brackets in it are never markup.
"""

from __future__ import annotations

from rich import box
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from service.grading.grade import Grade, PoolValue
from service.grading.pools.pool_sentences import round_outwards
from service.reports.diagnosis import describe_outcome, diagnose, format_excerpt, list_further_proofs
from service.reports.display_text import format_decimal, to_display_text, to_one_line
from service.reports.faults import FaultGroup, describe_other_faults
from service.reports.formats.registry import register_terminal
from service.reports.verdict_sentences import (
    describe_accuracy,
    describe_channel_losses,
    describe_cost,
    describe_grade,
    format_comments,
)
from service.reports.view import View, build_staff_view
from submissions.submission import Submission

_STYLES = {"good": "green", "notice": "yellow", "bad": "red"}


@register_terminal("text", build_staff_view)
def render_rich_report(view: View, submission: Submission | None = None) -> RenderableType:
    """Return the grade as one renderable. Print it with ``rich.console.Console().print``."""
    grade = view.grade
    verdict_words = describe_grade(grade)
    heading = Text.assemble(
        (to_one_line(grade.assignment_title), "bold"), "  ", (to_one_line(grade.student, 60), "dim")
    )
    diagnosis = diagnose(grade, submission)
    verdict = Text.assemble(
        (verdict_words.short, _STYLES[verdict_words.tone]), ". ", describe_outcome(grade, diagnosis)
    )
    cause = Group(
        Text(diagnosis.cause, style="bold"),
        *map(Text, format_excerpt(diagnosis)),
        *([Text(f"Shown by running it again: {diagnosis.proof}")] if diagnosis.proof else []),
        Text(f"Next: {diagnosis.next_step}"),
    )
    comments = [Padding(Text(f"Comment: {comment}"), (0, 0, 0, 2)) for comment in format_comments(grade)]
    parts: list[RenderableType] = [heading, Padding(cause, (0, 0, 0, 2)), *comments]
    parts += [build_marks_table(grade, diagnosis.lost), verdict]
    further_proofs = list_further_proofs(grade, diagnosis)
    parts += [
        Text(f"{to_one_line(grade.criteria[index].title)}: shown by running it again: {proof}")
        for index, proof in further_proofs.items()
    ]
    parts += [Text(further) for further in diagnosis.further]
    parts += [_render_fault(told, group) for told, group in describe_other_faults(diagnosis.fault, grade)]
    if grade.accuracy is not None:
        parts.append(Text(describe_accuracy(grade)))
    channel = describe_channel_losses(grade)
    parts += [Text(channel)] if channel else []
    parts += [Text(f"Note: {to_display_text(note, 300)}", style="dim") for note in grade.notes[:20]]
    parts += [Text(describe_cost(grade), style="dim")] if grade.cost else []
    parts.append(Text(f"sandbox: {to_one_line(grade.sandbox)}", style="dim"))
    return Group(*parts)


def build_marks_table(grade: Grade, explained_criteria: frozenset[int] = frozenset()) -> Table:
    """Return the criteria with marks and messages, and the total as footer.

    Criteria in ``explained_criteria`` have no message. If marks depend on pools of trials, columns show their status.
    """
    table = Table(box=box.SIMPLE_HEAD, show_footer=True, padding=(0, 1), expand=False)
    table.add_column("Marks", justify="right", no_wrap=True, footer=_format_total(grade))
    has_pools = any(result.pool is not None for result in grade.criteria)
    if has_pools:
        table.add_column("Status", footer=Text("provisional" if grade.is_provisional else "exact"))
        table.add_column("Trials", justify="right", no_wrap=True)
        table.add_column("Value", justify="right", no_wrap=True)
    table.add_column("Criterion", footer=Text("Total"))
    for index, result in enumerate(grade.criteria):
        has_full_marks = result.marks >= result.max_marks
        style = "green" if has_full_marks else ("red" if result.marks == 0 else "yellow")
        marks = Text(f"{format_decimal(result.marks)} / {format_decimal(result.max_marks)}", style=style)
        message = Text(
            "" if index in explained_criteria else to_display_text(result.message, 600, lines=6), style="dim"
        )
        if result.for_staff:
            message.append(f"\nFor staff: {to_display_text(result.for_staff, 600)}")
        pool_cells = _format_pool_cells(result.pool) if has_pools else []
        table.add_row(marks, *pool_cells, Group(Text(to_one_line(result.title)), *([message] if message else [])))
    return table


def _format_pool_cells(pool: PoolValue | None) -> list[str]:
    """Return the status of marks, the trials that were run, and the bounds of the value in per cent."""
    if pool is None:
        return ["", "", ""]
    least, most = round_outwards(pool, 1)
    bounds = f"{pool.least:.1%}" if pool.is_exact else f"{least}% to {most}%"
    return ["exact" if pool.is_exact else "provisional", f"{pool.drawn} of {pool.size}", bounds]


def _format_total(grade: Grade) -> Text:
    return Text(f"{format_decimal(grade.marks)} / {format_decimal(grade.max_marks)}", style="bold")


def _render_fault(description: str, group: FaultGroup) -> RenderableType:
    text = Text(description)
    text.stylize("bold", 0, len(group.where))
    if group.hint and description != group.where:
        text.append(f"\n{group.hint}")
    text.append(f"\n({group.how_often})", style="dim")
    return Padding(text, (0, 0, 0, 2))
