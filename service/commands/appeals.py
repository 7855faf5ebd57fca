"""``robomark appeals``: what students ask again, and the answers.

What it does stands in ``store/appeals.py``.
"""

from __future__ import annotations

from typing import Annotated

import typer

from service.commands.shown import document, show, table, tell
from service.settings import load_settings
from service.store import audit
from service.store.courses.hidden_names import hidden_names
from service.store.engine import open_store
from service.store.grades import appeals
from service.store.installation import secret_of
from service.store.people import people
from service.store.people.students import DEFAULT_COURSE

Course = Annotated[str, typer.Option(help="The course.")]


def list_appeals(
    course: Course = DEFAULT_COURSE,
    answered: Annotated[bool, typer.Option("--answered", help="Those that are answered, too.")] = False,
) -> None:
    """List the open appeals of a course, the longest waiting first."""
    with open_store(load_settings()) as store:
        secret = secret_of(store)
        with store.reading() as session:
            course_id = people.find_course(session, course)
            hidden = hidden_names(session, course_id, secret)
            found = appeals.in_course(session, course_id, hidden, answered=False)
            found += appeals.in_course(session, course_id, hidden, answered=True) if answered else []
    document(appeals=found)
    if not found:
        tell("no appeal is open")
        return
    listed = table("number", "asked", "student", "assignment", "grade", "text", "answer", right=("number",))
    for each in found:
        asked = each.asked_at.astimezone().strftime("%Y-%m-%d %H:%M")
        listed.add_row(str(each.id), asked, each.who, each.assignment, each.job_id, each.text, each.answer or "")
    show(listed)


def answer(
    number: Annotated[int, typer.Argument(help="The appeal's, as robomark appeals list says.")],
    text: Annotated[str, typer.Argument(help="What the student reads.")],
    course: Course = DEFAULT_COURSE,
) -> None:
    """Answer an appeal, which closes it."""
    with open_store(load_settings()) as store, store.transaction() as session:
        appeals.answer(session, people.find_course(session, course), number, text, audit.this_user())
    document(appeal=number)
    tell(f"appeal {number} is answered")
