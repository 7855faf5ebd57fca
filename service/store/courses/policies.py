"""When and how often students may submit: a course's policy, a student's extensions, and what follows from them.

What is over a limit is kept and marked all the same, but shown to staff alone; nothing here refuses a submission.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Literal

from sqlalchemy import delete, func, or_, select
from sqlalchemy.orm import Session

from service.store.courses.local_days import add_days, days_after, local_zone
from service.store.engine import now
from service.store.inserting import insert_if_new
from service.store.models import Enrolment, Extension, Job, Policy, SubmissionRow
from service.store.states import JobState

_ALWAYS = frozenset({"visible"})
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


@dataclass(frozen=True, slots=True)
class Ruling:
    """How many days late a submission is, and the limit that it is over, as a sentence; empty if it is over none."""

    days_late: int = 0
    over: str = ""


OverLimit = Literal["attempts", "date", "cool-down"]


def limits(session: Session, enrolment_id: int, assignment: str) -> PolicyLimits:
    """The policy for the assignment, else the course's, with what this student is allowed beyond it.

    Extensions for all assignments and for this one hold together: the latest due date, the larger number of attempts.
    """
    course_id = session.scalar(select(Enrolment.course_id).where(Enrolment.id == enrolment_id))
    policy = _policy(session, course_id, assignment)
    query = select(Extension).where(Extension.enrolment_id == enrolment_id, Extension.assignment.in_(("", assignment)))
    extensions = session.scalars(query).all()
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
    earlier = _counted(session, enrolment_id, assignment, sha256)
    if allowed.attempts is not None and len(earlier) >= allowed.attempts:
        return Ruling(over=f"attempt {len(earlier) + 1}, allowed: {allowed.attempts}")
    if submitted_at is None:
        return Ruling()
    days_late = allowed.days_late(submitted_at)
    if days_late > allowed.late_days:
        return Ruling(days_late, f"{in_days(days_late)} late, allowed: {allowed.late_days}")
    since = [submitted_at - when for when in earlier if when <= submitted_at]
    if since and min(since).total_seconds() < allowed.cool_down_seconds:
        minutes = math.floor(min(since).total_seconds() / 60)
        asked = math.ceil(allowed.cool_down_seconds / 60)
        return Ruling(days_late, f"submitted {minutes} min after the one before, asked for: {asked} min")
    return Ruling(days_late)


def limit_of(over: str) -> OverLimit | None:
    """Which limit a ruling's sentence names."""
    if not over:
        return None
    if over.startswith("attempt "):
        return "attempts"
    return "cool-down" if over.startswith("submitted ") else "date"


def attempts_made(session: Session, enrolment_id: int, assignment: str) -> int:
    """How many of a student's submissions count as attempts until now."""
    return len(_counted(session, enrolment_id, assignment, ""))


def released(session: Session, job_id: str) -> frozenset[str]:
    """Which visibilities a student may see of a grade now.

    ``after_due_date`` opens when nobody of the course may submit any more, extensions and late days included; all
    but ``hidden`` opens when the grade is published.
    """
    job = session.get_one(Job, job_id)
    seen = set(_ALWAYS)
    if job.published_at is not None:
        seen |= {"after_published", "after_due_date"}
    assignment = session.get_one(SubmissionRow, job.submission_id).assignment
    closed_at = _closed_for_all(session, job.enrolment_id, assignment)
    if closed_at is not None and now(session) > closed_at:
        seen.add("after_due_date")
    return frozenset(seen)


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


def _policy(session: Session, course_id: int | None, assignment: str) -> PolicyLimits:
    """The policy of the assignment itself, else the course's."""
    query = select(Policy).where(Policy.course_id == course_id, Policy.assignment.in_(("", assignment)))
    row = session.scalar(query.order_by(func.length(Policy.assignment).desc()).limit(1))
    return PolicyLimits() if row is None else _limits(row)


def _limits(row: Policy) -> PolicyLimits:
    return PolicyLimits(row.due_at, row.late_days, row.attempts, row.cool_down_seconds, row.zone)


def _closed_for_all(session: Session, enrolment_id: int, assignment: str) -> datetime | None:
    course_id = session.scalar(select(Enrolment.course_id).where(Enrolment.id == enrolment_id))
    policy = _policy(session, course_id, assignment)
    if policy.due_at is None:
        return None
    latest = session.scalar(
        select(func.max(Extension.due_at))
        .join(Enrolment, Extension.enrolment_id == Enrolment.id)
        .where(Enrolment.course_id == course_id, Extension.assignment.in_(("", assignment)))
    )
    return replace(policy, due_at=policy.due_at if latest is None else max(policy.due_at, latest)).closed_at


def _counted(session: Session, enrolment_id: int, assignment: str, sha256: str) -> list[datetime]:
    """When the different submissions came that count as attempts: begun, and not ended by a fault of ours."""
    submission = SubmissionRow
    counts = or_(Job.state == JobState.RUNNING, (Job.state == JobState.DONE) & Job.verdict.not_in(_NOT_THE_STUDENTS))
    query = (
        select(func.coalesce(submission.submitted_at, submission.created_at), submission.sha256)
        .join(Job, Job.submission_id == submission.id)
        .where(
            submission.enrolment_id == enrolment_id,
            submission.assignment == assignment,
            submission.sha256 != sha256,
            submission.staff_only.is_(None),
            counts,
        )
        .order_by(submission.attempt)
    )
    return list({sha: when for when, sha in session.execute(query)}.values())
