"""Appeals: students ask about a grade, and instructors read the appeals and answer them."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated

from fastapi import APIRouter, Form, Query, Request
from fastapi.responses import RedirectResponse, Response

from service.operations import appeals
from service.operations.appeals import LONGEST_TEXT
from service.web.access import CourseInstructor, CourseStudent, RowNumber, RowNumberAfter
from service.web.context import Context
from service.web.rendering import render_page

router = APIRouter(prefix="/courses/{course_id}")
Text = Annotated[str, Form()]
_PAGE_SIZE = 50


@router.get("/appeals")
def show_appeals(
    request: Request,
    here: CourseInstructor,
    context: Context,
    after: RowNumberAfter = 0,
    answered_after: Annotated[str, Query(max_length=100)] = "",
) -> Response:
    """Show the appeals to instructors in pages, open ones first."""
    where, most = (context.service, here.actor, here.course_id), _PAGE_SIZE + 1
    still_open = appeals.list_open(*where, limit=most, after=after)
    answered = appeals.list_answered(*where, limit=most, after=_parse_cursor(answered_after))
    last = answered[_PAGE_SIZE - 1] if len(answered) > _PAGE_SIZE else None
    return render_page(
        request,
        here.reader,
        "appeals.html",
        here=here,
        open=still_open[:_PAGE_SIZE],
        answered=answered[:_PAGE_SIZE],
        more=still_open[_PAGE_SIZE - 1].id if len(still_open) > _PAGE_SIZE else None,
        older=f"{last.answered_at.isoformat()} {last.id}" if last is not None and last.answered_at else "",
        longest=LONGEST_TEXT,
    )


def _parse_cursor(written: str) -> tuple[datetime, int] | None:
    """Return the time and id at which the previous page ended, or None for the first page or invalid text."""
    at, _, last = written.partition(" ")
    try:
        found = datetime.fromisoformat(at).astimezone(UTC)
    except (ValueError, OverflowError):
        return None
    return (found, int(last)) if last.isdecimal() and len(last) < 10 else None


@router.post("/appeals/{appeal_id}/answer")
def answer_appeal(here: CourseInstructor, context: Context, appeal_id: RowNumber, text: Text = "") -> Response:
    """Answer an appeal and close it."""
    appeals.answer(context.service, here.actor, here.course_id, appeal_id, text)
    return RedirectResponse(f"/courses/{here.course_id}/appeals", 303)


@router.get("/mine/submissions/{submission_id}/appeal")
def show_own_appeals(request: Request, here: CourseStudent, context: Context, submission_id: RowNumber) -> Response:
    """Show a student's appeals about a submission, the answers, and the form if they may appeal."""
    found = appeals.show_own(context.service, here.actor, here.course_id, submission_id)
    return render_page(request, here.reader, "appeal.html", here=here, found=found, longest=LONGEST_TEXT)


@router.post("/mine/submissions/{submission_id}/appeal")
def submit_appeal(here: CourseStudent, context: Context, submission_id: RowNumber, text: Text = "") -> Response:
    """Submit an appeal."""
    appeals.submit(context.service, here.actor, here.course_id, submission_id, text)
    return RedirectResponse(f"/courses/{here.course_id}/mine/submissions/{submission_id}/appeal", 303)
