"""Who is in a course, for its instructors: students let in, links that sign them in, and what they are allowed beyond.

Instructors are made by whoever runs the installation.
"""

from __future__ import annotations

import shutil
import tempfile
from datetime import timedelta
from pathlib import Path
from typing import Annotated
from urllib.parse import urlencode

from fastapi import APIRouter, File, Form, Query, Request, UploadFile
from fastapi.responses import RedirectResponse, Response

from service.reports.formats.csv_output import csv_text
from service.store import audit
from service.store.courses import open_assignments, policies
from service.store.courses.versions import check_assignment
from service.store.engine import now
from service.store.grades import own_gradings
from service.store.people import lti, people, sign_in_links
from service.store.people.people import Member
from service.store.people.students import Students, course_of
from service.store.purge import has_submitted, remove_student
from service.store.states import Role
from service.web.access import InCourse, Instructing, RowNumber, member_in
from service.web.attachments import attachment
from service.web.context import Context, WebContext
from service.web.kept_uploads import file_name
from service.web.made_links import LinkWord, made_link, new_word, secret_word, sign_in_address
from service.web.moments import written_moment
from service.web.rendering import page
from sim.errors import UsageError
from submissions.people import Student, read_people, students_of
from submissions.raw_files import SentFile

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
    enrolled: Annotated[int, Query(ge=0, le=1_000_000)] = 0,
    removed: Annotated[str, Query(max_length=_LONGEST)] = "",
) -> Response:
    """Everybody in the course, and ways to let more in."""
    return _list(request, here, context, text=q, number=number, enrolled=enrolled, removed=removed)


@router.post("")
def add(
    request: Request,
    here: Instructing,
    context: Context,
    who: Annotated[str, Form(min_length=1, max_length=_LONGEST)],
    name: Annotated[str, Form(max_length=_LONGEST)] = "",
    email: Annotated[str, Form(max_length=_LONGEST)] = "",
) -> Response:
    """Enrol one student; whoever is there stays as they are."""
    with context.store.reading() as session:
        known = people.known(session, here.course_id, Student(who))
    if known is not None:
        return _list(request, here, context, refused=_is_there(known), status_code=422)
    enrolment_id = _enrol(here, context, [Student(who, name, email)])[0]
    return RedirectResponse(f"/courses/{here.course_id}/people/{enrolment_id}", 303)


@router.post("/table")
def add_table(request: Request, here: Instructing, context: Context, file: Annotated[UploadFile, File()]) -> Response:
    """Enrol all students of a table."""
    with tempfile.TemporaryDirectory(prefix="robomark-people-") as folder:
        path = Path(folder) / file_name(SentFile(file.filename or "people.csv", file.file))
        with path.open("xb") as sink:
            shutil.copyfileobj(file.file, sink)
        try:
            listed = students_of(read_people(path))
        except UsageError as error:
            return _list(request, here, context, refused=str(error), status_code=422)
    enrolled = len(set(_enrol(here, context, listed)))
    return RedirectResponse(f"/courses/{here.course_id}/people?enrolled={enrolled}", 303)


@router.get("/table")
def to_list(here: Instructing) -> Response:
    """Nothing but the way back, for whoever comes to the address that takes tables."""
    return RedirectResponse(f"/courses/{here.course_id}/people", 303)


@router.post("/links")
def links(
    request: Request,
    here: Instructing,
    context: Context,
    days: Annotated[int, Form(ge=1, le=sign_in_links.MOST_DAYS)] = sign_in_links.DAYS,
) -> Response:
    """A table with a new link for each student, for whoever sends them on."""
    with context.store.transaction() as session:
        made = sign_in_links.make_links(session, here.course_id, timedelta(days=days), here.actor)
    rows = [["id", "name", "email", "link", "expires", "reason"]]
    for each in made:
        link = sign_in_address(request, context, each.secret) if each.secret else ""
        until = each.expires_at.astimezone().isoformat(timespec="minutes") if each.expires_at else ""
        rows.append([each.student.id, each.student.name, each.student.email, link, until, each.reason])
    return attachment(csv_text(rows).encode("utf-8-sig"), f"links {here.course}.csv", "text/csv; charset=utf-8")


