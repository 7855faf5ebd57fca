"""What instructors set by hand: a criterion's marks, one that is excused, comments to the student; and who did what.

The student goes by another name where names are hidden.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

from fastapi import APIRouter, Form, Request
from fastapi.responses import RedirectResponse, Response
from sqlalchemy.orm import Session

from service.store.batches import batches
from service.store.courses.hidden_names import hidden_names_of
from service.store.grades import comments, marking_history, overrides
from service.store.grades.comments import LONGEST_COMMENT
from service.store.grades.overrides import LONGEST_REASON
from service.store.models import AssignmentVersion
from service.web.access import InCourse, Instructing, job_in
from service.web.context import Context, WebContext
from service.web.neighbours import neighbours
from service.web.rendering import page
from sim.errors import UsageError

router = APIRouter(prefix="/courses/{course_id}/grades/{job_id}/marking")
Criterion = Annotated[str, Form(max_length=200)]
Reason = Annotated[str, Form()]
#: What was set by hand when the form was shown; 0 where nothing was.
Seen = Annotated[int | None, Form(ge=0)]


@router.get("")
def marking(request: Request, here: Instructing, context: Context, job_id: str) -> Response:
    """The criteria of a grade with forms for each, the comments, and the history."""
    hidden = hidden_names_of(context.store, here.course_id)
    with context.store.reading() as session:
        job = job_in(session, here.course_id, job_id)
        line = batches.job_line(session, job_id).hidden_by(hidden)
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
        line=line,
        title=title,
        beside=neighbours(context.store, job, hidden),
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
    seen: Seen = None,
) -> Response:
    """Set the marks of a criterion, unless somebody else did since the form was shown."""
    wanted = overrides.read_marks(marks)

    def change(session: Session) -> None:
        _check_seen(session, job_id, criterion, seen)
        overrides.set_marks(session, job_id, criterion, wanted, reason, here.actor)

    return _changed(here, context, job_id, change)


@router.post("/excuse")
def excuse(
    here: Instructing, context: Context, job_id: str, criterion: Criterion, reason: Reason = "", seen: Seen = None
) -> Response:
    """Let a criterion not count, unless somebody else changed it since the form was shown."""

    def change(session: Session) -> None:
        _check_seen(session, job_id, criterion, seen)
        overrides.excuse(session, job_id, criterion, reason, here.actor)

    return _changed(here, context, job_id, change)


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


def _check_seen(session: Session, job_id: str, criterion: str, seen: int | None) -> None:
    """Raises UsageError where marks were set meanwhile, in another tab or by somebody else."""
    for line in overrides.criterion_marks(session, job_id):
        now = line.override.id if line.override is not None else 0
        if line.criterion == criterion and seen is not None and now != seen:
            raise UsageError(f"the marks of {line.title} were changed meanwhile; load the page again to see them")


def _changed(here: InCourse, context: WebContext, job_id: str, change: Callable[[Session], object]) -> Response:
    """Make a change to a grade of the course, then show all of it again."""
    with context.store.transaction() as session:
        job_in(session, here.course_id, job_id)
        change(session)
    return RedirectResponse(f"/courses/{here.course_id}/grades/{job_id}/marking", 303)
