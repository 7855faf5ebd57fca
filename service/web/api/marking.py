"""API of marking: adjusted marks, comments, appeals and their answers."""

from __future__ import annotations

from datetime import datetime
from decimal import Decimal
from typing import Annotated

from fastapi import Depends, Path, Query
from pydantic import BaseModel, BeforeValidator, Field

from service.operations import appeals, grades
from service.operations.appeals import MAX_TEXT_LENGTH
from service.operations.grades import MAX_COMMENT_LENGTH, MAX_REASON_LENGTH, CommentRequest, MarksRequest
from service.operations.types import Role
from service.web.access import HIGHEST_NUMBER, RowName, RowNumber
from service.web.api.shapes import Shape, build_example_config
from service.web.api_access import CallerInCourse, require_role
from service.web.api_routes import After, Limit, Listed, api_router, build_list_page, decode_cursor
from service.web.context import Context, WebContext
from sim.errors import UsageError

router = api_router("marking")
ReadAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "read"))]
MarkAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "mark"))]
StudentReadAccess = Annotated[CallerInCourse, Depends(require_role(Role.STUDENT, "read"))]
StudentSubmitAccess = Annotated[CallerInCourse, Depends(require_role(Role.STUDENT, "submit"))]
CriterionId = Annotated[str, Path(min_length=1, max_length=200)]
_SEEN_DESCRIPTION = "ID of the last override that you read, 0 for none. If it has changed since, the response is 409."


def _require_owner(access: StudentSubmitAccess, context: Context, submission_id: RowNumber) -> CallerInCourse:
    appeals.show_own(context.service, access.actor, access.course_id, submission_id)
    return access


#: Checked before the body is read, so that only the submission's owner gets errors about the body.
OwnerAccess = Annotated[CallerInCourse, Depends(_require_owner)]
GRADE_PATH = "/courses/{course_id}/grades/{job_id}"


class OverrideShape(Shape):
    """Marks that replace the grader's marks; null excuses the criterion."""

    id: int = Field(description="Send it as `seen` with the next change, to detect changes by others.")
    marks: float | None
    reason: str
    actor: str
    made_at: datetime


class CriterionMarksShape(Shape):
    """Marks of one criterion: by the grader, and in effect after adjustments."""

    criterion: str
    title: str
    graded: float | None = Field(description="Marks by the grader; null if the criterion could not be judged.")
    worth: float = Field(description="Maximum marks in the assignment.")
    marks: float
    max_marks: float
    override: OverrideShape | None


class CommentShape(Shape):
    """A comment of an instructor to the student."""

    id: int
    criterion: str = Field(description="Empty for the whole submission.")
    text: str
    actor: str
    made_at: datetime


class MarkingStepShape(Shape):
    """One manual change of marks or comments. Fields that don't apply are empty."""

    at: datetime
    actor: str
    action: str
    criterion: str
    before: str
    after: str
    text: str = Field(description="Reason, comment or answer.")


class MarkingShape(Shape):
    """Criteria of a grade with the marks in effect, comments, and the history of manual changes."""

    criteria: list[CriterionMarksShape]
    comments: list[CommentShape]
    history: list[MarkingStepShape]

    model_config = build_example_config(
        criteria=[
            {
                "criterion": "named",
                "title": "Names the shapes",
                "graded": 4,
                "worth": 6,
                "marks": 5,
                "max_marks": 6,
                "override": {
                    "id": 1,
                    "marks": 5,
                    "reason": "The last one is named, with a slip of the pen.",
                    "actor": "Grace Hopper (person 2)",
                    "made_at": "2026-11-03T09:00:00Z",
                },
            }
        ],
        comments=[],
        history=[],
    )


def _read_marks(value: object) -> object:
    """Return marks sent as a text as the pages and commands read them."""
    try:
        return grades.parse_marks(value) if isinstance(value, str) else value
    except UsageError as error:
        raise ValueError(str(error)) from None


class MarksBody(BaseModel):
    """Marks that replace the grader's marks (null excuses the criterion), and a reason that students can read."""

    marks: Annotated[Decimal | None, BeforeValidator(_read_marks)] = Field(ge=0, le=10_000, examples=[5])
    reason: str = Field(min_length=1, max_length=MAX_REASON_LENGTH, examples=["The last one is named."])
    seen: int | None = Field(None, ge=0, le=HIGHEST_NUMBER, description=_SEEN_DESCRIPTION)


class CommentBody(BaseModel):
    """A comment to the student."""

    criterion: str = Field("", max_length=200)
    text: str = Field(min_length=1, max_length=MAX_COMMENT_LENGTH, examples=["Well named!"])


class AppealShape(Shape):
    """An appeal, answered or open."""

    id: int
    submission_id: int
    who: str
    assignment: str
    title: str = Field(description="Title of the assignment.")
    attempt: int
    job_id: str
    text: str
    asked_at: datetime
    answer: str | None
    answered_at: datetime | None

    model_config = build_example_config(
        id=1,
        submission_id=3,
        who="ada",
        assignment="shape-recognition",
        title="Recognise a shape",
        attempt=1,
        job_id="7xk2v9q4m0ab",
        text="The last shape was named, was it not?",
        asked_at="2026-11-03T08:00:00Z",
        answer=None,
        answered_at=None,
    )