@router.get("/{enrolment_id}")
def show(
    request: Request, here: Instructing, context: Context, enrolment_id: RowNumber, link: LinkWord = ""
) -> Response:
    """One student: what they submitted, what they are allowed, and a link that was made for them."""
    with context.store.reading() as session:
        row = member_in(session, here.course_id, enrolment_id, Role.STUDENT)
        made = made_link(session, request, context, here.reader, link)
        member = people.member_of(session, row)
        prepared = open_assignments.of_course(session, here.course_id)
        hidden = open_assignments.with_names_hidden(session, here.course_id)
        submitted = own_gradings.newest(session, enrolment_id)
        allowed = [each for each in policies.extensions(session, here.course_id) if each.enrolment_id == row.id]
        has_any = has_submitted(session, row.id)
    return page(
        request,
        here.reader,
        "person.html",
        here=here,
        member=member,
        prepared=prepared,
        titles={each.assignment: each.title for each in prepared},
        submitted=[each for each in submitted if each.assignment not in hidden],
        some_hidden=bool(hidden),
        extensions=allowed,
        made=made if made and made.person_id == row.person_id else None,
        gone=bool(link),
        has_submitted=has_any,
    )


@router.get("/{enrolment_id}/link")
def to_student(here: Instructing, context: Context, enrolment_id: RowNumber) -> Response:
    """Nothing but the way back, for whoever comes to the address that makes links."""
    with context.store.reading() as session:
        member_in(session, here.course_id, enrolment_id, Role.STUDENT)
    return RedirectResponse(f"/courses/{here.course_id}/people/{enrolment_id}", 303)


@router.post("/{enrolment_id}/link")
def link(here: Instructing, context: Context, enrolment_id: RowNumber) -> Response:
    """A new link that signs the student in once, which the student's page shows to whoever made it."""
    word = new_word()
    with context.store.transaction() as session:
        row = member_in(session, here.course_id, enrolment_id, Role.STUDENT)
        sign_in_links.make_students_link(session, row, here.actor, word=secret_word(here.reader, word))
    return RedirectResponse(f"/courses/{here.course_id}/people/{enrolment_id}?link={word}", 303)


@router.post("/{enrolment_id}/remove")
def remove(here: Instructing, context: Context, enrolment_id: RowNumber) -> Response:
    """Take a student out of the course who has submitted nothing."""
    with context.store.reading() as session:
        row = member_in(session, here.course_id, enrolment_id, Role.STUDENT)
        who = row.student
    remove_student(context.store, enrolment_id, here.actor)
    return RedirectResponse(f"/courses/{here.course_id}/people?{urlencode({'removed': who[:_LONGEST]})}", 303)


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
    if due_at is None and not more_attempts:
        raise UsageError("say what to allow: a later date, more attempts, or both")
    with context.store.transaction() as session:
        row = member_in(session, here.course_id, enrolment_id, Role.STUDENT)
        check_assignment(session, assignment)
        policies.extend(session, enrolment_id, assignment, due_at, more_attempts)
        told = {"student": row.student, "assignment": assignment, "due": due or None, "more_attempts": more_attempts}
        audit.note(session, here.actor, "extend", "course", str(here.course_id), **told)
    return RedirectResponse(f"/courses/{here.course_id}/people/{enrolment_id}", 303)


def _is_there(known: Member) -> str:
    called = f", as {known.name}" if known.name and known.name != known.id else ""
    if known.role is Role.INSTRUCTOR:
        return f"{known.id} is an instructor of this course{called}; expected the id of a student."
    return f"{known.id} is in this course already{called}; a table gives other names and addresses."


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
    enrolled: int = 0,
    removed: str = "",
    refused: str = "",
    status_code: int = 200,
) -> Response:
    with context.store.reading() as session:
        members = people.members(session, here.course_id)
        allowed = policies.extensions(session, here.course_id)
        platform = lti.course_link(session, here.course_id)
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
        enrolled=enrolled,
        removed=removed,
        students=sum(each.role is Role.STUDENT for each in members),
        platform=platform,
        days=sign_in_links.DAYS,
        most_days=sign_in_links.MOST_DAYS,
    )
