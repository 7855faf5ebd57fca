"""When and how often students may submit: a course's policy, a student's extensions, and what follows from them.

What is over a limit is kept and marked all the same, but shown to staff alone; nothing here refuses a submission.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Literal

from sqlalchemy import delete, func, or_, select
from sqlalchemy.orm import Session

from service.store.engine import now
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

    @property
    def closed_at(self) -> datetime | None:
        """After this moment a submission is over the limit."""
        return None if self.due_at is None else self.due_at + timedelta(days=self.late_days)


@dataclass(frozen=True, slots=True)
class Ruling:
    """How many days late a submission is, and the limit that it is over, as a sentence; empty if it is over none."""

    days_late: int = 0
    over: str = ""


OverLimit = Literal["attempts", "date", "cool-down"]


def limits(session: Session, enrolment_id: int, assignment: str) -> PolicyLimits:
    """The policy for the assignment, else the course's, with what this student is allowed beyond it."""
    course_id = session.scalar(select(Enrolment.course_id).where(Enrolment.id == enrolment_id))
    policy = _policy(session, course_id, assignment)
    extension = _extension(session, enrolment_id, assignment)
    if extension is None:
        return policy
    due_at = policy.due_at
    if due_at is not None and extension.due_at is not None:
        due_at = max(due_at, extension.due_at)
    attempts = None if policy.attempts is None else policy.attempts + extension.more_attempts
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
    days_late = 0
    if allowed.due_at is not None and submitted_at > allowed.due_at:
        days_late = math.ceil((submitted_at - allowed.due_at) / timedelta(days=1))
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
    """Make ``allowed`` the policy of a course for an assignment, or with an empty one for all that have none."""
    row = session.scalar(select(Policy).where(Policy.course_id == course_id, Policy.assignment == assignment))
    if row is None:
        row = Policy(course_id=course_id, assignment=assignment)
        session.add(row)
    row.due_at, row.late_days = allowed.due_at, allowed.late_days
    row.attempts, row.cool_down_seconds = allowed.attempts, allowed.cool_down_seconds


def drop_policy(session: Session, course_id: int, assignment: str) -> None:
    """Let an assignment have what holds for all of the course, in place of a policy of its own."""
    session.execute(delete(Policy).where(Policy.course_id == course_id, Policy.assignment == assignment))


def policies(session: Session, course_id: int) -> dict[str, PolicyLimits]:
    """The policies of a course, by assignment."""
    rows = session.scalars(select(Policy).where(Policy.course_id == course_id).order_by(Policy.assignment))
    return {row.assignment: _limits(row) for row in rows}


def extend(session: Session, enrolment_id: int, assignment: str, due_at: datetime | None, more_attempts: int) -> None:
    """Allow one student so much beyond the policy; what was allowed before for the same assignment is replaced."""
    row = session.scalar(
        select(Extension).where(Extension.enrolment_id == enrolment_id, Extension.assignment == assignment)
    )
    if row is None:
        row = Extension(enrolment_id=enrolment_id, assignment=assignment)
        session.add(row)
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
    return PolicyLimits(row.due_at, row.late_days, row.attempts, row.cool_down_seconds)


def _extension(session: Session, enrolment_id: int, assignment: str) -> Extension | None:
    query = select(Extension).where(Extension.enrolment_id == enrolment_id, Extension.assignment.in_(("", assignment)))
    return session.scalar(query.order_by(func.length(Extension.assignment).desc()).limit(1))


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
    due_at = policy.due_at if latest is None else max(policy.due_at, latest)
    return due_at + timedelta(days=policy.late_days)


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
