"""A course's assignments for its instructors: add, upload, preview, open and close them."""

from __future__ import annotations

import shutil
import tempfile
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, File, Form, Query, Request, UploadFile
from fastapi import Path as InPath
from fastapi.responses import RedirectResponse, Response

from service.operations import assignment_uploads, assignment_views, assignments, policies
from service.operations.assignment_uploads import AssignmentAlreadySeen, UploadRequest
from service.operations.assignments import CourseAssignment
from service.operations.policies import PolicyLimits
from service.operations.types import CompletionRule, CountedAttempt, ReleaseRule, Role
from service.pending_uploads import clean_file_name
from service.web.access import CourseInstructor, ReaderInCourse
from service.web.api_uploads import MAX_ASSIGNMENT_BYTES
from service.web.attachments import respond_with_attachment
from service.web.context import Context, WebContext
from service.web.date_times import parse_date_time
from service.web.language import detect_language
from service.web.rendering import render_page
from service.web.request_bodies import takes_upload
from sim.errors import UsageError
from submissions.assignment.export import create_assignment
from submissions.assignment.folder import FILE_NAME, list_catalogue_ids
from submissions.raw_files import UploadedFile

router = APIRouter(prefix="/courses/{course_id}")
DoneAction = Annotated[str, Query(max_length=20)]
AssignmentId = Annotated[str, InPath(pattern="^[a-z0-9][a-z0-9_-]*$", max_length=80)]


@router.get("/assignments")
def list_assignments(request: Request, access: CourseInstructor, context: Context, done: DoneAction = "") -> Response:
    """Show the assignments of the course and the ways to add one."""
    return _render_list(request, access, context, done=done)


@router.post("/assignments")
def prepare(access: CourseInstructor, context: Context, assignment: Annotated[str, Form(max_length=100)]) -> Response:
    """Add an assignment from the catalogue in its current version."""
    return _redirect_to_assignment(
        access, assignment_uploads.prepare_from_catalogue(context.service, access.actor, access.course_id, assignment)
    )


@router.post("/assignments/uploads")
@takes_upload(MAX_ASSIGNMENT_BYTES, Role.INSTRUCTOR)
def upload(
    request: Request,
    access: CourseInstructor,
    context: Context,
    file: Annotated[UploadFile, File()],
    replace: Annotated[bool, Form()] = False,
) -> Response:
    """Add an assignment from an uploaded zip of its folder, and grade its reference solution as a preview."""
    uploaded_file = UploadedFile(file.filename or "", file.file)
    try:
        if not uploaded_file.flat_name.lower().endswith(".zip"):
            raise UsageError(f"expected a .zip of an assignment's folder, with its {FILE_NAME}")
        with tempfile.TemporaryDirectory(prefix="robomark-assignment-") as folder:
            path = Path(folder) / clean_file_name(uploaded_file)
            with path.open("xb") as sink:
                shutil.copyfileobj(uploaded_file.stream, sink)
            upload_request = UploadRequest(path, replace)
            return _redirect_to_assignment(
                access, assignment_uploads.upload(context.service, access.actor, access.course_id, upload_request)
            )
    except UsageError as error:
        asks_to_replace, messages = (
            isinstance(error, AssignmentAlreadySeen),
            detect_language(request).translate_sentence(error.message).splitlines(),
        )
        return _render_list(
            request, access, context, rejection=messages, asks_to_replace=asks_to_replace, status_code=422
        )


@router.get("/assignments/uploads")
def redirect_to_list(access: CourseInstructor) -> Response:
    """Redirect to the list, for readers who open the upload address in the browser."""
    return RedirectResponse(_build_path(access, ""), 303)


@router.get("/assignments/uploads/my-assignment.zip")
def download_example(access: CourseInstructor) -> Response:
    """Return the folder of a commented example assignment as a zip."""
    with tempfile.TemporaryDirectory(prefix="robomark-assignment-") as folder:
        create_assignment(Path(folder) / "zip" / "my-assignment")
        archive_path = shutil.make_archive(f"{folder}/made", "zip", f"{folder}/zip")
        return respond_with_attachment(Path(archive_path).read_bytes(), "my-assignment.zip", "application/zip")


@router.get("/assignments/{assignment}")
def show_assignment(
    request: Request, access: CourseInstructor, context: Context, assignment: AssignmentId, done: DoneAction = ""
) -> Response:
    """Show an assignment with its task, its state and its policy."""
    view = assignment_views.show(context.service, access.actor, access.course_id, assignment)
    return render_page(
        request,
        access.reader,
        "assignment.html",
        access=access,
        line=view.line,
        assignment=view.assignment,
        own_policy=view.own_policy,
        policy=view.policy,
        previews=view.previews,
        has_reference=view.has_reference,
        changed=view.changed,
        done=done,
        at=datetime.now(UTC),
    )


@router.post("/assignments/{assignment}/open")
def open_assignment(access: CourseInstructor, context: Context, assignment: AssignmentId) -> Response:
    """Open an assignment: students see it and can submit to it."""
    return _redirect_to_assignment(
        access, assignments.open_for_students(context.service, access.actor, access.course_id, assignment)
    )


