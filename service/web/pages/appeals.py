"""Appeals: students ask about a grade, and instructors read the appeals and answer them."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated

from fastapi import APIRouter, Form, Query, Request
from fastapi.responses import RedirectResponse, Response

from service.operations import appeals
from service.operations.appeals import MAX_TEXT_LENGTH
from service.web.access import CourseInstructor, CourseStudent, RowNumber, RowNumberAfter
from service.web.context import Context
from service.web.rendering import render_page

router = APIRouter(prefix="/courses/{course_id}")
Text = Annotated[str, Form()]
_PAGE_SIZE = 50


@router.get("/appeals")
def show_appeals(
    request: Request,
    access: CourseInstructor,
    context: Context,
    after: RowNumberAfter = 0,
    answered_after: Annotated[str, Query(max_length=100)] = "",
) -> Response:
    """Show the appeals to instructors in pages, open ones first."""
    course_key, limit = (context.service, access.actor, access.course_id), _PAGE_SIZE + 1
    open_appeals = appeals.list_open(*course_key, limit=limit, last_id=after)
    answered_appeals = appeals.list_answered(*course_key, limit=limit, cursor=_parse_cursor(answered_after))
    last_appeal = answered_appeals[_PAGE_SIZE - 1] if len(answered_appeals) > _PAGE_SIZE else None
    return render_page(
        request,
        access.reader,
        "appeals.html",
        access=access,
        open=open_appeals[:_PAGE_SIZE],
        answered=answered_appeals[:_PAGE_SIZE],
        more=open_appeals[_PAGE_SIZE - 1].id if len(open_appeals) > _PAGE_SIZE else None,
        older=f"{last_appeal.answered_at.isoformat()} {last_appeal.id}"
        if last_appeal is not None and last_appeal.answered_at
        else "",
        longest=MAX_TEXT_LENGTH,
    )


def _parse_cursor(cursor: str) -> tuple[datetime, int] | None:
    """Return the time and id at which the previous page ended, or None for the first page or invalid text."""
    time_text, _, id_text = cursor.partition(" ")
    try:
        answered_at = datetime.fromisoformat(time_text).astimezone(UTC)
    except (ValueError, OverflowError):
        return None
    return (answered_at, int(id_text)) if id_text.isdecimal() and len(id_text) < 10 else None


@router.post("/appeals/{appeal_id}/answer")
def answer_appeal(access: CourseInstructor, context: Context, appeal_id: RowNumber, text: Text = "") -> Response:
    """Answer an appeal and close it."""
    appeals.answer(context.service, access.actor, access.course_id, appeal_id, text)
    return RedirectResponse(f"/courses/{access.course_id}/appeals", 303)


@router.get("/mine/submissions/{submission_id}/appeal")
def show_own_appeals(request: Request, access: CourseStudent, context: Context, submission_id: RowNumber) -> Response:
    """Show a student's appeals about a submission, the answers, and the form if they may appeal."""
    own_appeals = appeals.show_own(context.service, access.actor, access.course_id, submission_id)
    return render_page(
        request, access.reader, "appeal.html", access=access, own_appeals=own_appeals, longest=MAX_TEXT_LENGTH
    )


@router.post("/mine/submissions/{submission_id}/all-trials")
def run_all_trials(access: CourseStudent, context: Context, submission_id: RowNumber) -> Response:
    """Run all trials of the pools of a submission now."""
    appeals.run_all_trials(context.service, access.actor, access.course_id, submission_id)
    return RedirectResponse(f"/courses/{access.course_id}/mine/submissions/{submission_id}/appeal", 303)


@router.post("/mine/submissions/{submission_id}/appeal")
def submit_appeal(access: CourseStudent, context: Context, submission_id: RowNumber, text: Text = "") -> Response:
    """Submit an appeal."""
    appeals.submit(context.service, access.actor, access.course_id, submission_id, text)
    return RedirectResponse(f"/courses/{access.course_id}/mine/submissions/{submission_id}/appeal", 303)
