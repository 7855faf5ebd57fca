"""The assignments of a course for its instructors: taken from the catalogue or uploaded, previewed, opened and closed.

What an assignment's folder may hold is ``submissions.assignment``'s to say.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, File, Form, Request, UploadFile
from fastapi import Path as InPath
from fastapi.responses import RedirectResponse, Response
from sqlalchemy.orm import Session

from service.store import audit, intake, open_assignments, own_gradings, policies
from service.store.models import Enrolment
from service.store.policies import PolicyLimits
from service.store.states import Lane
from service.store.versions import check_assignment, freeze
from service.web.access import InCourse, Instructing, enrolment_in
from service.web.context import Context, WebContext
from service.web.moments import written_moment
from service.web.rendering import page
from sim.errors import AssignmentError, UsageError
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import EXAMPLES
from submissions.assignment.folder import FILE_NAME, REFERENCE, assignment_folder, catalogue
from submissions.assignment.overview import overview
from submissions.assignment.reader import find_in_catalogue, read_assignment
from submissions.bundle import read_submission
from submissions.grading_request import GradingRequest
from submissions.people import Student
from submissions.raw_files import SentFile
from submissions.unzipping import unzip

router = APIRouter(prefix="/courses/{course_id}")
AssignmentId = Annotated[str, InPath(pattern="^[a-z0-9][a-z0-9_-]*$", max_length=80)]
_MOST_ENTRIES, _MOST_BYTES = 2000, 200_000_000


@router.get("/assignments")
def list_assignments(request: Request, here: Instructing, context: Context) -> Response:
    """What the course has prepared and opened, and two ways to another."""
    return _list(request, here, context)


@router.post("/assignments")
def prepare(here: Instructing, context: Context, assignment: Annotated[str, Form(max_length=100)]) -> Response:
    """Take an assignment from the catalogue, as it is now."""
    return _prepared(here, context, find_in_catalogue(assignment))


@router.post("/assignments/uploads")
def upload(request: Request, here: Instructing, context: Context, file: Annotated[UploadFile, File()]) -> Response:
    """Take an assignment of one's own from a zip of its folder; its reference solution is graded as a preview."""
    try:
        with tempfile.TemporaryDirectory(prefix="robomark-assignment-") as name:
            folder = _unpacked(SentFile(file.filename or "", file.file), Path(name))
            found = read_assignment(folder)
            reference = folder / EXAMPLES / REFERENCE
            answer = _prepared(here, context, found)
            if reference.is_dir():
                _preview(here, context, found, reference)
    except (UsageError, AssignmentError) as error:
        return _list(request, here, context, refused=str(error).splitlines(), status_code=422)
    return answer


@router.get("/assignments/{assignment}")
def show(request: Request, here: Instructing, context: Context, assignment: AssignmentId) -> Response:
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
        trials={each.id: sum(trial.scenario is each for trial in found.trials()) for each in found.scenarios},
        paragraphs=[part.strip() for part in (found.description or "").split("\n\n") if part.strip()],
        own_policy=allowed.get(assignment),
        policy=allowed.get(assignment) or allowed.get("") or PolicyLimits(),
        previews=previews,
        has_reference=_reference(found) is not None,
        changed=newest != line.version,
    )


@router.post("/assignments/{assignment}/open")
def open_one(here: Instructing, context: Context, assignment: AssignmentId) -> Response:
    """Let students see it and submit to it."""
    return _changed(here, context, assignment, "open", open_assignments.open_for_students)


@router.post("/assignments/{assignment}/close")
def close_one(here: Instructing, context: Context, assignment: AssignmentId) -> Response:
    """Let nobody submit to it any more."""
    return _changed(here, context, assignment, "close", open_assignments.close)


@router.post("/assignments/{assignment}/names")
def hide_names(
    here: Instructing, context: Context, assignment: AssignmentId, hidden: Annotated[bool, Form()] = False
) -> Response:
    """Hide or show whose work it is, for all who instruct the course."""
    with context.store.transaction() as session:
        open_assignments.hide_names(session, here.course_id, assignment, hidden)
        told = {"assignment": assignment, "hidden": hidden}
        audit.note(session, here.actor, "names", "course", str(here.course_id), **told)
    return _to(here, assignment)


