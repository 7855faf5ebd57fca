"""A course's people for its instructors: enrolling students, sign-in links and extensions.

Operators add instructors.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import Annotated
from urllib.parse import urlencode

from fastapi import APIRouter, File, Form, Query, Request, UploadFile
from fastapi.responses import RedirectResponse, Response

from service.operations import people, people_views, policies, sign_in_links
from service.operations.errors import Conflict
from service.operations.policies import ExtensionRequest
from service.operations.types import Role
from service.pending_uploads import clean_file_name
from service.reports.formats.csv_output import render_safe_csv
from service.web.access import CourseInstructor, ReaderInCourse, RowNumber
from service.web.api_uploads import MAX_TABLE_BYTES
from service.web.attachments import respond_with_attachment
from service.web.context import Context, WebContext
from service.web.created_links import LinkWord, build_sign_in_url, derive_secret, find_created_link, generate_word
from service.web.date_times import parse_date_time
from service.web.language import detect_language
from service.web.rendering import render_page
from service.web.request_bodies import takes_upload
from sim.errors import UsageError
from submissions.raw_files import UploadedFile
from submissions.student_identity import Student, list_known_students, read_people

router = APIRouter(prefix="/courses/{course_id}/people")
_MAX_TEXT_LENGTH = 200


@router.get("")
def list_people(
    request: Request,
    access: CourseInstructor,
    context: Context,
    q: Annotated[str, Query(max_length=100)] = "",
    number: Annotated[int, Query(alias="page", ge=1, le=10_000)] = 1,
    enrolled: Annotated[int, Query(ge=0, le=1_000_000)] = 0,
    removed: Annotated[str, Query(max_length=_MAX_TEXT_LENGTH)] = "",
) -> Response:
    """Show everybody in the course, and forms to enrol students."""
    return _render_list(request, access, context, text=q, number=number, enrolled=enrolled, removed=removed)


@router.post("")
def enrol_student(
    request: Request,
    access: CourseInstructor,
    context: Context,
    who: Annotated[str, Form(min_length=1, max_length=_MAX_TEXT_LENGTH)],
    name: Annotated[str, Form(max_length=_MAX_TEXT_LENGTH)] = "",
    email: Annotated[str, Form(max_length=_MAX_TEXT_LENGTH)] = "",
) -> Response:
    """Enrol one student. An existing student stays unchanged."""
    try:
        enrolment_id = people.enrol_new(context.service, access.actor, access.course_id, Student(who, name, email))
    except Conflict as error:
        return _render_list(request, access, context, rejection=error, status_code=422)
    return RedirectResponse(f"/courses/{access.course_id}/people/{enrolment_id}", 303)


@router.post("/table")
@takes_upload(MAX_TABLE_BYTES, Role.INSTRUCTOR)
def enrol_table(
    request: Request, access: CourseInstructor, context: Context, file: Annotated[UploadFile, File()]
) -> Response:
    """Enrol all students of an uploaded table."""
    with tempfile.TemporaryDirectory(prefix="robomark-people-") as folder:
        path = Path(folder) / clean_file_name(UploadedFile(file.filename or "people.csv", file.file))
        with path.open("xb") as sink:
            shutil.copyfileobj(file.file, sink)
        try:
            students = list_known_students(read_people(path))
        except UsageError as error:
            return _render_list(request, access, context, rejection=error, status_code=422)
    enrolment_ids = people.enrol(context.service, access.actor, access.course_id, students)
    return RedirectResponse(f"/courses/{access.course_id}/people?enrolled={len(set(enrolment_ids))}", 303)


@router.get("/table")
def redirect_to_list(access: CourseInstructor) -> Response:
    """Redirect to the list, for readers who open the upload address in the browser."""
    return RedirectResponse(f"/courses/{access.course_id}/people", 303)


@router.post("/links")
def create_links(
    request: Request,
    access: CourseInstructor,
    context: Context,
    days: Annotated[int, Form(ge=1, le=sign_in_links.MAX_DAYS)] = sign_in_links.DAYS,
) -> Response:
    """Return a table with a new sign-in link for each student, to be sent to them."""
    student_links = sign_in_links.make_links(context.service, access.actor, access.course_id, days)
    rows = [["id", "name", "email", "link", "expires", "reason"]]
    for student_link in student_links:
        link = build_sign_in_url(request, context, student_link.secret) if student_link.secret else ""
        expiry = student_link.expires_at.astimezone().isoformat(timespec="minutes") if student_link.expires_at else ""
        rows.append(
            [
                student_link.student.id,
                student_link.student.name,
                student_link.student.email,
                link,
                expiry,
                student_link.reason,
            ]
        )
    return respond_with_attachment(
        render_safe_csv(rows).encode("utf-8-sig"), f"links {access.course}.csv", "text/csv; charset=utf-8"
    )


@router.get("/{enrolment_id}")
def show_student(
    request: Request, access: CourseInstructor, context: Context, enrolment_id: RowNumber, link: LinkWord = ""
) -> Response:
    """Show a student's submissions and extensions, and a newly created sign-in link."""
    view = people_views.show_student(context.service, access.actor, access.course_id, enrolment_id)
    created_link = find_created_link(request, context, access.reader, link)
    return render_page(
        request,
        access.reader,
        "person.html",
        access=access,
        member=view.member,
        prepared=view.assignments,
        titles={each.assignment: each.title for each in view.assignments},
        submitted=view.gradings,
        some_hidden=view.some_hidden,
        extensions=view.extensions,
        created_link=created_link if created_link and created_link.person_id == view.member.person_id else None,
        is_link_used=bool(link),
        has_submitted=view.has_submitted,
    )


