"""Changes to one grade by staff: override marks, excuse criteria and comment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal

from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.operations.errors import Conflict
from service.operations.lookup import load_names_for_actor, require_course, require_job
from service.store.batches import job_lines
from service.store.batches.job_lines import JobLine
from service.store.courses.hidden_names import HiddenNames
from service.store.engine import retry_conflicts
from service.store.grades import comments, marking_history, overrides, statements
from service.store.grades.comments import MAX_COMMENT_LENGTH, CommentLine
from service.store.grades.marking_history import MarkingStep
from service.store.grades.overrides import MAX_REASON_LENGTH, CriterionMarks, parse_marks
from service.store.states import JobState, Role
from service.store.tables.courses import AssignmentVersion
from service.store.tables.submissions import Job

__all__ = ["MAX_COMMENT_LENGTH", "MAX_REASON_LENGTH", "parse_marks"]


@dataclass(frozen=True, slots=True)
class MarksRequest:
    """Marks that override the grader's for a criterion; None excuses the criterion.

    ``seen`` is the id of the override that the actor last read, 0 for none. None skips this check.
    """

    criterion: str
    marks: Decimal | str | None
    reason: str
    seen: int | None = None


@dataclass(frozen=True, slots=True)
class CommentRequest:
    """A comment for the student; an empty ``criterion`` refers to the whole submission."""

    text: str
    criterion: str = ""


@dataclass(frozen=True, slots=True)
class Marking:
    """The effective criteria of a grade, its comments, and the history of changes by staff."""

    line: JobLine
    title: str  # of the assignment
    criteria: list[CriterionMarks]
    comments: list[CommentLine]
    history: list[MarkingStep]


def show_marking(service: Service, actor: Actor, course_id: int, job_id: str) -> Marking:
    """Return the overrides and comments of a grade, with the grader's own marks. Raises NotFound."""
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        _require_course_job(session, actor, course_id, job_id)
        return _load_marking(session, job_id, hidden_names)


def set_marks(service: Service, actor: Actor, course_id: int, job_id: str, request: MarksRequest) -> Marking:
    """Override the marks of a criterion, or excuse it, for this submission and all its grades.

    Raises:
        NotFound: The grade does not exist for the actor.
        Conflict: The submission is not graded, or the marks changed after the actor read them.
        UsageError: The criterion is unknown, the marks are out of range, or the reason is missing.
    """
    new_marks = parse_marks(request.marks) if isinstance(request.marks, str) else request.marks

    def change(session: Session) -> None:
        criterion_key = (session, job_id, request.criterion)
        if new_marks is None:
            overrides.excuse_criterion(*criterion_key, request.reason, actor.name, expected_override=request.seen)
        else:
            overrides.set_marks(*criterion_key, new_marks, request.reason, actor.name, expected_override=request.seen)

    return _change_marks(service, actor, course_id, job_id, change)


def withdraw_override(
    service: Service, actor: Actor, course_id: int, job_id: str, criterion: str, expected_override: int | None = None
) -> Marking:
    """Restore the grader's marks of a criterion; ``expected_override`` as in ``MarksRequest``.

    Raises:
        NotFound: The grade does not exist for the actor.
        Conflict: The submission is not graded, or the marks changed after the actor read them.
        UsageError: The criterion has no override.
    """

    def change(session: Session) -> None:
        overrides.withdraw_override(session, job_id, criterion, actor.name, expected_override=expected_override)

    return _change_marks(service, actor, course_id, job_id, change)


def add_comment(service: Service, actor: Actor, course_id: int, job_id: str, request: CommentRequest) -> Marking:
    """Add a comment for the student.

    Raises NotFound, and UsageError for an unknown criterion, or a text that is empty or too long.
    """

    def change(session: Session) -> None:
        comments.add_comment(session, job_id, request.criterion, request.text, actor.name)

    return _apply_change(service, actor, course_id, job_id, change)


def withdraw_comment(service: Service, actor: Actor, course_id: int, job_id: str, comment_id: int) -> Marking:
    """Withdraw a comment. Raises NotFound, and UsageError if the submission does not have it."""
    return _apply_change(
        service,
        actor,
        course_id,
        job_id,
        lambda session: comments.withdraw_comment(session, job_id, comment_id, actor.name),
    )


def _require_course_job(session: Session, actor: Actor, course_id: int, job_id: str) -> Job:
    require_course(session, actor, course_id, Role.INSTRUCTOR)
    return require_job(session, course_id, job_id)


def _change_marks(
    service: Service, actor: Actor, course_id: int, job_id: str, change: Callable[[Session], None]
) -> Marking:
    def change_grade(session: Session) -> None:
        job = session.get_one(Job, job_id)
        if job.state is not JobState.DONE:
            raise Conflict("%(job)s has no grade", job=job_id)
        try:
            change(session)
        except overrides.MarksChanged as error:
            raise Conflict(error.message) from None
        statements.state_change(session, job.submission_id)

    return _apply_change(service, actor, course_id, job_id, change_grade)


@retry_conflicts
def _apply_change(
    service: Service, actor: Actor, course_id: int, job_id: str, change: Callable[[Session], None]
) -> Marking:
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.transaction() as session:
        _require_course_job(session, actor, course_id, job_id)
        change(session)
        return _load_marking(session, job_id, hidden_names)


def _load_marking(session: Session, job_id: str, hidden_names: HiddenNames) -> Marking:
    row = session.get_one(Job, job_id)
    return Marking(
        job_lines.load_job_line(session, job_id).hide_name(hidden_names),
        session.get_one(AssignmentVersion, row.assignment_version_id).title,
        overrides.load_criterion_marks(session, job_id),
        comments.load_comments(session, job_id),
        marking_history.load_history(session, row.submission_id),
    )
