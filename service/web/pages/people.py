"""Who is in a course, for its instructors: students let in, links that sign them in, and what they are allowed beyond.

Instructors are made by whoever runs the installation.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, File, Form, Query, Request, UploadFile
from fastapi.responses import RedirectResponse, Response

from service.store import audit, credentials, open_assignments, own_gradings, people, policies
from service.store.credentials import LINK_LIFETIME
from service.store.engine import now
from service.store.states import CredentialKind, Role
from service.store.students import Students, course_of
from service.store.versions import check_assignment
from service.web.access import InCourse, Instructing, RowNumber, member_in
from service.web.context import Context, WebContext
from service.web.moments import written_moment
from service.web.rendering import page
from sim.errors import UsageError
from submissions.people import Student, read_people, students_of

router = APIRouter(prefix="/courses/{course_id}/people")
_A_PAGE = 100
_LONGEST = 200


@router.get("")
def list_people(
    request: Request,
    here: Instructing,
    context: Context,
    q: Annotated[str, Query(max_length=100)] = "",
    number: Annotated[int, Query(alias="page", ge=1, le=10_000)] = 1,
) -> Response:
    """Everybody in the course, and ways to let more in."""
    return _list(request, here, context, text=q, number=number)


@router.post("")
def add(
    here: Instructing,
    context: Context,
    who: Annotated[str, Form(min_length=1, max_length=_LONGEST)],
    name: Annotated[str, Form(max_length=_LONGEST)] = "",
    email: Annotated[str, Form(max_length=_LONGEST)] = "",
) -> Response:
    """Enrol one student."""
    enrolment_id = _enrol(here, context, [Student(who, name, email)])[0]
    return RedirectResponse(f"/courses/{here.course_id}/people/{enrolment_id}", 303)


@router.post("/table")
def add_table(request: Request, here: Instructing, context: Context, file: Annotated[UploadFile, File()]) -> Response:
    """Enrol all students of a table."""
    with tempfile.TemporaryDirectory(prefix="robomark-people-") as folder:
        path = Path(folder) / "people.csv"
        with path.open("xb") as sink:
            shutil.copyfileobj(file.file, sink)
        try:
            listed = students_of(read_people(path))
        except UsageError as error:
            return _list(request, here, context, refused=str(error), status_code=422)
    _enrol(here, context, listed)
    return RedirectResponse(f"/courses/{here.course_id}/people", 303)


@router.get("/{enrolment_id}")
def show(request: Request, here: Instructing, context: Context, enrolment_id: RowNumber) -> Response:
    """One student: what they submitted, and what they are allowed."""
    return _one(request, here, context, enrolment_id)


@router.post("/{enrolment_id}/link")
def link(request: Request, here: Instructing, context: Context, enrolment_id: RowNumber) -> Response:
    """A new link that signs the student in once, shown this once."""
    with context.store.transaction() as session:
        row = member_in(session, here.course_id, enrolment_id, Role.STUDENT)
        if people.is_more_than(session, row):
            raise UsageError("this person is in other courses, too, and signs in by whoever runs Robomark")
        secret = credentials.issue(session, row.person_id, CredentialKind.LINK, LINK_LIFETIME)
        audit.note(session, here.actor, "link", "person", str(row.person_id))
    start = context.settings.public_url or str(request.base_url).rstrip("/")
    return _one(request, here, context, enrolment_id, link=f"{start}/sign-in/{secret}")


@router.post("/{enrolment_id}/extensions")
def extend(
    here: Instructing,
    context: Context,
    enrolment_id: RowNumber,
    assignment: Annotated[str, Form(max_length=100)] = "",
    due: Annotated[str, Form(max_length=40)] = "",
    more_attempts: Annotated[int, Form(ge=0, le=1000)] = 0,
) -> Response:
    """Allow one student more time or attempts, in place of what they were allowed before for the same."""
    due_at = written_moment(due)
    with context.store.transaction() as session:
        row = member_in(session, here.course_id, enrolment_id, Role.STUDENT)
        check_assignment(session, assignment)
        policies.extend(session, enrolment_id, assignment, due_at, more_attempts)
        told = {"student": row.student, "assignment": assignment, "due": due or None, "more_attempts": more_attempts}
        audit.note(session, here.actor, "extend", "course", str(here.course_id), **told)
    return RedirectResponse(f"/courses/{here.course_id}/people/{enrolment_id}", 303)


def _enrol(here: InCourse, context: WebContext, listed: list[Student]) -> list[int]:
    """All of them, or none."""
    with context.store.transaction() as session:
        at = now(session)
        students = Students(session, course_of(session, here.course, at))
        enrolled = [students.enrol(student, at) for student in listed]
        audit.note(session, here.actor, "enrol", "course", str(here.course_id), students=len(listed))
    return enrolled


def _list(
    request: Request,
    here: InCourse,
    context: WebContext,
    *,
    text: str = "",
    number: int = 1,
    refused: str = "",
    status_code: int = 200,
) -> Response:
    with context.store.reading() as session:
        members = people.members(session, here.course_id)
        allowed = policies.extensions(session, here.course_id)
    wanted = text.strip().casefold()
    found = [each for each in members if wanted in f"{each.id} {each.name} {each.email}".casefold()]
    pages = max(1, -(-len(found) // _A_PAGE))
    number = min(number, pages)
    return page(
        request,
        here.reader,
        "people.html",
        status_code=status_code,
        here=here,
        members=found[(number - 1) * _A_PAGE : number * _A_PAGE],
        found=len(found),
        number=number,
        pages=pages,
        text=text,
        extended={each.enrolment_id for each in allowed},
        refused=refused,
    )


def _one(request: Request, here: InCourse, context: WebContext, enrolment_id: int, link: str = "") -> Response:
    with context.store.reading() as session:
        row = member_in(session, here.course_id, enrolment_id, Role.STUDENT)
        member = next(each for each in people.members(session, here.course_id) if each.enrolment_id == row.id)
        prepared = open_assignments.of_course(session, here.course_id)
        hidden = open_assignments.with_names_hidden(session, here.course_id)
        submitted = own_gradings.newest(session, enrolment_id)
        allowed = [each for each in policies.extensions(session, here.course_id) if each.enrolment_id == row.id]
    return page(
        request,
        here.reader,
        "person.html",
        here=here,
        member=member,
        prepared=prepared,
        submitted=[each for each in submitted if each.assignment not in hidden],
        some_hidden=bool(hidden),
        extensions=allowed,
        link=link,
    )
