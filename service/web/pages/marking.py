"""What instructors set by hand: a criterion's marks, one that is excused, comments to the student; and who did what.

The student is not named, so that it can be marked with names hidden.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

from fastapi import APIRouter, Form, Request
from fastapi.responses import RedirectResponse, Response
from sqlalchemy.orm import Session

from service.store import comments, marking_history, overrides
from service.store.comments import LONGEST_COMMENT
from service.store.models import AssignmentVersion
from service.store.overrides import LONGEST_REASON
from service.web.access import InCourse, Instructing, job_in
from service.web.context import Context, WebContext
from service.web.rendering import page

router = APIRouter(prefix="/courses/{course_id}/grades/{job_id}/marking")
Criterion = Annotated[str, Form(max_length=200)]
Reason = Annotated[str, Form()]


@router.get("")
def marking(request: Request, here: Instructing, context: Context, job_id: str) -> Response:
    """The criteria of a grade with forms for each, the comments, and the history."""
    with context.store.reading() as session:
        job = job_in(session, here.course_id, job_id)
        title = session.get_one(AssignmentVersion, job.assignment_version_id).title
        lines = overrides.criterion_marks(session, job_id)
        written = comments.of_job(session, job_id)
        history = marking_history.history(session, job.submission_id)
    return page(
        request,
        here.reader,
        "marking.html",
        here=here,
        job=job,
        title=title,
        lines=lines,
        comments=written,
        history=history,
        longest_reason=LONGEST_REASON,
        longest_comment=LONGEST_COMMENT,
    )


@router.post("/set")
def set_marks(
    here: Instructing,
    context: Context,
    job_id: str,
    criterion: Criterion,
    reason: Reason = "",
    marks: Annotated[str, Form(max_length=20)] = "",
) -> Response:
    """Set the marks of a criterion."""
    wanted = overrides.read_marks(marks)
    return _changed(
        here,
        context,
        job_id,
        lambda session: overrides.set_marks(session, job_id, criterion, wanted, reason, here.actor),
    )


@router.post("/excuse")
def excuse(here: Instructing, context: Context, job_id: str, criterion: Criterion, reason: Reason = "") -> Response:
    """Let a criterion not count."""
    return _changed(
        here, context, job_id, lambda session: overrides.excuse(session, job_id, criterion, reason, here.actor)
    )


@router.post("/withdraw")
def withdraw(here: Instructing, context: Context, job_id: str, criterion: Criterion) -> Response:
    """Let the grader's marks of a criterion count again."""
    return _changed(here, context, job_id, lambda session: overrides.withdraw(session, job_id, criterion, here.actor))


@router.post("/comment")
def comment(
    here: Instructing,
    context: Context,
    job_id: str,
    text: Annotated[str, Form()] = "",
    criterion: Criterion = "",
) -> Response:
    """Write a comment for the student."""
    return _changed(
        here, context, job_id, lambda session: comments.comment(session, job_id, criterion, text, here.actor)
    )


@router.post("/uncomment")
def uncomment(here: Instructing, context: Context, job_id: str, comment_id: Annotated[int, Form()]) -> Response:
    """Withdraw a comment."""
    return _changed(here, context, job_id, lambda session: comments.withdraw(session, job_id, comment_id, here.actor))


def _changed(here: InCourse, context: WebContext, job_id: str, change: Callable[[Session], object]) -> Response:
    """Make a change to a grade of the course, then show all of it again."""
    with context.store.transaction() as session:
        job_in(session, here.course_id, job_id)
        change(session)
    return RedirectResponse(f"/courses/{here.course_id}/grades/{job_id}/marking", 303)
