"""Trying a program without submitting it: the form, the wait, what it said, and its replay. It leaves no marks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response
from starlette.exceptions import HTTPException

from service.reports.html import replay_section
from service.store.queue import tryouts
from service.trying import tryout_assignment
from service.web.access import InCourse, Studying, enrolment_in
from service.web.context import Context, WebContext
from service.web.errors import sentence_of
from service.web.language import language_of
from service.web.pages.mine import Files, Texts, sent_files
from service.web.refusing import said_in
from service.web.rendering import page, wants_part
from service.web.submitting import seen_assignment, try_out
from sim.errors import UsageError
from submissions.assignment.task_sheet import TaskSheet, task_sheet
from submissions.packed import unpack_submission
from submissions.submission import PART_FILES, Submission

router = APIRouter()


@router.get("/courses/{course_id}/mine/{assignment}/try")
def newest_tryout(request: Request, here: Studying, context: Context, assignment: str) -> Response:
    """What was tried last, with the program in the form to be changed; htmx is told to load it when it is through."""
    if not wants_part(request):
        return _shown(request, here, context, assignment)
    with context.store.reading() as session:
        enrolment_id = enrolment_in(session, here.reader.identity, here.course_id).id
        newest = tryouts.newest(session, enrolment_id, assignment)
        line = tryouts.line(session, enrolment_id, newest) if newest else None
    if line is None or not line.waits:
        return Response(headers={"hx-refresh": "true"})
    return page(request, here.reader, "tryout_progress.html", here=here, line=line)


@router.post("/courses/{course_id}/mine/{assignment}/try")
def try_own(
    request: Request, here: Studying, context: Context, assignment: str, files: Files = (), texts: Texts = ()
) -> Response:
    """Let what was chosen and typed be run."""
    with context.store.reading() as session:
        sheet = task_sheet(seen_assignment(session, here.reader.identity, here.course_id, assignment))
    try:
        try_out(context, here.reader.identity, here.course_id, assignment, sent_files(sheet, files, texts))
    except UsageError as error:
        return _shown(request, here, context, assignment, 422, sentence_of(error, language_of(request)), texts)
    except HTTPException as error:
        if error.status_code != 429:
            raise
        sentence = language_of(request).tell(said_in(error))
        return _shown(request, here, context, assignment, 429, sentence, texts, error.headers)
    return RedirectResponse(str(request.url.path), 303)


def _shown(
    request: Request,
    here: InCourse,
    context: WebContext,
    assignment: str,
    status: int = 200,
    refused: str = "",
    typed: Sequence[str] = (),
    headers: Mapping[str, str] | None = None,
) -> Response:
    with context.store.reading() as session:
        enrolment_id = enrolment_in(session, here.reader.identity, here.course_id).id
        seen = seen_assignment(session, here.reader.identity, here.course_id, assignment)
        newest = tryouts.newest(session, enrolment_id, assignment)
        line = tryouts.line(session, enrolment_id, newest) if newest else None
        replay = tryouts.replay_of(session, newest) if newest else None
        tried = unpack_submission(tryouts.kept(session, newest)[0]) if newest else None
    sheet, once = task_sheet(seen), tryout_assignment(seen)
    shown = page(
        request,
        here.reader,
        "tryout.html",
        status_code=status,
        here=here,
        sheet=sheet,
        seconds=once.scenarios[0].seconds if once else None,
        line=line,
        replay=replay_section(replay, language_of(request)) if replay else None,
        refused=refused,
        texts=list(typed) or (_texts(sheet, tried) if tried else []),
    )
    shown.headers.update(headers or {})
    return shown


def _texts(sheet: TaskSheet, tried: Submission) -> list[str]:
    """What was tried, by the files that are asked for; empty for what is no text."""
    parts = {PART_FILES["program"]: tried.program, PART_FILES["responder"]: tried.responder}
    found = []
    for name in sheet.asked:
        code = parts.get(name)
        found.append(code.text if code is not None else tried.files.get(name, b"").decode("utf-8", "replace"))
    return found