@router.get("/{enrolment_id}/link")
def redirect_to_student(access: CourseInstructor, enrolment_id: RowNumber) -> Response:
    """Redirect to the student's page, for readers who open the address that creates links."""
    return RedirectResponse(f"/courses/{access.course_id}/people/{enrolment_id}", 303)


@router.post("/{enrolment_id}/link")
def create_link(access: CourseInstructor, context: Context, enrolment_id: RowNumber) -> Response:
    """Create a sign-in link for a student. The student's page shows it to its creator."""
    word, actor = generate_word(), access.actor
    link_seed = derive_secret(access.reader, word)
    sign_in_links.make_students_link(context.service, actor, access.course_id, enrolment_id, word=link_seed)
    return RedirectResponse(f"/courses/{access.course_id}/people/{enrolment_id}?link={word}", 303)


@router.post("/{enrolment_id}/remove")
def remove(access: CourseInstructor, context: Context, enrolment_id: RowNumber) -> Response:
    """Remove a student who has submitted nothing from the course."""
    student_id = people.remove(context.service, access.actor, access.course_id, enrolment_id)
    return RedirectResponse(
        f"/courses/{access.course_id}/people?{urlencode({'removed': student_id[:_MAX_TEXT_LENGTH]})}", 303
    )


@router.post("/{enrolment_id}/extensions")
def extend(
    access: CourseInstructor,
    context: Context,
    enrolment_id: RowNumber,
    assignment: Annotated[str, Form(max_length=100)] = "",
    due: Annotated[str, Form(max_length=40)] = "",
    more_attempts: Annotated[int, Form(ge=0, le=1000)] = 0,
) -> Response:
    """Give a student more time or attempts. This replaces an earlier extension for the same assignment."""
    extension_request = ExtensionRequest(assignment, parse_date_time(due), more_attempts)
    policies.extend(context.service, access.actor, access.course_id, enrolment_id, extension_request)
    return RedirectResponse(f"/courses/{access.course_id}/people/{enrolment_id}", 303)


def _render_list(
    request: Request,
    access: ReaderInCourse,
    context: WebContext,
    *,
    text: str = "",
    number: int = 1,
    enrolled: int = 0,
    removed: str = "",
    rejection: UsageError | None = None,
    status_code: int = 200,
) -> Response:
    view = people_views.search_members(context.service, access.actor, access.course_id, text, number)
    return render_page(
        request,
        access.reader,
        "people.html",
        status_code=status_code,
        access=access,
        view=view,
        text=text,
        rejection="" if rejection is None else detect_language(request).translate_sentence(rejection.message),
        enrolled=enrolled,
        removed=removed,
        days=sign_in_links.DAYS,
        most_days=sign_in_links.MAX_DAYS,
    )
