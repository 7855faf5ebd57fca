"""When and how often students may submit: a course's policy, a student's extensions, and what follows from them.

What is over a limit is kept and marked all the same, but shown to staff alone; nothing here refuses a submission.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Literal

from sqlalchemy import ColumnElement, delete, func, or_, select
from sqlalchemy.exc import NoResultFound
from sqlalchemy.orm import Session

from service.store.courses.local_days import add_days, days_after, local_zone
from service.store.engine import now
from service.store.inserting import insert_if_new
from service.store.models import Enrolment, Extension, Job, Policy, SubmissionRow
from service.store.states import JobState

_ALWAYS = frozenset({"visible"})
_AFTER_DUE_DATE = frozenset({"after_due_date"})
_WITH_PUBLICATION = _AFTER_DUE_DATE | {"after_published"}
_NOT_THE_STUDENTS = ("assignment_error", "host_error")


@dataclass(frozen=True, slots=True)
class PolicyLimits:
    """What one student may do. ``attempts`` counts different submissions; None is no limit, and no due date."""

    due_at: datetime | None = None
    late_days: int = 0
    attempts: int | None = None
    cool_down_seconds: float = 0.0
    zone: str = ""  # of the days that are counted; empty for this server's

    @property
    def closed_at(self) -> datetime | None:
        """After this moment a submission is over the limit."""
        return None if self.due_at is None else add_days(self.due_at, self.late_days, self.zone)

    def days_late(self, submitted_at: datetime) -> int:
        """How many days of the policy's zone a submission is late, the last one begun included."""
        return 0 if self.due_at is None else days_after(self.due_at, submitted_at, self.zone)


OverLimit = Literal["attempts", "date", "cool-down"]


@dataclass(frozen=True, slots=True)
class Exceeded:
    """A limit that a submission is over, and by how much: the attempt, the days late, or the minutes waited."""

    limit: OverLimit
    actual: int
    allowed: int

    def __str__(self) -> str:
        match self.limit:
            case "attempts":
                return f"attempt {self.actual}, allowed: {self.allowed}"
            case "date":
                return f"{in_days(self.actual)} late, allowed: {self.allowed}"
            case "cool-down":
                return f"submitted {self.actual} min after the one before, asked for: {self.allowed} min"


@dataclass(frozen=True, slots=True)
class Ruling:
    """How many days late a submission is, and the limit that it is over, if any."""

    days_late: int = 0
    over: Exceeded | None = None


def limits(session: Session, enrolment_id: int, assignment: str) -> PolicyLimits:
    """The policy for the assignment, else the course's, with what this student is allowed beyond it.

    Extensions for all assignments and for this one hold together: the latest due date, the larger number of attempts.
    """
    return limits_of_each(session, enrolment_id, [assignment])[assignment]


def limits_of_each(session: Session, enrolment_id: int, assignments: Collection[str]) -> dict[str, PolicyLimits]:
    """The same for several assignments, in as many statements."""
    course_id = select(Enrolment.course_id).where(Enrolment.id == enrolment_id).scalar_subquery()
    known = _known_policies(session, Policy.course_id == course_id, assignments)
    own = {assignment: policy for (_, assignment), policy in known.items()}
    of_student = (Extension.enrolment_id == enrolment_id, Extension.assignment.in_(("", *assignments)))
    extensions = session.scalars(select(Extension).where(*of_student)).all()
    return {
        each: _extended(
            own.get(each) or own.get("") or PolicyLimits(),
            [extension for extension in extensions if extension.assignment in ("", each)],
        )
        for each in assignments
    }


def _extended(policy: PolicyLimits, extensions: Sequence[Extension]) -> PolicyLimits:
    due_at, attempts = policy.due_at, policy.attempts
    if due_at is not None:
        due_at = max([due_at, *(each.due_at for each in extensions if each.due_at is not None)])
    if attempts is not None:
        attempts += max((each.more_attempts for each in extensions), default=0)
    return replace(policy, due_at=due_at, attempts=attempts)


