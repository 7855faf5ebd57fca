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
from service.web.api_uploads import MAX_BATCH_BYTES
from service.web.batch_uploads import read_upload
from service.web.context import Context, WebContext
from service.web.rendering import render_page
from service.web.request_bodies import takes_upload
from sim.errors import UsageError
from submissions.assignment.folder import list_catalogue_ids
from submissions.batch_folder import BatchContents
from submissions.part_fitting import find_empty_parts, find_missing_part
from submissions.raw_files import UploadedFile, sanitise_name
from submissions.student_identity import read_people
from submissions.submission import PART_FILES

router = APIRouter(prefix="/courses/{course_id}/batches")
_ARCHIVE_SUFFIXES = (".zip",)
#: Suffixes of one student's submission in an upload of single files. The contents are checked later.
_SUBMISSION_SUFFIXES = (".zip", ".py", ".ipynb")


@router.get("")
def list_batches(request: Request, access: CourseInstructor, context: Context, after: RowNameAfter = "") -> Response:
    """Show the batches of the course, newest first, and a form for a new one."""
    return _render_list(request, access, context, last_id=after)


@router.post("/uploads")
@takes_upload(MAX_BATCH_BYTES, Role.INSTRUCTOR)
def upload(
    request: Request,
    access: CourseInstructor,
    context: Context,
    files: Annotated[list[UploadFile], File()],
    people: Annotated[UploadFile | None, File()] = None,
    assignment: Annotated[str, Form(max_length=100)] = "",
) -> Response:
    """Save the uploaded files and determine which submissions would be accepted."""
    pending_uploads = PendingUploads(context.settings.home)
    pending_upload = pending_uploads.begin(access.reader.identity.person_id, access.course_id, assignment)
    try:
        stored_upload = _store_files(
            pending_uploads,
            pending_upload,
            _list_sent_files(files),
            _list_sent_files([people] if people is not None else []),
        )
        contents = _read_contents(context, access, stored_upload)
        expected_submissions = _build_expected_submissions(
            operations.preview_submissions(context.service, access.actor, access.course_id, contents)
        )
        pending_uploads.write(replace(stored_upload, expected=expected_submissions, refusals=contents.refusals))
    except UsageError as error:
        pending_uploads.remove(pending_upload)
        return _render_list(request, access, context, rejection=str(error), status_code=422)
    return RedirectResponse(f"/courses/{access.course_id}/batches/uploads/{stored_upload.id}", 303)


@router.get("/uploads/{upload_id}")
def show_upload(request: Request, access: CourseInstructor, context: Context, upload_id: RowName) -> Response:
    """Show the accepted and rejected submissions of an upload, before it is confirmed."""
    pending_upload = _require_upload(context, access, upload_id)
    missing: dict[str, list[str]] = {}
    for submission in pending_upload.expected:
        if submission.missing:
            missing.setdefault(submission.missing, []).append(submission.student)
    return render_page(
        request,
        access.reader,
        "upload.html",
        access=access,
        upload=pending_upload,
        known_jobs=None,
        missing=missing,
        new_students=[each.student for each in pending_upload.expected if not each.enrolled],
        known_before=sum(each.known for each in pending_upload.expected),
        copied=sum(each.copied for each in pending_upload.expected),
    )


@router.post("/uploads/{upload_id}/confirm")
def confirm(
    request: Request,
    access: CourseInstructor,
    context: Context,
    upload_id: RowName,
    again: Annotated[bool, Form()] = False,
) -> Response:
    """Create a batch from an upload."""
    pending_upload = _require_upload(context, access, upload_id)
    submit_request = SubmitRequest(pending_upload.name, _read_contents(context, access, pending_upload), again)
    submitted_batch = operations.submit(context.service, access.actor, access.course_id, submit_request)
    PendingUploads(context.settings.home).remove(pending_upload)
    if submitted_batch.batch is None:
        known_jobs = sorted((each.student, each.job_id) for each in submitted_batch.known)
        return render_page(
            request, access.reader, "upload.html", access=access, upload=pending_upload, known_jobs=known_jobs
        )
    return RedirectResponse(f"/courses/{access.course_id}/batches/{submitted_batch.batch.id}?done=submit", 303)