@router.post("/assignments/{assignment}/preview")
def preview(here: Instructing, context: Context, assignment: AssignmentId) -> Response:
    """Grade the catalogue's reference solution as a submission of one's own."""
    with context.store.reading() as session:
        found = open_assignments.load(session, here.course_id, assignment)
    reference = _reference(found)
    if reference is None:
        raise UsageError(f"there is no reference solution of this version of {assignment}; upload its folder again")
    return RedirectResponse(f"/courses/{here.course_id}/grades/{_preview(here, context, found, reference)}", 303)


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
    return _to(here, assignment)


def _list(
    request: Request,
    here: InCourse,
    context: WebContext,
    *,
    refused: list[str] | None = None,
    status_code: int = 200,
) -> Response:
    with context.store.reading() as session:
        prepared = open_assignments.of_course(session, here.course_id)
        allowed = policies.policies(session, here.course_id)
    own = {each.assignment for each in prepared}
    return page(
        request,
        here.reader,
        "assignments.html",
        status_code=status_code,
        here=here,
        prepared=prepared,
        catalogue=[overview(assignment_folder(each)) for each in catalogue() if each not in own],
        policies=allowed,
        policy=allowed.get("") or PolicyLimits(),
        refused=refused or [],
    )


def _to(here: InCourse, assignment: str) -> Response:
    path = f"/courses/{here.course_id}/assignments"
    return RedirectResponse(f"{path}/{assignment}" if assignment else path, 303)


def _changed(
    here: InCourse, context: WebContext, assignment: str, action: str, change: Callable[[Session, int, str], None]
) -> Response:
    with context.store.transaction() as session:
        change(session, here.course_id, assignment)
        audit.note(session, here.actor, action, "course", str(here.course_id), assignment=assignment)
    return _to(here, assignment)


def _prepared(here: InCourse, context: WebContext, found: Assignment) -> Response:
    frozen = freeze(found)
    with context.store.transaction() as session:
        open_assignments.prepare(session, here.course_id, frozen)
        told = {"assignment": found.id, "version": found.version}
        audit.note(session, here.actor, "prepare", "course", str(here.course_id), **told)
    return _to(here, found.id)


def _unpacked(sent: SentFile, folder: Path) -> Path:
    """The folder of the assignment in a zip: the zip's own, or the only one in it."""
    if not sent.flat_name.lower().endswith(".zip"):
        raise UsageError(f"expected a .zip of an assignment's folder, with its {FILE_NAME}")
    path = folder / "upload.zip"
    with path.open("xb") as sink:
        shutil.copyfileobj(sent.stream, sink)
    inside = folder / "assignment"
    inside.mkdir()
    unzip(path, inside, _MOST_ENTRIES, _MOST_BYTES)
    found = [path for path in inside.iterdir() if path.name != "__MACOSX"]
    return found[0] if len(found) == 1 and found[0].is_dir() else inside


def _reference(found: Assignment) -> Path | None:
    """The catalogue's reference solution, where the course marks by the catalogue's version."""
    if found.id not in catalogue() or find_in_catalogue(found.id).version != found.version:
        return None
    folder = assignment_folder(found.id) / EXAMPLES / REFERENCE
    return folder if folder.is_dir() else None


def _preview(here: InCourse, context: WebContext, found: Assignment, reference: Path) -> str:
    """Grade a reference solution as the instructor's own; the id of its job."""
    with context.store.reading() as session:
        own: Enrolment = enrolment_in(session, here.reader.identity, here.course_id)
        student = Student(own.written)
    submission = read_submission(reference, student=student.id, asked=found.parts)
    accepted = intake.accept(
        context.store,
        GradingRequest(submission, found, REFERENCE, whose=student),
        course=here.course,
        max_attempts=context.settings.max_attempts,
    )
    if accepted.copied_from is None:
        context.notifier.grade(Lane.INTERACTIVE)
    return accepted.job_id