def in_days(count: int) -> str:
    """A number of days in words."""
    return "1 day" if count == 1 else f"{count} days"


def rule(session: Session, enrolment_id: int, assignment: str, sha256: str, submitted_at: datetime | None) -> Ruling:
    """What the policy says of a submission that comes in now; a moment of submitting that nobody knows is in time."""
    allowed = limits(session, enrolment_id, assignment)
    counted = _counted(session, enrolment_id, [assignment]).get(assignment, {})
    earlier = [when for sha, when in counted.items() if sha != sha256]
    if allowed.attempts is not None and len(earlier) >= allowed.attempts:
        return Ruling(over=Exceeded("attempts", len(earlier) + 1, allowed.attempts))
    if submitted_at is None:
        return Ruling()
    days_late = allowed.days_late(submitted_at)
    if days_late > allowed.late_days:
        return Ruling(days_late, Exceeded("date", days_late, allowed.late_days))
    since = [submitted_at - when for when in earlier if when <= submitted_at]
    if since and min(since).total_seconds() < allowed.cool_down_seconds:
        minutes = math.floor(min(since).total_seconds() / 60)
        asked = math.ceil(allowed.cool_down_seconds / 60)
        return Ruling(days_late, Exceeded("cool-down", minutes, asked))
    return Ruling(days_late)


def attempts_made(session: Session, enrolment_id: int, assignments: Collection[str]) -> dict[str, int]:
    """How many of a student's submissions count as attempts until now, by assignment."""
    counted = _counted(session, enrolment_id, assignments)
    return {each: len(counted.get(each, {})) for each in assignments}


def released(session: Session, job_id: str) -> frozenset[str]:
    """Which visibilities a student may see of a grade now.

    ``after_due_date`` opens when nobody of the course may submit any more, extensions and late days included; all
    but ``hidden`` opens when the grade is published. Raises NoResultFound where the job is gone.
    """
    found = released_of_each(session, [job_id])
    if job_id not in found:
        raise NoResultFound
    return found[job_id]


def released_of_each(session: Session, job_ids: Collection[str]) -> dict[str, frozenset[str]]:
    """The same for several grades, in as many statements."""
    query = (
        select(Job.id, Job.published_at, Enrolment.course_id, SubmissionRow.assignment)
        .join(SubmissionRow, Job.submission_id == SubmissionRow.id)
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .where(Job.id.in_(job_ids))
    )
    rows = session.execute(query).all()
    closed = _closed_for_all(session, {(course_id, assignment) for *_, course_id, assignment in rows})
    return {
        job_id: _ALWAYS
        | (_WITH_PUBLICATION if published_at is not None else frozenset())
        | (_AFTER_DUE_DATE if (course_id, assignment) in closed else frozenset())
        for job_id, published_at, course_id, assignment in rows
    }


def set_policy(session: Session, course_id: int, assignment: str, allowed: PolicyLimits) -> None:
    """Make ``allowed`` the policy of a course for an assignment, or with an empty one for all that have none.

    Where it names no zone, its days are those of this server's zone, also should the server move to another.
    """
    insert_if_new(session, Policy, course_id=course_id, assignment=assignment)
    row = session.scalars(select(Policy).where(Policy.course_id == course_id, Policy.assignment == assignment)).one()
    row.due_at, row.late_days = allowed.due_at, allowed.late_days
    row.attempts, row.cool_down_seconds = allowed.attempts, allowed.cool_down_seconds
    row.zone = allowed.zone or local_zone()


def drop_policy(session: Session, course_id: int, assignment: str) -> None:
    """Let an assignment have what holds for all of the course, in place of a policy of its own."""
    session.execute(delete(Policy).where(Policy.course_id == course_id, Policy.assignment == assignment))


def policies(session: Session, course_id: int) -> dict[str, PolicyLimits]:
    """The policies of a course, by assignment."""
    rows = session.scalars(select(Policy).where(Policy.course_id == course_id).order_by(Policy.assignment))
    return {row.assignment: _limits(row) for row in rows}


