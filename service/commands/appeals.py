"""``robomark appeals``: list the appeals of students and answer them."""

from __future__ import annotations

from typing import Annotated

import typer

from service.commands.installation import open_installation
from service.commands.output import create_table, print_json, print_line, print_renderables
from service.operations import appeals, courses
from service.operations.courses import DEFAULT_COURSE

Course = Annotated[str, typer.Option(help="The course.")]


def list_appeals(
    course: Course = DEFAULT_COURSE,
    answered: Annotated[bool, typer.Option("--answered", help="Include answered appeals.")] = False,
) -> None:
    """List the open appeals of a course, the longest waiting first."""
    with open_installation() as (service, actor):
        course_id = courses.find(service, actor, course)
        appeal_list = appeals.list_open(service, actor, course_id)
        appeal_list += appeals.list_answered(service, actor, course_id) if answered else []
    print_json(appeals=appeal_list)
    if not appeal_list:
        print_line("no open appeals")
        return
    table = create_table("number", "asked", "student", "assignment", "grade", "text", "answer", right=("number",))
    for appeal in appeal_list:
        asked_time = appeal.asked_at.astimezone().strftime("%Y-%m-%d %H:%M")
        table.add_row(
            str(appeal.id), asked_time, appeal.who, appeal.assignment, appeal.job_id, appeal.text, appeal.answer or ""
        )
    print_renderables(table)


def answer(
    number: Annotated[int, typer.Argument(help="The number of the appeal, as shown by robomark appeals list.")],
    text: Annotated[str, typer.Argument(help="The text for the student.")],
    course: Course = DEFAULT_COURSE,
) -> None:
    """Answer and close an appeal."""
    with open_installation() as (service, actor):
        appeals.answer(service, actor, courses.find(service, actor, course), number, text)
    print_json(appeal=number)
    print_line(f"appeal {number} answered")
