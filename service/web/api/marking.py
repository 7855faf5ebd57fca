"""What instructors set by hand, comments, and second looks: what students ask again, and the answers."""

from __future__ import annotations

from datetime import datetime
from decimal import Decimal
from typing import Annotated

from fastapi import Depends, Path, Query
from pydantic import BaseModel, Field
from sqlalchemy.orm import Session

from service.store.courses.hidden_names import hidden_names_of
from service.store.grades import appeals, comments, marking_history, overrides
from service.store.grades.appeals import LONGEST_TEXT
from service.store.grades.comments import LONGEST_COMMENT
from service.store.grades.overrides import LONGEST_REASON
from service.store.models import Job
from service.store.states import JobState, Role
from service.web.access import RowName, RowNumber, job_in, nothing_here, own_submission
from service.web.api.shapes import Shape, like
from service.web.api_access import CallerInCourse, in_course
from service.web.api_routes import Listed, api_router
from service.web.context import Context, WebContext

router = api_router("marking")
Reads = Annotated[CallerInCourse, Depends(in_course(Role.INSTRUCTOR, "read"))]
Marks = Annotated[CallerInCourse, Depends(in_course(Role.INSTRUCTOR, "mark"))]
StudentReads = Annotated[CallerInCourse, Depends(in_course(Role.STUDENT, "read"))]
StudentSubmits = Annotated[CallerInCourse, Depends(in_course(Role.STUDENT, "submit"))]
CriterionId = Annotated[str, Path(min_length=1, max_length=200)]


def _owning(here: StudentSubmits, context: Context, submission_id: RowNumber) -> CallerInCourse:
    with context.store.reading() as session:
        own_submission(session, here.caller.identity, here.course_id, submission_id)
    return here


#: Known before a body is read, so that nobody else is told what is wrong with theirs.
Owns = Annotated[CallerInCourse, Depends(_owning)]
GRADE = "/courses/{course_id}/grades/{job_id}"


class OverrideShape(Shape):
    """What holds in place of the grader's marks; null for marks excuses the criterion."""

    marks: float | None
    reason: str
    actor: str
    made_at: datetime


class CriterionMarksShape(Shape):
    """One criterion: as graded, and as it counts."""

    criterion: str
    title: str
    graded: float | None = Field(description="Null where it could not be judged.")
    worth: float = Field(description="The most that the assignment gives.")
    marks: float
    max_marks: float
    override: OverrideShape | None


class CommentShape(Shape):
    """What an instructor wrote to the student."""

    id: int
    criterion: str = Field(description="Empty: for all of the submission.")
    text: str
    actor: str
    made_at: datetime


class MarkingStepShape(Shape):
    """One thing that somebody did by hand; empty is what does not apply."""

    at: datetime
    actor: str
    action: str
    criterion: str
    before: str
    after: str
    text: str = Field(description="A reason, a comment, an answer.")


