"""Appeals: a student asks for a second look at a grade, and an instructor answers."""

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
    """The appeals of one submission as its student sees them, the newest first."""

    submission_id: int
    assignment: str
    title: str  # of the assignment
    attempt: int
    appeals: list[AppealLine]
    may_appeal: bool


def list_open(
    service: Service, actor: Actor, course_id: int, *, limit: int | None = None, after: int | None = None
) -> list[AppealLine]:
    """The appeals of a course that wait for an answer, the longest waiting first. Raises NotFound.

    ``after`` is the id of the last appeal of the page before.
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
    """The answered appeals of a course, the newest answer first. Raises NotFound.

    ``after`` is when the last appeal of the page before was answered, and its id.
    """
    hidden = names_for(service, actor, course_id)
    with service.store.reading() as session:
        course_for(session, actor, course_id, Role.INSTRUCTOR)
        return appeals.answered_in_course(session, course_id, hidden, limit=limit, after=after)


@retry_conflicts
def answer(service: Service, actor: Actor, course_id: int, appeal_id: int, text: str) -> None:
    """Answer an open appeal, which closes it.

    Raises NotFound for a course that is not the actor's, and UsageError where there is no such appeal, it is answered,
    or the text is empty or too long.
    """
    with service.store.transaction() as session:
        course_for(session, actor, course_id, Role.INSTRUCTOR)
        appeals.answer(session, course_id, appeal_id, text, actor.name)


def show_own(service: Service, actor: Actor, course_id: int, submission_id: int) -> OwnAppeals:
    """The appeals of a submission of the actor's own, and whether they may appeal now. Raises NotFound."""
    with service.store.reading() as session:
        row = _own(session, actor, course_id, submission_id)
        earlier = appeals.of_submission(session, submission_id)
        may = appeals.may_appeal(session, submission_id) and all(each.answered_at is not None for each in earlier)
        titles = {each.assignment: each.title for each in open_assignments.of_course(session, course_id)}
    return OwnAppeals(row.id, row.assignment, titles.get(row.assignment, row.assignment), row.attempt, earlier, may)


@retry_conflicts
def ask(service: Service, actor: Actor, course_id: int, submission_id: int, text: str) -> None:
    """Ask for a second look at the grade of a submission of the actor's own.

    Raises NotFound, and UsageError where there is no grade that they may see, an appeal is open, or the text is empty
    or too long.
    """
    with service.store.transaction() as session:
        _own(session, actor, course_id, submission_id)
        appeals.ask(session, submission_id, text)


def _own(session: Session, actor: Actor, course_id: int, submission_id: int) -> SubmissionRow:
    course_for(session, actor, course_id, Role.STUDENT)
    return own_submission(session, actor, course_id, submission_id)
