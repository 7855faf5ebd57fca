"""A grade in a terminal with Rich: marks table, verdict, faults.

Student text is passed as ``rich.text.Text``, so square brackets in it are never markup.
"""

from __future__ import annotations

from rich import box
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from service.grading.grade import Grade
from service.reports.cause import diagnose, ended, excerpt_lines
from service.reports.faults import FaultGroup, faults_beside
from service.reports.formats.registry import on_terminal
from service.reports.readable import number, one_line, readable
from service.reports.verdict_sentences import accuracy_words, channel_words, comments_of, cost_words, grade_words
from service.reports.view import View, staff_view
from submissions.submission import Submission

_STYLES = {"good": "green", "notice": "yellow", "bad": "red"}


@on_terminal("text", staff_view)
def rich_report(view: View, submission: Submission | None = None) -> RenderableType:
    """Return the grade as one renderable. Print it with ``rich.console.Console().print``."""
    grade = view.grade
    words = grade_words(grade)
    heading = Text.assemble((one_line(grade.assignment_title), "bold"), "  ", (one_line(grade.student, 60), "dim"))
    diagnosis = diagnose(grade, submission)
    verdict = Text.assemble((words.short, _STYLES[words.tone]), ". ", ended(grade, diagnosis))
    cause = Group(
        Text(diagnosis.cause, style="bold"), *map(Text, excerpt_lines(diagnosis)), Text(f"Next: {diagnosis.next_step}")
    )
    written = [Padding(Text(f"Comment: {comment}"), (0, 0, 0, 2)) for comment in comments_of(grade)]
    parts: list[RenderableType] = [heading, Padding(cause, (0, 0, 0, 2)), *written]
    parts += [marks_table(grade, diagnosis.lost), verdict]
    parts += [Text(further) for further in diagnosis.further]
    parts += [_fault(told, group) for told, group in faults_beside(diagnosis.cause, grade)]
    if grade.accuracy is not None:
        parts.append(Text(accuracy_words(grade)))
    channel = channel_words(grade)
    parts += [Text(channel)] if channel else []
    parts += [Text(f"Note: {readable(note, 300)}", style="dim") for note in grade.notes[:20]]
    parts += [Text(cost_words(grade), style="dim")] if grade.cost else []
    parts.append(Text(f"sandbox: {one_line(grade.sandbox)}", style="dim"))
    return Group(*parts)


def marks_table(grade: Grade, told: frozenset[int] = frozenset()) -> Table:
    """Return the criteria with marks and messages, and the total as footer. Criteria in ``told`` have no message."""
    table = Table(box=box.SIMPLE_HEAD, show_footer=True, padding=(0, 1), expand=False)
    table.add_column("Marks", justify="right", no_wrap=True, footer=_marks(grade))
    table.add_column("Criterion", footer=Text("Total"))
    for index, result in enumerate(grade.criteria):
        full = result.marks >= result.max_marks
        style = "green" if full else ("red" if result.marks == 0 else "yellow")
        marks = Text(f"{number(result.marks)} / {number(result.max_marks)}", style=style)
        message = Text("" if index in told else readable(result.message, 600, lines=6), style="dim")
        if result.for_staff:
            message.append(f"\nFor staff: {readable(result.for_staff, 600)}")
        table.add_row(marks, Group(Text(one_line(result.title)), *([message] if message else [])))
    return table


def _marks(grade: Grade) -> Text:
    return Text(f"{number(grade.marks)} / {number(grade.max_marks)}", style="bold")


def _fault(told: str, group: FaultGroup) -> RenderableType:
    text = Text(told)
    text.stylize("bold", 0, len(group.where))
    if group.hint and told != group.where:
        text.append(f"\n{group.hint}")
    text.append(f"\n({group.how_often})", style="dim")
    return Padding(text, (0, 0, 0, 2))
