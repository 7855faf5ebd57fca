"""``robomark appeals``: list the appeals of students and answer them."""

from __future__ import annotations

from typing import Annotated

import typer

from service.commands.operating import operating
from service.commands.shown import document, show, table, tell
from service.operations import appeals, courses
from service.operations.courses import DEFAULT_COURSE

Course = Annotated[str, typer.Option(help="The course.")]


def list_appeals(
    course: Course = DEFAULT_COURSE,
    answered: Annotated[bool, typer.Option("--answered", help="Include answered appeals.")] = False,
) -> None:
    """List the open appeals of a course, the longest waiting first."""
    with operating() as (service, actor):
        course_id = courses.find(service, actor, course)
        found = appeals.list_open(service, actor, course_id)
        found += appeals.list_answered(service, actor, course_id) if answered else []
    document(appeals=found)
    if not found:
        tell("no open appeals")
        return
    listed = table("number", "asked", "student", "assignment", "grade", "text", "answer", right=("number",))
    for each in found:
        asked = each.asked_at.astimezone().strftime("%Y-%m-%d %H:%M")
        listed.add_row(str(each.id), asked, each.who, each.assignment, each.job_id, each.text, each.answer or "")
    show(listed)


def answer(
    number: Annotated[int, typer.Argument(help="The number of the appeal, as shown by robomark appeals list.")],
    text: Annotated[str, typer.Argument(help="The text for the student.")],
    course: Course = DEFAULT_COURSE,
) -> None:
    """Answer and close an appeal."""
    with operating() as (service, actor):
        appeals.answer(service, actor, courses.find(service, actor, course), number, text)
    document(appeal=number)
    tell(f"appeal {number} answered")