@router.post("/uploads/{upload_id}/discard")
def discard(access: CourseInstructor, context: Context, upload_id: RowName) -> Response:
    """Discard an upload."""
    PendingUploads(context.settings.home).remove(_require_upload(context, access, upload_id))
    return RedirectResponse(f"/courses/{access.course_id}/batches", 303)


def _render_list(
    request: Request,
    access: ReaderInCourse,
    context: WebContext,
    *,
    last_id: str = "",
    rejection: str = "",
    status_code: int = 200,
) -> Response:
    page = views.list_batches_page(context.service, access.actor, access.course_id, last_id)
    prepared_ids = {each.assignment for each in page.prepared}
    return render_page(
        request,
        access.reader,
        "batches.html",
        status_code=status_code,
        access=access,
        batches=page.batches,
        older=page.older,
        unfinished=any(line.unfinished for line in page.batches),
        prepared=page.prepared,
        catalogue=[each for each in list_catalogue_ids() if each not in prepared_ids],
        rejection=rejection,
        waiting=PendingUploads(context.settings.home).list_waiting(access.reader.identity.person_id, access.course_id),
    )


def _build_expected_submissions(previews: Sequence[SubmissionPreview]) -> tuple[ExpectedSubmission, ...]:
    submissions = []
    for preview in previews:
        grading_request, intake_preview = preview.request, preview.intake_preview
        missing_part = find_missing_part(grading_request.submission, grading_request.assignment.parts)
        submissions.append(
            ExpectedSubmission(
                grading_request.submission.student,
                preview.name,
                grading_request.assignment.title,
                grading_request.source,
                PART_FILES[missing_part] if missing_part is not None else "",
                intake_preview.enrolled,
                intake_preview.known,
                intake_preview.copied,
                next(iter(find_empty_parts(grading_request.submission)), ""),
            )
        )
    return tuple(submissions)


def _list_sent_files(files: list[UploadFile]) -> list[UploadedFile]:
    """Return the files of a form field. Browsers send an empty field as a file without a name, which is skipped."""
    return [UploadedFile(file.filename, file.file) for file in files if file.filename]


def _store_files(
    pending_uploads: PendingUploads,
    pending_upload: PendingUpload,
    files: list[UploadedFile],
    people: list[UploadedFile],
) -> PendingUpload:
    """Store the files in the upload and return it with their names. Raises UsageError for unsuitable files."""
    if not files:
        raise UsageError("no files were uploaded, expected a .zip, or a file for each student")
    suffixes = {Path(file.flat_name).suffix.lower() for file in files}
    if not suffixes <= set(_SUBMISSION_SUFFIXES):
        unsupported_name = next(
            file.flat_name for file in files if Path(file.flat_name).suffix.lower() not in _SUBMISSION_SUFFIXES
        )
        raise UsageError(
            f"{sanitise_name(unsupported_name)} was uploaded, expected a .zip, or a .py, .ipynb or .zip for each "
            "student"
        )
    names = pending_uploads.store_files(pending_upload, files, "batch")
    is_one_archive = len(names) == 1 and names[0].lower().endswith(_ARCHIVE_SUFFIXES)
    table = pending_uploads.store_files(pending_upload, people, "people") if people else [""]
    if is_one_archive:
        upload_name = Path(names[0]).stem
    else:
        upload_name = names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"
    return replace(
        pending_upload, name=sanitise_name(upload_name), file=names[0] if is_one_archive else "", people=table[0]
    )


def _read_contents(context: WebContext, access: ReaderInCourse, upload: PendingUpload) -> BatchContents:
    pending_uploads = PendingUploads(context.settings.home)
    table = pending_uploads.people_path(upload)
    people = None if table is None else read_people(table)
    submissions = pending_uploads.submissions_path(upload)
    return read_upload(context, access.actor, upload.course_id, submissions, upload.assignment, people)


def _require_upload(context: WebContext, access: ReaderInCourse, upload_id: str) -> PendingUpload:
    pending_uploads = PendingUploads(context.settings.home)
    pending_upload = pending_uploads.find(upload_id, access.reader.identity.person_id, access.course_id)
    if pending_upload is None:
        raise HTTPException(
            404,
            translatable(
                "This upload no longer exists. It was confirmed, discarded or removed, or it is more than a day old."
            ),
        )
    return pending_upload
