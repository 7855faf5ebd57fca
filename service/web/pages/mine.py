"""A student's own work in a course: what is open, what one assignment asks for, and submitting to it.

What came of a submission is ``own_submission.py``'s.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from typing import Annotated

from fastapi import APIRouter, File, Form, Request, UploadFile
from fastapi.responses import RedirectResponse, Response
from starlette.exceptions import HTTPException

from service import own_work
from service.own_work import OwnSubmission
from service.reports.readable import flowing
from service.store.courses import open_assignments
from service.store.queue import tryouts
from service.trying import tryout_assignment
from service.web.access import InCourse, Studying, enrolment_in, nothing_here
from service.web.attachments import attachment
from service.web.context import Context, WebContext
from service.web.errors import sentence_of
from service.web.language import language_of
from service.web.refusing import said_in
from service.web.rendering import page
from service.web.submitting import LacksPart, seen_assignment, submit
from sim.errors import UsageError
from submissions.assignment.task_sheet import TaskSheet, task_sheet
from submissions.raw_files import SentFile

router = APIRouter()

#: Files that a form carries, and the texts that were typed in their place, in the order of the files asked for.
Files = Annotated[tuple[UploadFile, ...], File()]
Texts = Annotated[tuple[str, ...], Form()]


@dataclass(frozen=True, slots=True)
class _Refused:
    """Why nothing was taken in, and what had been typed."""

    sentence: str
    status: int
    texts: Sequence[str]
    headers: Mapping[str, str] = field(default_factory=dict)
    lacks_part: bool = False


@router.get("/courses/{course_id}/mine")
def mine(request: Request, here: Studying, context: Context) -> Response:
    """What is open, and what was submitted."""
    with context.store.reading() as session:
        enrolment_id = enrolment_in(session, here.reader.identity, here.course_id).id
        lines = own_work.own_assignments(session, here.course_id, enrolment_id)
    return page(request, here.reader, "mine.html", here=here, lines=lines)


@router.get("/courses/{course_id}/mine/{assignment}")
def own_assignment(request: Request, here: Studying, context: Context, assignment: str) -> Response:
    """What an assignment asks for, the form to submit to it, and earlier attempts."""
    return _shown(request, here, context, assignment, None)


@router.post("/courses/{course_id}/mine/{assignment}")
def submit_own(
    request: Request,
    here: Studying,
    context: Context,
    assignment: str,
    files: Files = (),
    texts: Texts = (),
    even_in_part: Annotated[bool, Form()] = False,
) -> Response:
    """Take in what was chosen and typed, and go where it is waited for."""
    with context.store.reading() as session:
        sheet = task_sheet(seen_assignment(session, here.reader.identity, here.course_id, assignment))
    try:
        sent = sent_files(sheet, files, texts)
        accepted = submit(context, here.reader.identity, here.course_id, assignment, sent, even_in_part=even_in_part)
    except UsageError as error:
        sentence = sentence_of(error, language_of(request))
        refused = _Refused(sentence, 422, texts, lacks_part=isinstance(error, LacksPart))
        return _shown(request, here, context, assignment, refused)
    except HTTPException as error:
        if error.status_code != 429:
            raise
        sentence = language_of(request).tell(said_in(error))
        refused = _Refused(sentence, 429, texts, dict(error.headers or {}))
        return _shown(request, here, context, assignment, refused)
    return RedirectResponse(f"/courses/{here.course_id}/mine/submissions/{accepted.submission_id}", 303)


@router.get("/courses/{course_id}/mine/{assignment}/given/{file}")
def given_file(here: Studying, context: Context, assignment: str, file: str) -> Response:
    """A file that the assignment gives its students."""
    with context.store.reading() as session:
        sheet = task_sheet(seen_assignment(session, here.reader.identity, here.course_id, assignment))
    if file not in sheet.given:
        raise nothing_here()
    return attachment(sheet.given[file], file)


def sent_files(sheet: TaskSheet, files: Sequence[UploadFile], texts: Sequence[str]) -> list[SentFile]:
    """What a form carried: the files chosen, and each text under the name of the file that it stands for.

    Raises UsageError where one was chosen and typed.
    """
    chosen = [SentFile(each.filename, each.file) for each in files if each.filename]
    typed = [
        SentFile(name, BytesIO(text.replace("\r\n", "\n").encode()))
        for name, text in zip(sheet.asked, texts, strict=False)
        if text.strip()
    ]
    names = {each.flat_name.lower() for each in chosen}
    for each in typed:
        if each.flat_name in names:
            raise UsageError("%(name)s was chosen as a file and typed as well; keep one of them.", name=each.flat_name)
    return [*chosen, *typed]


def curve(attempts: Sequence[OwnSubmission]) -> list[tuple[float, float]]:
    """How the marks moved, as points of a drawing of 100 by 24, from the first attempt to the newest."""
    shares = [
        float(each.marks / each.max_marks) for each in reversed(attempts) if each.marks is not None and each.max_marks
    ]
    step = 92 / max(1, len(shares) - 1)
    return [(round(4 + number * step, 1), round(20 - 16 * share, 1)) for number, share in enumerate(shares)]


def _shown(
    request: Request, here: InCourse, context: WebContext, assignment: str, refused: _Refused | None
) -> Response:
    with context.store.reading() as session:
        seen = seen_assignment(session, here.reader.identity, here.course_id, assignment)
        sheet = task_sheet(seen)
        enrolment_id = enrolment_in(session, here.reader.identity, here.course_id).id
        attempts = own_work.own_submissions(session, enrolment_id, assignment)
        counting = own_work.counting_submission(session, enrolment_id, assignment)
        allowance = own_work.allowance(session, enrolment_id, assignment)
        has_tried = tryouts.newest(session, enrolment_id, assignment) is not None
        prepared = open_assignments.of_course(session, here.course_id)
    is_open = any(each.assignment == assignment and each.open for each in prepared)
    shown = page(
        request,
        here.reader,
        "own_assignment.html",
        status_code=refused.status if refused else 200,
        here=here,
        sheet=sheet,
        description=flowing(sheet.description),
        attempts=attempts,
        counting=counting,
        curve=curve(attempts),
        allowance=allowance,
        is_open=is_open,
        can_try=is_open and tryout_assignment(seen) is not None,
        has_tried=has_tried,
        refused=refused,
    )
    shown.headers.update(refused.headers if refused else {})
    return shown