class TextBody(BaseModel):
    """Text of an appeal, or of its answer."""

    text: str = Field(min_length=1, max_length=MAX_TEXT_LENGTH, examples=["Please look at the last shape again."])


@router.get(GRADE_PATH + "/marking")
def marking(access: ReadAccess, context: Context, job_id: RowName) -> MarkingShape:
    """Return the marks of a grade before and after adjustments, and the comments on it."""
    return MarkingShape.model_validate(grades.show_marking(context.service, access.actor, access.course_id, job_id))


@router.put(GRADE_PATH + "/marking/{criterion}")
def set_marks(
    access: MarkAccess, context: Context, job_id: RowName, criterion: CriterionId, body: MarksBody
) -> MarkingShape:
    """Adjust the marks of a criterion of this submission, or excuse it. Regrades keep the adjustment."""
    marks_request = MarksRequest(criterion, body.marks, body.reason, body.seen)
    return MarkingShape.model_validate(
        grades.set_marks(context.service, access.actor, access.course_id, job_id, marks_request)
    )


@router.delete(GRADE_PATH + "/marking/{criterion}")
def withdraw(
    access: MarkAccess,
    context: Context,
    job_id: RowName,
    criterion: CriterionId,
    seen: Annotated[int | None, Query(ge=0, le=HIGHEST_NUMBER, description=_SEEN_DESCRIPTION)] = None,
) -> MarkingShape:
    """Remove the adjustment of a criterion. The grader's marks apply again."""
    marking_view = grades.withdraw_override(context.service, access.actor, access.course_id, job_id, criterion, seen)
    return MarkingShape.model_validate(marking_view)


@router.post(GRADE_PATH + "/comments", status_code=201)
def comment(access: MarkAccess, context: Context, job_id: RowName, body: CommentBody) -> MarkingShape:
    """Add a comment to the student."""
    comment_request = CommentRequest(body.text, body.criterion)
    return MarkingShape.model_validate(
        grades.add_comment(context.service, access.actor, access.course_id, job_id, comment_request)
    )


@router.delete(GRADE_PATH + "/comments/{comment_id}")
def uncomment(access: MarkAccess, context: Context, job_id: RowName, comment_id: RowNumber) -> MarkingShape:
    """Remove a comment."""
    marking_view = grades.withdraw_comment(context.service, access.actor, access.course_id, job_id, comment_id)
    return MarkingShape.model_validate(marking_view)


@router.get("/courses/{course_id}/appeals")
def list_appeals(
    access: ReadAccess,
    context: Context,
    answered: Annotated[
        bool, Query(description="Return answered appeals, newest first; otherwise open appeals.")
    ] = False,
    limit: Limit = 100,
    after: After = "",
) -> Listed[AppealShape]:
    """List appeals: the open ones, oldest first, or the answered ones, newest first."""
    course_key = (context.service, access.actor, access.course_id)
    if answered:
        cursor = decode_cursor(after, datetime, int)
        lines = appeals.list_answered(*course_key, limit=limit + 1, cursor=cursor)
        page = build_list_page(lines, limit, lambda each: [each.answered_at or each.asked_at, each.id])
    else:
        sort_key = decode_cursor(after, int)
        lines = appeals.list_open(*course_key, limit=limit + 1, last_id=None if sort_key is None else sort_key[0])
        page = build_list_page(lines, limit, lambda each: [each.id])
    return Listed(items=[AppealShape.model_validate(each) for each in page.items], next=page.next)


@router.post("/courses/{course_id}/appeals/{appeal_id}/answer", status_code=204)
def answer(access: MarkAccess, context: Context, appeal_id: RowNumber, body: TextBody) -> None:
    """Answer an open appeal and close it."""
    appeals.answer(context.service, access.actor, access.course_id, appeal_id, body.text)


@router.get("/courses/{course_id}/mine/submissions/{submission_id}/appeals")
def own_appeals(access: StudentReadAccess, context: Context, submission_id: RowNumber) -> Listed[AppealShape]:
    """List the appeals of the token's owner for a submission, with answers, newest first."""
    return _list_own_appeals(context, access, submission_id)


@router.post("/courses/{course_id}/mine/submissions/{submission_id}/appeals", status_code=201)
def ask(access: OwnerAccess, context: Context, submission_id: RowNumber, body: TextBody) -> Listed[AppealShape]:
    """Appeal a grade."""
    appeals.submit(context.service, access.actor, access.course_id, submission_id, body.text)
    return _list_own_appeals(context, access, submission_id)


@router.post("/courses/{course_id}/mine/submissions/{submission_id}/all-trials", status_code=204)
def run_all_trials(access: OwnerAccess, context: Context, submission_id: RowNumber) -> None:
    """Run all trials of a grade with provisional marks now, so that its marks become exact."""
    appeals.run_all_trials(context.service, access.actor, access.course_id, submission_id)


def _list_own_appeals(context: WebContext, access: CallerInCourse, submission_id: int) -> Listed[AppealShape]:
    appeals_view = appeals.show_own(context.service, access.actor, access.course_id, submission_id)
    return Listed(items=[AppealShape.model_validate(each) for each in appeals_view.appeals])