def extend(session: Session, enrolment_id: int, assignment: str, due_at: datetime | None, more_attempts: int) -> None:
    """Allow one student so much beyond the policy; what was allowed before for the same assignment is replaced."""
    insert_if_new(session, Extension, enrolment_id=enrolment_id, assignment=assignment)
    same = (Extension.enrolment_id == enrolment_id, Extension.assignment == assignment)
    row = session.scalars(select(Extension).where(*same)).one()
    row.due_at, row.more_attempts = due_at, more_attempts


@dataclass(frozen=True, slots=True)
class ExtensionLine:
    """What one student is allowed beyond the policy; an empty ``assignment`` is every one."""

    enrolment_id: int
    student: str
    assignment: str
    due_at: datetime | None
    more_attempts: int


def extensions(session: Session, course_id: int) -> list[ExtensionLine]:
    """All of a course, by student."""
    query = (
        select(Extension, Enrolment.student)
        .join(Enrolment, Extension.enrolment_id == Enrolment.id)
        .where(Enrolment.course_id == course_id)
        .order_by(Enrolment.student, Extension.assignment)
    )
    return [
        ExtensionLine(row.enrolment_id, student, row.assignment, row.due_at, row.more_attempts)
        for row, student in session.execute(query)
    ]


def _known_policies(
    session: Session, of_course: ColumnElement[bool], assignments: Collection[str]
) -> dict[tuple[int, str], PolicyLimits]:
    """The policies for some assignments and those for all others, by course and assignment."""
    rows = session.scalars(select(Policy).where(of_course, Policy.assignment.in_(("", *assignments))))
    return {(row.course_id, row.assignment): _limits(row) for row in rows}


def _limits(row: Policy) -> PolicyLimits:
    return PolicyLimits(row.due_at, row.late_days, row.attempts, row.cool_down_seconds, row.zone)


def _closed_for_all(session: Session, which: Collection[tuple[int, str]]) -> set[tuple[int, str]]:
    """Those of some assignments of courses to which nobody may submit any more."""
    course_ids, assignments = {course_id for course_id, _ in which}, {assignment for _, assignment in which}
    known = _known_policies(session, Policy.course_id.in_(course_ids), assignments)
    extended = (
        select(Enrolment.course_id, Extension.assignment, func.max(Extension.due_at))
        .join(Enrolment, Extension.enrolment_id == Enrolment.id)
        .where(Enrolment.course_id.in_(course_ids), Extension.assignment.in_(("", *assignments)))
        .group_by(Enrolment.course_id, Extension.assignment)
    )
    latest = {(course_id, each): due_at for course_id, each, due_at in session.execute(extended) if due_at is not None}
    at = now(session)
    closed = set()
    for course_id, assignment in which:
        policy = known.get((course_id, assignment)) or known.get((course_id, ""))
        if policy is None or policy.due_at is None:
            continue
        later = [latest[course_id, each] for each in ("", assignment) if (course_id, each) in latest]
        closed_at = replace(policy, due_at=max([policy.due_at, *later])).closed_at
        if closed_at is not None and at > closed_at:
            closed.add((course_id, assignment))
    return closed


def _counted(session: Session, enrolment_id: int, assignments: Collection[str]) -> dict[str, dict[str, datetime]]:
    """When the different submissions came that count as attempts, by assignment and hash.

    They were begun, and not ended by a fault of ours.
    """
    submission = SubmissionRow
    counts = or_(Job.state == JobState.RUNNING, (Job.state == JobState.DONE) & Job.verdict.not_in(_NOT_THE_STUDENTS))
    came_at = func.coalesce(submission.submitted_at, submission.created_at)
    query = (
        select(submission.assignment, submission.sha256, came_at)
        .join(Job, Job.submission_id == submission.id)
        .where(
            submission.enrolment_id == enrolment_id,
            submission.assignment.in_(assignments),
            submission.staff_only.is_(None),
            counts,
        )
        .order_by(submission.attempt)
    )
    found: dict[str, dict[str, datetime]] = {}
    for assignment, sha256, when in session.execute(query):
        found.setdefault(assignment, {})[sha256] = when
    return found
