"""Appeals: students appeal grades, and instructors answer."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.operations.lookup import course_for, names_for, own_submission
from service.store.courses import open_assignments
from service.store.engine import retry_conflicts
from service.store.grades import appeals
from service.store.grades.appeals import LONGEST_TEXT, AppealLine
from service.store.models import SubmissionRow
from service.store.states import Role

__all__ = ["LONGEST_TEXT"]


@dataclass(frozen=True, slots=True)
class OwnAppeals:
    """The appeals of one submission, newest first, as its student sees them."""

    submission_id: int
    assignment: str
    title: str  # of the assignment
    attempt: int
    appeals: list[AppealLine]
    may_appeal: bool


def list_open(
    service: Service, actor: Actor, course_id: int, *, limit: int | None = None, after: int | None = None
) -> list[AppealLine]:
    """Return the open appeals of a course, oldest first. Raises NotFound.

    ``after`` is the id of the last appeal on the previous page.
    """
    hidden = names_for(service, actor, course_id)
    with service.store.reading() as session:
        course_for(session, actor, course_id, Role.INSTRUCTOR)
        return appeals.open_in_course(session, course_id, hidden, limit=limit, after=after)


def list_answered(
    service: Service,
    actor: Actor,
    course_id: int,
    *,
    limit: int | None = None,
    after: tuple[datetime, int] | None = None,
) -> list[AppealLine]:
    """Return the answered appeals of a course, newest answer first. Raises NotFound.

    ``after`` is the answer time and id of the last appeal on the previous page.
    """
    hidden = names_for(service, actor, course_id)
    with service.store.reading() as session:
        course_for(session, actor, course_id, Role.INSTRUCTOR)
        return appeals.answered_in_course(session, course_id, hidden, limit=limit, after=after)


@retry_conflicts
def answer(service: Service, actor: Actor, course_id: int, appeal_id: int, text: str) -> None:
    """Answer and close an open appeal.

    Raises NotFound if the actor does not instruct the course. Raises UsageError if the appeal does not exist or is
    answered, or the text is empty or too long.
    """
    with service.store.transaction() as session:
        course_for(session, actor, course_id, Role.INSTRUCTOR)
        appeals.answer(session, course_id, appeal_id, text, actor.name)


def show_own(service: Service, actor: Actor, course_id: int, submission_id: int) -> OwnAppeals:
    """Return the appeals of a submission of the actor, with their permission to appeal now. Raises NotFound."""
    with service.store.reading() as session:
        row = _own(session, actor, course_id, submission_id)
        earlier = appeals.of_submission(session, submission_id)
        may = appeals.may_appeal(session, submission_id) and all(each.answered_at is not None for each in earlier)
        titles = {each.assignment: each.title for each in open_assignments.of_course(session, course_id)}
    return OwnAppeals(row.id, row.assignment, titles.get(row.assignment, row.assignment), row.attempt, earlier, may)


@retry_conflicts
def ask(service: Service, actor: Actor, course_id: int, submission_id: int, text: str) -> None:
    """Appeal against the grade of a submission of the actor.

    Raises NotFound. Raises UsageError if the actor may not see a grade, an appeal is open, or the text is empty or too
    long.
    """
    with service.store.transaction() as session:
        _own(session, actor, course_id, submission_id)
        appeals.ask(session, submission_id, text)


def _own(session: Session, actor: Actor, course_id: int, submission_id: int) -> SubmissionRow:
    course_for(session, actor, course_id, Role.STUDENT)
    return own_submission(session, actor, course_id, submission_id)
