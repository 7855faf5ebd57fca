"""A student's own work in a course: the open assignments, the task of one, and submitting to it.

``own_submission.py`` shows the results of a submission.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from typing import Annotated

from fastapi import APIRouter, File, Form, Request, UploadFile
from fastapi.responses import RedirectResponse, Response
from starlette.exceptions import HTTPException

from service.operations import own_views
from service.operations.errors import NotFound
from service.operations.own_submissions import OwnSubmission
from service.operations.submissions import MissingPart, SubmissionRequest
from service.operations.types import Role
from service.reports.display_text import join_wrapped_lines
from service.web.access import CourseStudent, ReaderInCourse
from service.web.api_uploads import MAX_SUBMISSION_BYTES
from service.web.attachments import respond_with_attachment
from service.web.context import Context, WebContext
from service.web.errors import describe_error
from service.web.http_errors import extract_message
from service.web.language import detect_language
from service.web.rendering import render_page
from service.web.request_bodies import takes_upload
from service.web.student_submissions import submit
from sim.errors import UsageError
from submissions.raw_files import UploadedFile

router = APIRouter()

#: The files of a form, and the texts typed instead of them, in the order of the requested files.
Files = Annotated[tuple[UploadFile, ...], File()]
Texts = Annotated[tuple[str, ...], Form()]


@dataclass(frozen=True, slots=True)
class _Rejection:
    """The reason why a submission was rejected, and the texts that the student typed."""

    sentence: str
    status: int
    texts: Sequence[str]
    headers: Mapping[str, str] = field(default_factory=dict)
    lacks_part: bool = False


@router.get("/courses/{course_id}/mine")
def list_own_assignments(request: Request, access: CourseStudent, context: Context) -> Response:
    """Show the assignments of the course, with the student's newest submissions and rejected files."""
    work = own_views.show_work(context.service, access.actor, access.course_id)
    return render_page(
        request,
        access.reader,
        "own_assignments.html",
        access=access,
        lines=work.assignments,
        rejected_files=work.rejected_files,
    )


@router.get("/courses/{course_id}/mine/{assignment}")
def show_own_assignment(request: Request, access: CourseStudent, context: Context, assignment: str) -> Response:
    """Show an assignment's task, the form to submit to it, and earlier attempts."""
    return _render_assignment(request, access, context, assignment, None)


@router.post("/courses/{course_id}/mine/{assignment}")
@takes_upload(MAX_SUBMISSION_BYTES, Role.STUDENT)
def submit_own_files(
    request: Request,
    access: CourseStudent,
    context: Context,
    assignment: str,
    files: Files = (),
    texts: Texts = (),
    even_in_part: Annotated[bool, Form()] = False,
) -> Response:
    """Submit the chosen files and typed texts, and redirect to the submission's page."""
    sheet = own_views.show_sheet(context.service, access.actor, access.course_id, assignment)
    try:
        submission_request = SubmissionRequest(assignment, collect_sent_files(sheet.asked, files, texts), even_in_part)
        accepted_submission = submit(context, access.actor, access.course_id, submission_request)
    except NotFound:
        raise
    except UsageError as error:
        sentence = describe_error(error, detect_language(request))
        rejection = _Rejection(sentence, 422, texts, lacks_part=isinstance(error, MissingPart))
        return _render_assignment(request, access, context, assignment, rejection)
    except HTTPException as error:
        if error.status_code != 429:
            raise
        sentence = detect_language(request).translate_sentence(extract_message(error))
        rejection = _Rejection(sentence, 429, texts, dict(error.headers or {}))
        return _render_assignment(request, access, context, assignment, rejection)
    return RedirectResponse(f"/courses/{access.course_id}/mine/submissions/{accepted_submission.submission_id}", 303)


@router.get("/courses/{course_id}/mine/{assignment}/given/{file}")
def download_given_file(access: CourseStudent, context: Context, assignment: str, file: str) -> Response:
    """Return a file that the assignment provides to students."""
    return respond_with_attachment(
        own_views.show_given_file(context.service, access.actor, access.course_id, assignment, file), file
    )


def collect_sent_files(asked: Sequence[str], files: Sequence[UploadFile], texts: Sequence[str]) -> list[UploadedFile]:
    """Return the submitted files of a form: the chosen files, and each typed text under the name of its file.

    Raises:
        UsageError: A file was both chosen and typed.
    """
    chosen_files = [UploadedFile(each.filename, each.file) for each in files if each.filename]
    typed_files = [
        UploadedFile(name, BytesIO(text.replace("\r\n", "\n").encode()))
        for name, text in zip(asked, texts, strict=False)
        if text.strip()
    ]
    names = {each.flat_name.lower() for each in chosen_files}
    for file in typed_files:
        if file.flat_name in names:
            raise UsageError("%(name)s was both selected as a file and typed. Remove one of them.", name=file.flat_name)
    return [*chosen_files, *typed_files]


def compute_marks_curve(attempts: Sequence[OwnSubmission]) -> list[tuple[float, float]]:
    """Return the marks of the graded attempts, oldest first, as points in a drawing of 100 by 24 units."""
    shares = [
        float(each.marks / each.max_marks) for each in reversed(attempts) if each.marks is not None and each.max_marks
    ]
    step = 92 / max(1, len(shares) - 1)
    return [(round(4 + number * step, 1), round(20 - 16 * share, 1)) for number, share in enumerate(shares)]


def _render_assignment(
    request: Request, access: ReaderInCourse, context: WebContext, assignment: str, rejection: _Rejection | None
) -> Response:
    task = own_views.show_task(context.service, access.actor, access.course_id, assignment)
    page = render_page(
        request,
        access.reader,
        "own_assignment.html",
        status_code=rejection.status if rejection else 200,
        access=access,
        sheet=task.sheet,
        description=join_wrapped_lines(task.sheet.description),
        attempts=task.attempts,
        counting=task.counting,
        curve=compute_marks_curve(task.attempts),
        allowance=task.allowance,
        is_open=task.is_open,
        closed_at=task.closed_at,
        can_try=task.can_test_run,
        rejection=rejection,
    )
    page.headers.update(rejection.headers if rejection else {})
    return page
