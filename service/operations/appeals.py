"""Appeals: students appeal grades, and instructors answer."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.operations.lookup import load_names_for_actor, require_course, require_own_submission
from service.store import audit
from service.store.courses import open_assignments
from service.store.engine import now, retry_conflicts
from service.store.grades import appeals
from service.store.grades.appeals import MAX_TEXT_LENGTH, AppealLine
from service.store.queue import pool_progress
from service.store.queue.pool_progress import PoolProgress
from service.store.states import JobQueue, Role
from service.store.tables.submissions import SubmissionRow
from sim.errors import UsageError

__all__ = ["MAX_TEXT_LENGTH"]


@dataclass(frozen=True, slots=True)
class OwnAppeals:
    """The appeals of one submission, newest first, as its student sees them."""

    submission_id: int
    assignment: str
    title: str  # of the assignment
    attempt: int
    appeals: list[AppealLine]
    may_appeal: bool
    pool: PoolProgress | None  # None if the marks depend on no pool, or are not visible


def list_open(
    service: Service, actor: Actor, course_id: int, *, limit: int | None = None, last_id: int | None = None
) -> list[AppealLine]:
    """Return the open appeals of a course, oldest first. Raises NotFound.

    ``last_id`` is the id of the last appeal on the previous page.
    """
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        return appeals.list_open_appeals(session, course_id, hidden_names, limit=limit, last_id=last_id)


def list_answered(
    service: Service,
    actor: Actor,
    course_id: int,
    *,
    limit: int | None = None,
    cursor: tuple[datetime, int] | None = None,
) -> list[AppealLine]:
    """Return the answered appeals of a course, newest answer first. Raises NotFound.

    ``cursor`` is the answer time and id of the last appeal on the previous page.
    """
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        return appeals.list_answered_appeals(session, course_id, hidden_names, limit=limit, cursor=cursor)


@retry_conflicts
def answer(service: Service, actor: Actor, course_id: int, appeal_id: int, text: str) -> None:
    """Answer and close an open appeal.

    Raises NotFound if the actor does not instruct the course. Raises UsageError if the appeal does not exist or is
    answered, or the text is empty or too long.
    """
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        appeals.answer_appeal(session, course_id, appeal_id, text, actor.name)


def show_own(service: Service, actor: Actor, course_id: int, submission_id: int) -> OwnAppeals:
    """Return the appeals of a submission of the actor, with their permission to appeal now. Raises NotFound."""
    with service.store.reading() as session:
        row = _require_student_submission(session, actor, course_id, submission_id)
        is_visible = appeals.can_appeal(session, submission_id)
        earlier_appeals = appeals.load_appeals(session, submission_id)
        can_appeal = is_visible and all(each.answered_at is not None for each in earlier_appeals)
        pool = pool_progress.load_progress(session, submission_id) if is_visible else None
        titles = {each.assignment: each.title for each in open_assignments.list_assignments(session, course_id)}
    return OwnAppeals(
        row.id,
        row.assignment,
        titles.get(row.assignment, row.assignment),
        row.attempt,
        earlier_appeals,
        can_appeal,
        pool,
    )


@retry_conflicts
def submit(service: Service, actor: Actor, course_id: int, submission_id: int, text: str) -> None:
    """Appeal against the grade of a submission of the actor.

    Raises NotFound. Raises UsageError if the actor may not see a grade, an appeal is open, or the text is empty or too
    long.
    """
    with service.store.transaction() as session:
        _require_student_submission(session, actor, course_id, submission_id)
        appeals.open_appeal(session, submission_id, text)


def run_all_trials(service: Service, actor: Actor, course_id: int, submission_id: int) -> None:
    """Run all trials of the pools of a submission of the actor now, so that its provisional marks become exact.

    Raises NotFound. Raises UsageError if the marks are exact or not visible, or the actor waits for another such run.
    """
    _expedite(service, actor, course_id, submission_id)
    service.notifier.grade(JobQueue.INTERACTIVE)


@retry_conflicts
def _expedite(service: Service, actor: Actor, course_id: int, submission_id: int) -> None:
    with service.store.transaction() as session:
        row = _require_student_submission(session, actor, course_id, submission_id)
        if not appeals.can_appeal(session, submission_id):
            raise UsageError("you can appeal after your grade is visible")
        pool_progress.expedite(session, submission_id, row.enrolment_id, now(session))
        audit.record_action(session, actor.name, "run all trials", "submission", str(submission_id))


def _require_student_submission(session: Session, actor: Actor, course_id: int, submission_id: int) -> SubmissionRow:
    require_course(session, actor, course_id, Role.STUDENT)
    return require_own_submission(session, actor, course_id, submission_id)
