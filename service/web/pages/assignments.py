"""The assignments of a course for its instructors: taken from the catalogue or uploaded, previewed, opened and closed.

How one is taken in is ``web/preparing.py``'s.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, File, Form, Query, Request, UploadFile
from fastapi import Path as InPath
from fastapi.responses import RedirectResponse, Response
from sqlalchemy.orm import Session

from service.store import audit
from service.store.courses import open_assignments, policies
from service.store.courses.open_assignments import CourseAssignment
from service.store.courses.policies import PolicyLimits
from service.store.courses.versions import check_assignment
from service.store.grades import own_gradings
from service.web import preparing
from service.web.access import InCourse, Instructing, enrolment_in
from service.web.attachments import attachment
from service.web.context import Context, WebContext
from service.web.kept_uploads import file_name
from service.web.moments import written_moment
from service.web.preparing import StudentsKnowAnother
from service.web.rendering import page
from sim.errors import UsageError
from submissions.assignment.export import write_new
from submissions.assignment.folder import FILE_NAME, catalogue
from submissions.assignment.reader import find_in_catalogue
from submissions.raw_files import SentFile

router = APIRouter(prefix="/courses/{course_id}")
Done = Annotated[str, Query(max_length=20)]
AssignmentId = Annotated[str, InPath(pattern="^[a-z0-9][a-z0-9_-]*$", max_length=80)]


@router.get("/assignments")
def list_assignments(request: Request, here: Instructing, context: Context, done: Done = "") -> Response:
    """What the course has prepared and opened, and two ways to another."""
    return _list(request, here, context, done=done)


@router.post("/assignments")
def prepare(here: Instructing, context: Context, assignment: Annotated[str, Form(max_length=100)]) -> Response:
    """Take an assignment from the catalogue, as it is now."""
    return _to(here, preparing.prepare(context, here.reader.identity, here.course_id, find_in_catalogue(assignment)))


@router.post("/assignments/uploads")
def upload(
    request: Request,
    here: Instructing,
    context: Context,
    file: Annotated[UploadFile, File()],
    replace: Annotated[bool, Form()] = False,
) -> Response:
    """Take an assignment of one's own from a zip of its folder; its reference solution is graded as a preview."""
    sent = SentFile(file.filename or "", file.file)
    try:
        if not sent.flat_name.lower().endswith(".zip"):
            raise UsageError(f"expected a .zip of an assignment's folder, with its {FILE_NAME}")
        with tempfile.TemporaryDirectory(prefix="robomark-assignment-") as folder:
            path = Path(folder) / file_name(sent)
            with path.open("xb") as sink:
                shutil.copyfileobj(sent.stream, sink)
            made = preparing.prepare_own(context, here.reader.identity, here.course_id, path, replace=replace)
            return _to(here, made)
    except UsageError as error:
        asks = isinstance(error, StudentsKnowAnother)
        return _list(request, here, context, refused=str(error).splitlines(), asks_to_replace=asks, status_code=422)


@router.get("/assignments/uploads")
def to_list(here: Instructing) -> Response:
    """Nothing but the way back, for whoever comes to the address that takes uploads."""
    return RedirectResponse(_path(here, ""), 303)


@router.get("/assignments/uploads/my-assignment.zip")
def commented_example(here: Instructing) -> Response:
    """The folder of an assignment with comments in it, to be changed and uploaded."""
    with tempfile.TemporaryDirectory(prefix="robomark-assignment-") as folder:
        write_new(Path(folder) / "zip" / "my-assignment")
        zipped = shutil.make_archive(f"{folder}/made", "zip", f"{folder}/zip")
        return attachment(Path(zipped).read_bytes(), "my-assignment.zip", "application/zip")


@router.get("/assignments/{assignment}")
def show(request: Request, here: Instructing, context: Context, assignment: AssignmentId, done: Done = "") -> Response:
    """What an assignment asks for, whether it is open, and what holds for it."""
    with context.store.reading() as session:
        line = open_assignments.find(session, here.course_id, assignment)
        found = open_assignments.load(session, here.course_id, assignment)
        allowed = policies.policies(session, here.course_id)
        own = enrolment_in(session, here.reader.identity, here.course_id)
        previews = own_gradings.newest(session, own.id, assignment)
    newest = find_in_catalogue(assignment).version if assignment in catalogue() else line.version
    return page(
        request,
        here.reader,
        "assignment.html",
        here=here,
        line=line,
        found=found,
        own_policy=allowed.get(assignment),
        policy=allowed.get(assignment) or allowed.get("") or PolicyLimits(),
        previews=previews,
        has_reference=preparing.reference_of(found) is not None,
        changed=newest != line.version,
        done=done,
        at=datetime.now(UTC),
    )