class MarkingShape(Shape):
    """The criteria of a grade as they count, the comments on it, and what was done by hand."""

    criteria: list[CriterionMarksShape]
    comments: list[CommentShape]
    history: list[MarkingStepShape]

    model_config = like(
        criteria=[
            {
                "criterion": "named",
                "title": "Names the shapes",
                "graded": 4,
                "worth": 6,
                "marks": 5,
                "max_marks": 6,
                "override": {
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


class MarksAsked(BaseModel):
    """Marks in place of the grader's, or none to excuse the criterion; students read the reason."""

    marks: Decimal | None = Field(ge=0, le=10_000, examples=[5])
    reason: str = Field(min_length=1, max_length=LONGEST_REASON, examples=["The last one is named."])


class CommentAsked(BaseModel):
    """What to write to the student."""

    criterion: str = Field("", max_length=200)
    text: str = Field(min_length=1, max_length=LONGEST_COMMENT, examples=["Well named!"])


class AppealShape(Shape):
    """One question for a second look, answered or open."""

    id: int
    submission_id: int
    who: str
    assignment: str
    title: str = Field(description="Of the assignment.")
    attempt: int
    job_id: str
    text: str
    asked_at: datetime
    answer: str | None
    answered_at: datetime | None

    model_config = like(
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


class TextAsked(BaseModel):
    """A question, or its answer."""

    text: str = Field(min_length=1, max_length=LONGEST_TEXT, examples=["Please look at the last shape again."])


@router.get(GRADE + "/marking")
def marking(here: Reads, context: Context, job_id: RowName) -> MarkingShape:
    """The criteria of a grade as graded and as they count, and the comments on it."""
    with context.store.reading() as session:
        job_in(session, here.course_id, job_id)
        return _marking(session, job_id)


@router.put(GRADE + "/marking/{criterion}")
def set_marks(
    here: Marks, context: Context, job_id: RowName, criterion: CriterionId, asked: MarksAsked
) -> MarkingShape:
    """Let a criterion of this submission have these marks from now on, or excuse it; a regrade changes neither."""
    with context.store.transaction() as session:
        _graded(session, here, job_id)
        if asked.marks is None:
            overrides.excuse(session, job_id, criterion, asked.reason, here.actor)
        else:
            overrides.set_marks(session, job_id, criterion, asked.marks, asked.reason, here.actor)
        return _marking(session, job_id)


@router.delete(GRADE + "/marking/{criterion}")
def withdraw(here: Marks, context: Context, job_id: RowName, criterion: CriterionId) -> MarkingShape:
    """Let the grader's marks of a criterion count again."""
    with context.store.transaction() as session:
        _graded(session, here, job_id)
        overrides.withdraw(session, job_id, criterion, here.actor)
        return _marking(session, job_id)


@router.post(GRADE + "/comments", status_code=201)
def comment(here: Marks, context: Context, job_id: RowName, asked: CommentAsked) -> MarkingShape:
    """Write a comment to the student."""
    with context.store.transaction() as session:
        _graded(session, here, job_id)
        comments.comment(session, job_id, asked.criterion, asked.text, here.actor)
        return _marking(session, job_id)


@router.delete(GRADE + "/comments/{comment_id}")
def uncomment(here: Marks, context: Context, job_id: RowName, comment_id: RowNumber) -> MarkingShape:
    """Show a comment to nobody any more."""
    with context.store.transaction() as session:
        _graded(session, here, job_id)
        comments.withdraw(session, job_id, comment_id, here.actor)
        return _marking(session, job_id)


@router.get("/courses/{course_id}/appeals")
def list_appeals(
    here: Reads,
    context: Context,
    answered: Annotated[bool, Query(description="Those with an answer, the newest first; else the open ones.")] = False,
) -> Listed[AppealShape]:
    """What students ask again: the open ones, the longest waiting first, or the newest answered ones."""
    hidden = hidden_names_of(context.store, here.course_id)
    with context.store.reading() as session:
        found = appeals.in_course(session, here.course_id, hidden, answered=answered)
    return Listed(items=[AppealShape.model_validate(each) for each in found])


@router.post("/courses/{course_id}/appeals/{appeal_id}/answer", status_code=204)
def answer(here: Marks, context: Context, appeal_id: RowNumber, asked: TextAsked) -> None:
    """Answer an open one, which closes it."""
    with context.store.transaction() as session:
        appeals.answer(session, here.course_id, appeal_id, asked.text, here.actor)


@router.get("/courses/{course_id}/mine/submissions/{submission_id}/appeals")
def own_appeals(here: StudentReads, context: Context, submission_id: RowNumber) -> Listed[AppealShape]:
    """What the token's owner asked of a submission, and the answers, the newest first."""
    return _own(context, here, submission_id)


@router.post("/courses/{course_id}/mine/submissions/{submission_id}/appeals", status_code=201)
def ask(here: Owns, context: Context, submission_id: RowNumber, asked: TextAsked) -> Listed[AppealShape]:
    """Ask for a second look at a grade."""
    with context.store.transaction() as session:
        appeals.ask(session, submission_id, asked.text)
    return _own(context, here, submission_id)


def _own(context: WebContext, here: CallerInCourse, submission_id: int) -> Listed[AppealShape]:
    with context.store.reading() as session:
        row = own_submission(session, here.caller.identity, here.course_id, submission_id)
        return Listed(items=[AppealShape.model_validate(each) for each in appeals.of_submission(session, row.id)])


def _graded(session: Session, here: CallerInCourse, job_id: str) -> None:
    if job_in(session, here.course_id, job_id).state is not JobState.DONE:
        raise nothing_here()


def _marking(session: Session, job_id: str) -> MarkingShape:
    steps = marking_history.history(session, session.get_one(Job, job_id).submission_id)
    return MarkingShape(
        criteria=[CriterionMarksShape.model_validate(each) for each in overrides.criterion_marks(session, job_id)],
        comments=[CommentShape.model_validate(each) for each in comments.of_job(session, job_id)],
        history=[MarkingStepShape.model_validate(each) for each in steps],
    )
