"""A course's batches for its instructors, and submitting a new one: upload, check and confirm.

``batch.py`` contains the pages of one batch. ``submissions.batch_folder`` defines the allowed uploads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, File, Form, Request, UploadFile
from fastapi.responses import RedirectResponse, Response
from starlette.exceptions import HTTPException

from service.language import translatable
from service.operations import batch_views as views
from service.operations import batches as operations
from service.operations.batches import SubmissionPreview, SubmitRequest
from service.operations.types import Role
from service.pending_uploads import ExpectedSubmission, PendingUpload, PendingUploads
from service.web.access import CourseInstructor, ReaderInCourse, RowName, RowNameAfter
from service.web.api_uploads import LARGEST_BATCH
from service.web.batch_uploads import read_upload
from service.web.context import Context, WebContext
from service.web.rendering import render_page
from service.web.request_bodies import takes_upload
from sim.errors import UsageError
from submissions.assignment.folder import list_catalogue_ids
from submissions.batch_folder import BatchContents
from submissions.bundle import find_empty_parts, find_missing_part
from submissions.raw_files import UploadedFile, sanitise_name
from submissions.student_identity import read_people
from submissions.submission import PART_FILES

router = APIRouter(prefix="/courses/{course_id}/batches")
_ARCHIVE_SUFFIXES = (".zip",)
#: Suffixes of one student's submission in an upload of single files. The contents are checked later.
_SUBMISSION_SUFFIXES = (".zip", ".py", ".ipynb")


@router.get("")
def list_batches(request: Request, here: CourseInstructor, context: Context, after: RowNameAfter = "") -> Response:
    """Show the batches of the course, newest first, and a form for a new one."""
    return _render_list(request, here, context, after=after)


@router.post("/uploads")
@takes_upload(LARGEST_BATCH, Role.INSTRUCTOR)
def upload(
    request: Request,
    here: CourseInstructor,
    context: Context,
    files: Annotated[list[UploadFile], File()],
    people: Annotated[UploadFile | None, File()] = None,
    assignment: Annotated[str, Form(max_length=100)] = "",
) -> Response:
    """Save the uploaded files and determine which submissions would be accepted."""
    kept_uploads = PendingUploads(context.settings.home)
    begun = kept_uploads.begin(here.reader.identity.person_id, here.course_id, assignment)
    try:
        laid = _store_files(
            kept_uploads, begun, _list_sent_files(files), _list_sent_files([people] if people is not None else [])
        )
        checked = _read_contents(context, here, laid)
        expected = _build_expected_submissions(
            operations.preview_submissions(context.service, here.actor, here.course_id, checked)
        )
        kept_uploads.write(replace(laid, expected=expected, refusals=checked.refusals))
    except UsageError as error:
        kept_uploads.remove(begun)
        return _render_list(request, here, context, refused=str(error), status_code=422)
    return RedirectResponse(f"/courses/{here.course_id}/batches/uploads/{laid.id}", 303)


@router.get("/uploads/{upload_id}")
def show_upload(request: Request, here: CourseInstructor, context: Context, upload_id: RowName) -> Response:
    """Show the accepted and rejected submissions of an upload, before it is confirmed."""
    found = _require_upload(context, here, upload_id)
    missing: dict[str, list[str]] = {}
    for each in found.expected:
        if each.missing:
            missing.setdefault(each.missing, []).append(each.student)
    return render_page(
        request,
        here.reader,
        "upload.html",
        here=here,
        upload=found,
        known=None,
        missing=missing,
        strangers=[each.student for each in found.expected if not each.enrolled],
        known_before=sum(each.known for each in found.expected),
        copied=sum(each.copied for each in found.expected),
    )


@router.post("/uploads/{upload_id}/confirm")
def confirm(
    request: Request,
    here: CourseInstructor,
    context: Context,
    upload_id: RowName,
    again: Annotated[bool, Form()] = False,
) -> Response:
    """Create a batch from an upload."""
    found = _require_upload(context, here, upload_id)
    asked = SubmitRequest(found.name, _read_contents(context, here, found), again)
    done = operations.submit(context.service, here.actor, here.course_id, asked)
    PendingUploads(context.settings.home).remove(found)
    if done.batch is None:
        known = sorted((each.student, each.job_id) for each in done.known)
        return render_page(request, here.reader, "upload.html", here=here, upload=found, known=known)
    return RedirectResponse(f"/courses/{here.course_id}/batches/{done.batch.id}?done=submit", 303)


@router.post("/uploads/{upload_id}/discard")
def discard(here: CourseInstructor, context: Context, upload_id: RowName) -> Response:
    """Discard an upload."""
    PendingUploads(context.settings.home).remove(_require_upload(context, here, upload_id))
    return RedirectResponse(f"/courses/{here.course_id}/batches", 303)


def _render_list(
    request: Request,
    here: ReaderInCourse,
    context: WebContext,
    *,
    after: str = "",
    refused: str = "",
    status_code: int = 200,
) -> Response:
    shown = views.list_batches_page(context.service, here.actor, here.course_id, after)
    own = {each.assignment for each in shown.prepared}
    return render_page(
        request,
        here.reader,
        "batches.html",
        status_code=status_code,
        here=here,
        batches=shown.batches,
        older=shown.older,
        unfinished=any(line.unfinished for line in shown.batches),
        prepared=shown.prepared,
        catalogue=[each for each in list_catalogue_ids() if each not in own],
        refused=refused,
        waiting=PendingUploads(context.settings.home).list_waiting(here.reader.identity.person_id, here.course_id),
    )


def _build_expected_submissions(foreseen: Sequence[SubmissionPreview]) -> tuple[ExpectedSubmission, ...]:
    found = []
    for each in foreseen:
        asked, ahead = each.request, each.intake_preview
        part = find_missing_part(asked.submission, asked.assignment.parts)
        found.append(
            ExpectedSubmission(
                asked.submission.student,
                each.name,
                asked.assignment.title,
                asked.source,
                PART_FILES[part] if part is not None else "",
                ahead.enrolled,
                ahead.known,
                ahead.copied,
                next(iter(find_empty_parts(asked.submission)), ""),
            )
        )
    return tuple(found)


def _list_sent_files(files: list[UploadFile]) -> list[UploadedFile]:
    """Return the files of a form field. Browsers send an empty field as a file without a name, which is skipped."""
    return [UploadedFile(file.filename, file.file) for file in files if file.filename]


def _store_files(
    kept_uploads: PendingUploads, begun: PendingUpload, files: list[UploadedFile], people: list[UploadedFile]
) -> PendingUpload:
    """Store the files in the upload and return it with their names. Raises UsageError for unsuitable files."""
    if not files:
        raise UsageError("no files were uploaded, expected a .zip, or a file for each student")
    suffixes = {Path(file.flat_name).suffix.lower() for file in files}
    if not suffixes <= set(_SUBMISSION_SUFFIXES):
        wrong = next(
            file.flat_name for file in files if Path(file.flat_name).suffix.lower() not in _SUBMISSION_SUFFIXES
        )
        raise UsageError(
            f"{sanitise_name(wrong)} was uploaded, expected a .zip, or a .py, .ipynb or .zip for each student"
        )
    names = kept_uploads.store_files(begun, files, "batch")
    one_archive = len(names) == 1 and names[0].lower().endswith(_ARCHIVE_SUFFIXES)
    table = kept_uploads.store_files(begun, people, "people") if people else [""]
    if one_archive:
        called = Path(names[0]).stem
    else:
        called = names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"
    return replace(begun, name=sanitise_name(called), file=names[0] if one_archive else "", people=table[0])


def _read_contents(context: WebContext, here: ReaderInCourse, upload: PendingUpload) -> BatchContents:
    kept_uploads = PendingUploads(context.settings.home)
    table = kept_uploads.people_path(upload)
    people = None if table is None else read_people(table)
    submissions = kept_uploads.submissions_path(upload)
    return read_upload(context, here.actor, upload.course_id, submissions, upload.assignment, people)


def _require_upload(context: WebContext, here: ReaderInCourse, upload_id: str) -> PendingUpload:
    kept_uploads = PendingUploads(context.settings.home)
    found = kept_uploads.find(upload_id, here.reader.identity.person_id, here.course_id)
    if found is None:
        raise HTTPException(
            404,
            translatable(
                "This upload no longer exists. It was confirmed, discarded or removed, or it is more than a day old."
            ),
        )
    return found