@router.post("/assignments/{assignment}/open")
def open_one(here: Instructing, context: Context, assignment: AssignmentId) -> Response:
    """Let students see it and submit to it."""
    return _changed(here, context, assignment, "open", open_assignments.open_for_students)


@router.post("/assignments/{assignment}/close")
def close_one(here: Instructing, context: Context, assignment: AssignmentId) -> Response:
    """Let nobody submit to it any more."""
    return _changed(here, context, assignment, "close", open_assignments.close)


@router.post("/assignments/{assignment}/remove")
def remove(here: Instructing, context: Context, assignment: AssignmentId) -> Response:
    """Let the course have it no more, as long as no student has been shown it."""
    _changed(here, context, assignment, "remove", open_assignments.remove)
    return RedirectResponse(_path(here, ""), 303)


@router.post("/assignments/{assignment}/names")
def hide_names(
    here: Instructing, context: Context, assignment: AssignmentId, hidden: Annotated[bool, Form()] = False
) -> Response:
    """Hide or show whose work it is, for all who instruct the course."""
    with context.store.transaction() as session:
        open_assignments.hide_names(session, here.course_id, assignment, hidden)
        told = {"assignment": assignment, "hidden": hidden}
        audit.note(session, here.actor, "names", "course", str(here.course_id), **told)
    return RedirectResponse(_path(here, assignment), 303)


@router.post("/assignments/{assignment}/preview")
def preview(here: Instructing, context: Context, assignment: AssignmentId) -> Response:
    """Grade the catalogue's reference solution as a submission of one's own."""
    job_id = preparing.preview(context, here.reader.identity, here.course_id, assignment)
    return RedirectResponse(f"/courses/{here.course_id}/grades/{job_id}", 303)


@router.post("/policy")
def set_policy(
    here: Instructing,
    context: Context,
    assignment: Annotated[str, Form(max_length=100)] = "",
    due: Annotated[str, Form(max_length=40)] = "",
    late_days: Annotated[int, Form(ge=0, le=365)] = 0,
    attempts: Annotated[str, Form(pattern="^[0-9]{0,4}$")] = "",
    cool_down: Annotated[float, Form(ge=0, le=10_000)] = 0.0,
) -> Response:
    """Say when and how often students may submit, to one assignment or to all that have no policy of their own."""
    if attempts and not 1 <= int(attempts) <= 1000:
        raise UsageError("attempts have to be from 1 to 1000, or empty for any number")
    allowed = PolicyLimits(written_moment(due), late_days, int(attempts) if attempts else None, cool_down * 60)
    with context.store.transaction() as session:
        check_assignment(session, assignment)
        policies.set_policy(session, here.course_id, assignment, allowed)
        told = {"assignment": assignment, "due": due or None, "late_days": late_days, "attempts": allowed.attempts}
        audit.note(session, here.actor, "policy", "course", str(here.course_id), **told)
    return RedirectResponse(f"{_path(here, assignment)}?done=policy", 303)


@router.post("/assignments/{assignment}/no-policy")
def drop_policy(here: Instructing, context: Context, assignment: AssignmentId) -> Response:
    """Let the assignment have what holds for all, in place of a policy of its own."""
    with context.store.transaction() as session:
        policies.drop_policy(session, here.course_id, assignment)
        audit.note(session, here.actor, "policy", "course", str(here.course_id), assignment=assignment, dropped=True)
    return RedirectResponse(f"{_path(here, assignment)}?done=policy", 303)


def _list(
    request: Request,
    here: InCourse,
    context: WebContext,
    *,
    done: str = "",
    refused: list[str] | None = None,
    asks_to_replace: bool = False,
    status_code: int = 200,
) -> Response:
    with context.store.reading() as session:
        prepared = open_assignments.of_course(session, here.course_id)
        allowed = policies.policies(session, here.course_id)
    return page(
        request,
        here.reader,
        "assignments.html",
        status_code=status_code,
        here=here,
        prepared=prepared,
        catalogue=len(catalogue()),
        policies=allowed,
        policy=allowed.get("") or PolicyLimits(),
        refused=refused or [],
        asks_to_replace=asks_to_replace,
        done=done,
        at=datetime.now(UTC),
    )


def _to(here: InCourse, made: CourseAssignment) -> Response:
    return RedirectResponse(_path(here, made.assignment), 303)


def _path(here: InCourse, assignment: str) -> str:
    return f"/courses/{here.course_id}/assignments{f'/{assignment}' if assignment else ''}"


def _changed(
    here: InCourse, context: WebContext, assignment: str, action: str, change: Callable[[Session, int, str], None]
) -> Response:
    with context.store.transaction() as session:
        change(session, here.course_id, assignment)
        audit.note(session, here.actor, action, "course", str(here.course_id), assignment=assignment)
    return RedirectResponse(_path(here, assignment), 303)
