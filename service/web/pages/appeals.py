"""A student asks for a second look at a submission; an instructor sees what is asked, and answers."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Form, Request
from fastapi.responses import RedirectResponse, Response

from service.store.courses import open_assignments
from service.store.courses.hidden_names import hidden_names_of
from service.store.grades import appeals
from service.store.grades.appeals import LONGEST_TEXT
from service.web.access import Instructing, Studying, own_submission
from service.web.context import Context
from service.web.rendering import page

router = APIRouter(prefix="/courses/{course_id}")
Text = Annotated[str, Form()]


@router.get("/appeals")
def asked(request: Request, here: Instructing, context: Context) -> Response:
    """What students ask, the open ones first."""
    hidden = hidden_names_of(context.store, here.course_id)
    with context.store.reading() as session:
        still_open = appeals.in_course(session, here.course_id, hidden, answered=False)
        answered = appeals.in_course(session, here.course_id, hidden, answered=True)
    return page(
        request, here.reader, "appeals.html", here=here, open=still_open, answered=answered, longest=LONGEST_TEXT
    )


@router.post("/appeals/{appeal_id}/answer")
def answer(here: Instructing, context: Context, appeal_id: int, text: Text = "") -> Response:
    """Answer one, which closes it."""
    with context.store.transaction() as session:
        appeals.answer(session, here.course_id, appeal_id, text, here.actor)
    return RedirectResponse(f"/courses/{here.course_id}/appeals", 303)


@router.get("/mine/submissions/{submission_id}/appeal")
def appeal(request: Request, here: Studying, context: Context, submission_id: int) -> Response:
    """What one asked of a submission, the answers, and a form where one may ask."""
    with context.store.reading() as session:
        submission = own_submission(session, here.reader.identity, here.course_id, submission_id)
        earlier = appeals.of_submission(session, submission_id)
        may = appeals.may_appeal(session, submission_id)
        prepared = {each.assignment: each.title for each in open_assignments.of_course(session, here.course_id)}
    return page(
        request,
        here.reader,
        "appeal.html",
        here=here,
        submission=submission,
        title=prepared.get(submission.assignment, submission.assignment),
        appeals=earlier,
        may=may and all(each.answered_at is not None for each in earlier),
        longest=LONGEST_TEXT,
    )


@router.post("/mine/submissions/{submission_id}/appeal")
def ask(here: Studying, context: Context, submission_id: int, text: Text = "") -> Response:
    """Ask for a second look."""
    with context.store.transaction() as session:
        own_submission(session, here.reader.identity, here.course_id, submission_id)
        appeals.ask(session, submission_id, text)
    return RedirectResponse(f"/courses/{here.course_id}/mine/submissions/{submission_id}/appeal", 303)
