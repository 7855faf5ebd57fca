"""The page where instructors adjust marks, excuse criteria and write comments, with the activity log."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Form, Request
from fastapi.responses import RedirectResponse, Response

from service.operations import grade_views, grades
from service.operations.grades import MAX_COMMENT_LENGTH, MAX_REASON_LENGTH, CommentRequest, MarksRequest
from service.web.access import HIGHEST_NUMBER, CourseInstructor, ReaderInCourse, RowName, SentRowNumber
from service.web.context import Context
from service.web.rendering import render_page

router = APIRouter(prefix="/courses/{course_id}/grades/{job_id}/marking")
Criterion = Annotated[str, Form(max_length=200)]
Reason = Annotated[str, Form()]
#: Id of the criterion's override when the form was shown; 0 if there was none.
SeenOverrideId = Annotated[int | None, Form(ge=0, le=HIGHEST_NUMBER)]


@router.get("")
def show_marking(request: Request, access: CourseInstructor, context: Context, job_id: RowName) -> Response:
    """Show the criteria of a grade with their forms, the comments and the activity log."""
    marking = grades.show_marking(context.service, access.actor, access.course_id, job_id)
    return render_page(
        request,
        access.reader,
        "marking.html",
        access=access,
        marking=marking,
        neighbours=grade_views.show_neighbours(context.service, access.actor, access.course_id, job_id),
        longest_reason=MAX_REASON_LENGTH,
        longest_comment=MAX_COMMENT_LENGTH,
    )


@router.post("/set")
def set_marks(
    access: CourseInstructor,
    context: Context,
    job_id: RowName,
    criterion: Criterion,
    reason: Reason = "",
    marks: Annotated[str, Form(max_length=20)] = "",
    seen: SeenOverrideId = None,
) -> Response:
    """Set the marks of a criterion. Fails if another person changed them since the form was shown."""
    marks_request = MarksRequest(criterion, marks, reason, seen)
    grades.set_marks(context.service, access.actor, access.course_id, job_id, marks_request)
    return _redirect_to_marking(access, job_id)


@router.post("/excuse")
def excuse_criterion(
    access: CourseInstructor,
    context: Context,
    job_id: RowName,
    criterion: Criterion,
    reason: Reason = "",
    seen: SeenOverrideId = None,
) -> Response:
    """Excuse a criterion. Fails if another person changed it since the form was shown."""
    marks_request = MarksRequest(criterion, None, reason, seen)
    grades.set_marks(context.service, access.actor, access.course_id, job_id, marks_request)
    return _redirect_to_marking(access, job_id)


@router.post("/withdraw")
def withdraw_override(
    access: CourseInstructor, context: Context, job_id: RowName, criterion: Criterion, seen: SeenOverrideId = None
) -> Response:
    """Restore the grader's marks of a criterion. Fails if another person changed them since the form was shown."""
    grades.withdraw_override(context.service, access.actor, access.course_id, job_id, criterion, seen)
    return _redirect_to_marking(access, job_id)


@router.post("/comment")
def add_comment(
    access: CourseInstructor,
    context: Context,
    job_id: RowName,
    text: Annotated[str, Form()] = "",
    criterion: Criterion = "",
) -> Response:
    """Write a comment for the student."""
    grades.add_comment(context.service, access.actor, access.course_id, job_id, CommentRequest(text, criterion))
    return _redirect_to_marking(access, job_id)


@router.post("/uncomment")
def withdraw_comment(
    access: CourseInstructor, context: Context, job_id: RowName, comment_id: SentRowNumber
) -> Response:
    """Withdraw a comment."""
    grades.withdraw_comment(context.service, access.actor, access.course_id, job_id, comment_id)
    return _redirect_to_marking(access, job_id)


def _redirect_to_marking(access: ReaderInCourse, job_id: str) -> Response:
    return RedirectResponse(f"/courses/{access.course_id}/grades/{job_id}/marking", 303)
