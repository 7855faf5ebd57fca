"""What instructors do with one grade: set marks by hand, excuse criteria, comment, publish it and grade it again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal

from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.operations.errors import Conflict
from service.operations.lookup import course_for, job_in, names_for
from service.store.batches import batches
from service.store.batches.batches import JobLine
from service.store.courses.hidden_names import HiddenNames
from service.store.engine import retry_conflicts
from service.store.grades import comments, marking_history, overrides
from service.store.grades.comments import LONGEST_COMMENT, CommentLine
from service.store.grades.marking_history import MarkingStep
from service.store.grades.overrides import LONGEST_REASON, CriterionMarks
from service.store.models import AssignmentVersion, Job
from service.store.states import JobState, Role

__all__ = ["LONGEST_COMMENT", "LONGEST_REASON"]


@dataclass(frozen=True, slots=True)
class MarksRequest:
    """Marks for a criterion in place of the grader's; None excuses the criterion.

    ``seen`` is the id of the override that the actor has looked at, 0 for none. None means that they looked at nothing,
    so that the change is made whatever there is.
    """

    criterion: str
    marks: Decimal | str | None
    reason: str
    seen: int | None = None


@dataclass(frozen=True, slots=True)
class CommentRequest:
    """A comment for the student; an empty ``criterion`` is for all of the submission."""

    text: str
    criterion: str = ""


@dataclass(frozen=True, slots=True)
class Marking:
    """The criteria of a grade as they count, the comments on it, and what was done by hand."""

    line: JobLine
    title: str  # of the assignment
    criteria: list[CriterionMarks]
    comments: list[CommentLine]
    history: list[MarkingStep]


def show_marking(service: Service, actor: Actor, course_id: int, job_id: str) -> Marking:
    """What was set by hand and written for a grade, and what the grader gave. Raises NotFound."""
    hidden = names_for(service, actor, course_id)
    with service.store.reading() as session:
        _grade(session, actor, course_id, job_id)
        return _marking(session, job_id, hidden)


def set_marks(service: Service, actor: Actor, course_id: int, job_id: str, request: MarksRequest) -> Marking:
    """Set the marks of a criterion, or excuse it, for this submission and all its grades.

    Raises:
        NotFound: there is no such grade for the actor.
        Conflict: the submission has no grade, or the marks were changed after the actor saw them.
        UsageError: there is no such criterion, the marks are out of its range, or there is no reason.
    """
    wanted = overrides.read_marks(request.marks) if isinstance(request.marks, str) else request.marks

    def change(session: Session) -> None:
        asked = (session, job_id, request.criterion)
        if wanted is None:
            overrides.excuse(*asked, request.reason, actor.name, seen=request.seen)
        else:
            overrides.set_marks(*asked, wanted, request.reason, actor.name, seen=request.seen)

    return _change_marks(service, actor, course_id, job_id, change)


def withdraw(
    service: Service, actor: Actor, course_id: int, job_id: str, criterion: str, seen: int | None = None
) -> Marking:
    """Let the grader's marks of a criterion count again; ``seen`` as in ``MarksRequest``.

    Raises:
        NotFound: there is no such grade for the actor.
        Conflict: the submission has no grade, or the marks were changed after the actor saw them.
        UsageError: nothing was set by hand for the criterion.
    """

    def change(session: Session) -> None:
        overrides.withdraw(session, job_id, criterion, actor.name, seen=seen)

    return _change_marks(service, actor, course_id, job_id, change)


def comment(service: Service, actor: Actor, course_id: int, job_id: str, request: CommentRequest) -> Marking:
    """Write a comment for the student.

    Raises NotFound, and UsageError for a criterion that the grade does not have, or a text that is empty or too long.
    """

    def change(session: Session) -> None:
        comments.comment(session, job_id, request.criterion, request.text, actor.name)

    return _change(service, actor, course_id, job_id, change)


def withdraw_comment(service: Service, actor: Actor, course_id: int, job_id: str, comment_id: int) -> Marking:
    """Show a comment to nobody any more. Raises NotFound, and UsageError where the submission has no such comment."""
    return _change(
        service, actor, course_id, job_id, lambda session: comments.withdraw(session, job_id, comment_id, actor.name)
    )


def _grade(session: Session, actor: Actor, course_id: int, job_id: str) -> Job:
    course_for(session, actor, course_id, Role.INSTRUCTOR)
    return job_in(session, course_id, job_id)


def _change_marks(
    service: Service, actor: Actor, course_id: int, job_id: str, change: Callable[[Session], None]
) -> Marking:
    def change_grade(session: Session) -> None:
        if session.get_one(Job, job_id).state is not JobState.DONE:
            raise Conflict("%(job)s has no grade", job=job_id)
        try:
            change(session)
        except overrides.MarksChanged as error:
            raise Conflict(error.said) from None

    return _change(service, actor, course_id, job_id, change_grade)


@retry_conflicts
def _change(service: Service, actor: Actor, course_id: int, job_id: str, change: Callable[[Session], None]) -> Marking:
    hidden = names_for(service, actor, course_id)
    with service.store.transaction() as session:
        _grade(session, actor, course_id, job_id)
        change(session)
        return _marking(session, job_id, hidden)


def _marking(session: Session, job_id: str, hidden: HiddenNames) -> Marking:
    row = session.get_one(Job, job_id)
    return Marking(
        batches.job_line(session, job_id).hidden_by(hidden),
        session.get_one(AssignmentVersion, row.assignment_version_id).title,
        overrides.criterion_marks(session, job_id),
        comments.of_job(session, job_id),
        marking_history.history(session, row.submission_id),
    )