@router.post("/assignments/{assignment}/close")
def close_assignment(access: CourseInstructor, context: Context, assignment: AssignmentId) -> Response:
    """Close an assignment: students can no longer submit to it."""
    return _redirect_to_assignment(
        access, assignments.close(context.service, access.actor, access.course_id, assignment)
    )


@router.post("/assignments/{assignment}/remove")
def remove(access: CourseInstructor, context: Context, assignment: AssignmentId) -> Response:
    """Remove an assignment that no student has seen from the course."""
    assignments.remove(context.service, access.actor, access.course_id, assignment)
    return RedirectResponse(_build_path(access, ""), 303)


@router.post("/assignments/{assignment}/names")
def hide_names(
    access: CourseInstructor, context: Context, assignment: AssignmentId, hidden: Annotated[bool, Form()] = False
) -> Response:
    """Hide or show the students' names for all instructors of the course."""
    return _redirect_to_assignment(
        access, assignments.hide_names(context.service, access.actor, access.course_id, assignment, names_hidden=hidden)
    )


@router.post("/assignments/{assignment}/preview")
def preview(access: CourseInstructor, context: Context, assignment: AssignmentId) -> Response:
    """Grade the catalogue's reference solution as the instructor's own submission."""
    job_id = assignment_uploads.preview(context.service, access.actor, access.course_id, assignment)
    return RedirectResponse(f"/courses/{access.course_id}/grades/{job_id}", 303)


@router.post("/policy")
def set_policy(
    access: CourseInstructor,
    context: Context,
    assignment: Annotated[str, Form(max_length=100)] = "",
    due: Annotated[str, Form(max_length=40)] = "",
    late_days: Annotated[int, Form(ge=0, le=365)] = 0,
    attempts: Annotated[str, Form(pattern="^[0-9]{0,4}$")] = "",
    cool_down: Annotated[float, Form(ge=0, le=10_000)] = 0.0,
    release: Annotated[ReleaseRule, Form()] = ReleaseRule.OWN_AT_ONCE,
    released: Annotated[str, Form(max_length=40)] = "",
) -> Response:
    """Set deadline, attempts and release of grades of one assignment, or the default for those without a policy."""
    policy_limits = PolicyLimits(
        parse_date_time(due),
        late_days,
        int(attempts) if attempts else None,
        cool_down * 60,
        release=release,
        released_at=parse_date_time(released),
    )
    policies.set_policy(context.service, access.actor, access.course_id, assignment, policy_limits)
    return RedirectResponse(f"{_build_path(access, assignment)}?done=policy", 303)


@router.post("/policy/counted-attempt")
def set_counted_attempt(
    access: CourseInstructor, context: Context, counted_attempt: Annotated[CountedAttempt, Form()]
) -> Response:
    """Set which attempt of each student counts, in the whole course."""
    policies.set_counted_attempt(context.service, access.actor, access.course_id, counted_attempt)
    return RedirectResponse(f"{_build_path(access, '')}?done=counted-attempt", 303)


@router.post("/policy/completion-rule")
def set_completion_rule(
    access: CourseInstructor, context: Context, completion_rule: Annotated[CompletionRule, Form()]
) -> Response:
    """Set whether exact marks replace published provisional ones that are higher, in the whole course."""
    policies.set_completion_rule(context.service, access.actor, access.course_id, completion_rule)
    return RedirectResponse(f"{_build_path(access, '')}?done=completion-rule", 303)


@router.post("/assignments/{assignment}/no-policy")
def drop_policy(access: CourseInstructor, context: Context, assignment: AssignmentId) -> Response:
    """Delete an assignment's own policy, so that the course's default applies."""
    policies.drop_policy(context.service, access.actor, access.course_id, assignment)
    return RedirectResponse(f"{_build_path(access, assignment)}?done=policy", 303)


def _render_list(
    request: Request,
    access: ReaderInCourse,
    context: WebContext,
    *,
    done: str = "",
    rejection: list[str] | None = None,
    asks_to_replace: bool = False,
    status_code: int = 200,
) -> Response:
    view = assignment_views.show_all(context.service, access.actor, access.course_id)
    return render_page(
        request,
        access.reader,
        "assignments.html",
        status_code=status_code,
        access=access,
        prepared=view.prepared,
        catalogue=len(list_catalogue_ids()),
        policies=view.policies,
        policy=view.policy,
        counted_attempt=view.counted_attempt,
        completion_rule=view.completion_rule,
        rejection=rejection or [],
        asks_to_replace=asks_to_replace,
        done=done,
        at=datetime.now(UTC),
    )


def _redirect_to_assignment(access: ReaderInCourse, course_assignment: CourseAssignment) -> Response:
    return RedirectResponse(_build_path(access, course_assignment.assignment), 303)


def _build_path(access: ReaderInCourse, assignment: str) -> str:
    return f"/courses/{access.course_id}/assignments{f'/{assignment}' if assignment else ''}"
