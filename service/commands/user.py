"""``robomark user``: who instructs, who runs the installation, and how anybody signs in on the web.

Students come with their submissions or by ``robomark course enrol``.
"""

from __future__ import annotations

from datetime import timedelta
from typing import Annotated

import typer

from service.commands.shown import document, show, table, tell
from service.settings import Settings, load_settings
from service.store import audit
from service.store.engine import now, open_store
from service.store.people import credentials, people, sign_in_links
from service.store.people.students import DEFAULT_COURSE, course_of
from service.store.states import CredentialKind
from sim.errors import UsageError
from submissions.people import Student

Id = Annotated[str, typer.Argument(help="What the course knows them by.")]
Course = Annotated[str, typer.Option(help="The course.")]


def add(
    who: Id,
    name: Annotated[str, typer.Option(help="As it is shown.")] = "",
    email: Annotated[str, typer.Option(help="An address.")] = "",
    course: Course = DEFAULT_COURSE,
    operator: Annotated[bool, typer.Option("--operator", help="Lets them run the installation, too.")] = False,
    student: Annotated[bool, typer.Option("--student", help="Enrols a student and no instructor.")] = False,
) -> None:
    """Add an instructor to a course, or a student, and print a link that signs them in once."""
    if student and operator:
        raise UsageError("a student does not run the installation: say --student or --operator")
    settings = load_settings()
    make = people.make_student if student else people.make_instructor
    with open_store(settings) as store, store.transaction() as session:
        member = make(session, course, Student(who, name, email))
        if operator:
            people.make_operator(session, member.person_id)
        actor, told = audit.this_user(), {"role": member.role.value, "operator": operator}
        audit.note(session, actor, "add", "person", str(member.person_id), **told)
        secret = sign_in_links.make_link(session, member.person_id, actor)
    _tell_link(settings, member.id, secret)


def link(who: Id, course: Course = DEFAULT_COURSE) -> None:
    """Print a new link that signs somebody in once."""
    settings = load_settings()
    with open_store(settings) as store, store.transaction() as session:
        member = people.member(session, course, who)
        secret = sign_in_links.make_link(session, member.person_id, audit.this_user())
    _tell_link(settings, member.id, secret)


def token(
    who: Id,
    scopes: Annotated[list[str], typer.Option("--scope", help="What it may do: read, submit, mark, manage.")],
    name: Annotated[str, typer.Option(help="What it is for.")] = "",
    course: Course = DEFAULT_COURSE,
    days: Annotated[int, typer.Option(min=1, max=366, help="It ends after so many.")] = 90,
) -> None:
    """Print a token for programs that counts in one course."""
    from service.web.api_scopes import SCOPES

    for scope in scopes:
        if scope not in SCOPES:
            raise UsageError(f"--scope is {scope!r}, expected one of {', '.join(SCOPES)}")
    with open_store(load_settings()) as store, store.transaction() as session:
        member = people.member(session, course, who)
        course_id = course_of(session, course, now(session))
        secret = credentials.issue(
            session,
            member.person_id,
            CredentialKind.TOKEN,
            timedelta(days=days),
            name=name or "command line",
            scopes=scopes,
            course_id=course_id,
        )
        audit.note(session, audit.this_user(), "token", "person", str(member.person_id), scopes=sorted(scopes))
    document(id=member.id, token=secret, scopes=sorted(scopes), days=days)
    tell(secret)


def list_people(course: Course = DEFAULT_COURSE) -> None:
    """List who is in a course."""
    with open_store(load_settings()) as store, store.reading() as session:
        found = [line for line in people.courses(session) if line.name == course]
        if not found:
            raise UsageError(f"there is no course {course!r}")
        members = people.members(session, found[0].id)
    document(
        people=[
            {"id": each.id, "name": each.name, "email": each.email, "role": each.role, "operator": each.operator}
            for each in members
        ]
    )
    listed = table("id", "name", "address", "role")
    for each in members:
        listed.add_row(each.id, each.name, each.email, f"{each.role}{', operator' if each.operator else ''}")
    show(listed)


def _tell_link(settings: Settings, who: str, secret: str) -> None:
    path = f"/sign-in/{secret}"
    where = f"{settings.public_url}{path}" if settings.public_url else path
    document(id=who, path=path, url=f"{settings.public_url}{path}" if settings.public_url else None)
    tell(where if settings.public_url else f"{path}   (behind the address that robomark up or serve prints)")
