"""``robomark course gradebook``: the students of a course by its assignments, with the grades that count."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Annotated

import typer

from service.commands.course import CourseOption
from service.commands.installation import open_installation
from service.commands.output import create_table, print_json, print_line, print_renderables
from service.operations import courses
from service.operations import gradebook as operations
from service.operations.courses import DEFAULT_COURSE
from service.operations.gradebook import Gradebook, GradebookColumn, GradebookLine
from service.reports.display_text import format_decimal


def gradebook(
    course: CourseOption = DEFAULT_COURSE,
    csv: Annotated[bool, typer.Option("--csv", help="Print a table for spreadsheets (CSV).")] = False,
) -> None:
    """Show the students of a course by its assignments, with the grades that count."""
    with open_installation() as (service, actor):
        view = operations.show_whole(service, actor, courses.find(service, actor, course))
    print_json(
        assignments=[asdict(each) for each in view.columns], students=[_build_entry(each) for each in view.lines]
    )
    if csv:
        print_line(operations.render_table(view).rstrip())
    elif not view.lines:
        print_line("no students yet")
    else:
        _print_table(view)


def _build_entry(line: GradebookLine) -> dict[str, object]:
    student = line.student
    grades = [asdict(line.cells[name]) for name in sorted(line.cells)]
    return {"id": student.id, "name": student.name, "email": student.email, "grades": grades}


def _print_table(view: Gradebook) -> None:
    names = [column.assignment for column in view.columns]
    table = create_table("student", *names, right=tuple(names))
    for line in view.lines:
        table.add_row(line.student.id, *_format_cells(line, view.columns))
    print_renderables(table)


def _format_cells(line: GradebookLine, columns: Sequence[GradebookColumn]) -> list[str]:
    texts = []
    for column in columns:
        cell = line.cells.get(column.assignment)
        if cell is None:
            texts.append("")
        elif cell.marks is None:
            texts.append("does not count" if cell.state == "done" else cell.state.value)
        else:
            texts.append(f"{format_decimal(cell.marks)} / {format_decimal(cell.max_marks)}")
    return texts
