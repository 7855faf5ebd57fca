"""Policies of a course: deadlines, attempts, the attempt that counts, the release of grades, and extensions.

A submission over a limit is stored and can be marked, but only staff see it. This module rejects no submissions.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Literal

from sqlalchemy import ColumnElement, and_, delete, exists, func, or_, select
from sqlalchemy.exc import NoResultFound
from sqlalchemy.orm import Session

from service.store.conditional_insert import insert_if_new
from service.store.courses.local_days import add_days, count_days_after, find_local_zone
from service.store.engine import now
from service.store.states import CountedAttempt, JobState, ReleaseRule
from service.store.tables.courses import Course, Extension, OpenAssignment, Policy
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Job, SubmissionRow

_ALWAYS = frozenset({"visible"})
_AFTER_DUE_DATE = frozenset({"after_due_date"})
_WITH_PUBLICATION = _AFTER_DUE_DATE | {"after_published"}
#: The visibilities that students see of a published grade.
PUBLISHED_VISIBILITIES = _ALWAYS | _WITH_PUBLICATION
_UNCOUNTED_VERDICTS = ("assignment_error", "host_error")


@dataclass(frozen=True, slots=True)
class PolicyLimits:
    """Limits of one student. ``attempts`` counts different submissions. None means no limit, or no due date.

    ``release`` and ``released_at`` say when students see grades; at ``released_at`` they see all that exist.
    """

    due_at: datetime | None = None
    late_days: int = 0
    attempts: int | None = None
    cool_down_seconds: float = 0.0
    zone: str = ""  # of the counted days; empty for this server's
    release: ReleaseRule = ReleaseRule.OWN_AT_ONCE
    released_at: datetime | None = None

    @property
    def closed_at(self) -> datetime | None:
        """Return the moment after which a submission is over the limit; None without a due date."""
        return None if self.due_at is None else add_days(self.due_at, self.late_days, self.zone)

    def days_late(self, submitted_at: datetime) -> int:
        """Return the number of days late in the policy's zone, rounded up."""
        return 0 if self.due_at is None else count_days_after(self.due_at, submitted_at, self.zone)


OverLimit = Literal["attempts", "date", "cool-down"]


@dataclass(frozen=True, slots=True)
class ExceededLimit:
    """An exceeded limit and the actual value: the attempt, the days late, or the minutes waited."""

    limit: OverLimit
    actual: int
    allowed: int

    def __str__(self) -> str:
        match self.limit:
            case "attempts":
                return f"attempt {self.actual}, allowed: {self.allowed}"
            case "date":
                return f"{format_days(self.actual)} late, allowed: {self.allowed}"
            case "cool-down":
                return f"submitted {self.actual} min after the previous submission, required: {self.allowed} min"


@dataclass(frozen=True, slots=True)
class Ruling:
    """Days that a submission is late, and the limit that it exceeds, if any."""

    days_late: int = 0
    over: ExceededLimit | None = None


def load_limits(session: Session, enrolment_id: int, assignment: str) -> PolicyLimits:
    """Return the limits of a student: the assignment's policy, or the course's, with the student's extensions.

    Extensions for all assignments and for this one combine: the later due date and the larger number of attempts apply.
    """
    return load_limits_by_assignment(session, enrolment_id, [assignment])[assignment]


def load_limits_by_assignment(
    session: Session, enrolment_id: int, assignments: Collection[str]
) -> dict[str, PolicyLimits]:
    """Return ``limits`` for several assignments, with the same number of statements."""
    course_id = select(Enrolment.course_id).where(Enrolment.id == enrolment_id).scalar_subquery()
    policies = _load_known_policies(session, Policy.course_id == course_id, assignments)
    policies_by_assignment = {assignment: policy for (_, assignment), policy in policies.items()}
    is_extension = (Extension.enrolment_id == enrolment_id, Extension.assignment.in_(("", *assignments)))
    extensions = session.scalars(select(Extension).where(*is_extension)).all()
    return {
        each: _apply_extensions(
            policies_by_assignment.get(each) or policies_by_assignment.get("") or PolicyLimits(),
            [extension for extension in extensions if extension.assignment in ("", each)],
        )
        for each in assignments
    }


def _apply_extensions(policy: PolicyLimits, extensions: Sequence[Extension]) -> PolicyLimits:
    due_at, attempts = policy.due_at, policy.attempts
    if due_at is not None:
        due_at = max([due_at, *(each.due_at for each in extensions if each.due_at is not None)])
    if attempts is not None:
        attempts += max((each.more_attempts for each in extensions), default=0)
    return replace(policy, due_at=due_at, attempts=attempts)


def format_days(count: int) -> str:
    """Return a number of days in words."""
    return "1 day" if count == 1 else f"{count} days"


def apply_policy(
    session: Session, enrolment_id: int, assignment: str, sha256: str, submitted_at: datetime | None
) -> Ruling:
    """Apply the policy to a submission that arrives now. An unknown submission time counts as in time."""
    limits = load_limits(session, enrolment_id, assignment)
    attempt_times = _load_attempt_times(session, enrolment_id, [assignment]).get(assignment, {})
    earlier_times = [when for sha, when in attempt_times.items() if sha != sha256]
    if limits.attempts is not None and len(earlier_times) >= limits.attempts:
        return Ruling(over=ExceededLimit("attempts", len(earlier_times) + 1, limits.attempts))
    if submitted_at is None:
        return Ruling()
    days_late = limits.days_late(submitted_at)
    if days_late > limits.late_days:
        return Ruling(days_late, ExceededLimit("date", days_late, limits.late_days))
    pauses = [submitted_at - when for when in earlier_times if when <= submitted_at]
    if pauses and min(pauses).total_seconds() < limits.cool_down_seconds:
        minutes = math.floor(min(pauses).total_seconds() / 60)
        required_minutes = math.ceil(limits.cool_down_seconds / 60)
        return Ruling(days_late, ExceededLimit("cool-down", minutes, required_minutes))
    return Ruling(days_late)


def count_attempts(session: Session, enrolment_id: int, assignments: Collection[str]) -> dict[str, int]:
    """Return the number of a student's submissions that count as attempts so far, by assignment."""
    attempt_times = _load_attempt_times(session, enrolment_id, assignments)
    return {each: len(attempt_times.get(each, {})) for each in assignments}


def load_visibilities(session: Session, job_id: str) -> frozenset[str]:
    """Return the visibilities of a grade that its student may see now.

    ``after_due_date`` opens when no student of the course may submit any more, including extensions and late days. All
    but ``hidden`` open when the grade is published. Raises NoResultFound if the job no longer exists.
    """
    visibilities_by_job = load_visibilities_by_job(session, [job_id])
    if job_id not in visibilities_by_job:
        raise NoResultFound
    return visibilities_by_job[job_id]


def load_visibilities_by_job(session: Session, job_ids: Collection[str]) -> dict[str, frozenset[str]]:
    """Return the result of ``load_visibilities`` for several grades, with the same number of statements."""
    query = (
        select(Job.id, Job.published_at, Enrolment.course_id, SubmissionRow.assignment)
        .join(SubmissionRow, Job.submission_id == SubmissionRow.id)
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .where(Job.id.in_(job_ids))
    )
    rows = session.execute(query).all()
    closed_pairs = _find_closed_assignments(session, {(course_id, assignment) for *_, course_id, assignment in rows})
    return {
        job_id: _ALWAYS
        | (_WITH_PUBLICATION if published_at is not None else frozenset())
        | (_AFTER_DUE_DATE if (course_id, assignment) in closed_pairs else frozenset())
        for job_id, published_at, course_id, assignment in rows
    }


def set_policy(session: Session, course_id: int, assignment: str, limits: PolicyLimits) -> None:
    """Set the policy of a course for an assignment. An empty ``assignment`` sets the default of the course.

    Without a zone, the current zone of this server is stored, so moving the server does not change the days.
    """
    insert_if_new(session, Policy, course_id=course_id, assignment=assignment)
    row = session.scalars(select(Policy).where(Policy.course_id == course_id, Policy.assignment == assignment)).one()
    row.due_at, row.late_days = limits.due_at, limits.late_days
    row.attempts, row.cool_down_seconds = limits.attempts, limits.cool_down_seconds
    row.zone = limits.zone or find_local_zone()
    row.release, row.released_at = limits.release, limits.released_at


def drop_policy(session: Session, course_id: int, assignment: str) -> None:
    """Remove the policy of an assignment, so that the default of the course applies."""
    session.execute(delete(Policy).where(Policy.course_id == course_id, Policy.assignment == assignment))


def load_policies(session: Session, course_id: int) -> dict[str, PolicyLimits]:
    """Return the policies of a course, by assignment."""
    rows = session.scalars(select(Policy).where(Policy.course_id == course_id).order_by(Policy.assignment))
    return {row.assignment: _build_limits(row) for row in rows}


def match_best_counts() -> ColumnElement[bool]:
    """Return the condition that the best attempt counts in the course of a ``SubmissionRow``."""
    best_course = exists().where(
        Enrolment.id == SubmissionRow.enrolment_id,
        Course.id == Enrolment.course_id,
        Course.counted_attempt == CountedAttempt.BEST,
    )
    return best_course.correlate(SubmissionRow)


def match_released(
    current_time: datetime, job: type[Job] = Job, submission: type[SubmissionRow] = SubmissionRow
) -> ColumnElement[bool]:
    """Return the condition that the grade of a job, joined with its submission, is released to its student.

    It says nothing of the criteria that open later, nor of limits: ``current_grades`` has the other conditions.
    """
    is_applicable = (Enrolment.id == submission.enrolment_id, Policy.assignment.in_(("", submission.assignment)))
    course_policies = select(Policy.id).join(Enrolment, Enrolment.course_id == Policy.course_id).where(*is_applicable)
    # The policy of the assignment, or the default, whose assignment is empty and comes last.
    policy_id = course_policies.order_by(Policy.assignment.desc()).limit(1)
    policy = Policy.id == policy_id.correlate(submission).scalar_subquery()
    rule = func.coalesce(select(Policy.release).where(policy).scalar_subquery(), ReleaseRule.OWN_AT_ONCE)
    batch_of_own = exists().where(OpenAssignment.batch_id == submission.batch_id)
    is_own = or_(submission.batch_id.is_(None), batch_of_own.correlate(submission))
    return or_(
        job.published_at.is_not(None),
        rule == ReleaseRule.AT_ONCE,
        and_(rule == ReleaseRule.OWN_AT_ONCE, is_own),
        exists().where(policy, Policy.released_at <= current_time).correlate(submission),
    )


def extend_policy(
    session: Session, enrolment_id: int, assignment: str, due_at: datetime | None, more_attempts: int
) -> None:
    """Extend the policy for one student; replaces the student's earlier extension for the same assignment."""
    insert_if_new(session, Extension, enrolment_id=enrolment_id, assignment=assignment)
    is_same = (Extension.enrolment_id == enrolment_id, Extension.assignment == assignment)
    row = session.scalars(select(Extension).where(*is_same)).one()
    row.due_at, row.more_attempts = due_at, more_attempts


@dataclass(frozen=True, slots=True)
class ExtensionLine:
    """The extension of one student; an empty ``assignment`` means all assignments."""

    enrolment_id: int
    student: str
    assignment: str
    due_at: datetime | None
    more_attempts: int


def list_extensions(session: Session, course_id: int) -> list[ExtensionLine]:
    """Return all extensions of a course, ordered by student."""
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


def _load_known_policies(
    session: Session, is_in_course: ColumnElement[bool], assignments: Collection[str]
) -> dict[tuple[int, str], PolicyLimits]:
    """Return the policies of some assignments and the defaults, by course and assignment."""
    rows = session.scalars(select(Policy).where(is_in_course, Policy.assignment.in_(("", *assignments))))
    return {(row.course_id, row.assignment): _build_limits(row) for row in rows}


def _build_limits(row: Policy) -> PolicyLimits:
    return PolicyLimits(
        row.due_at, row.late_days, row.attempts, row.cool_down_seconds, row.zone, row.release, row.released_at
    )


def _find_closed_assignments(session: Session, pairs: Collection[tuple[int, str]]) -> set[tuple[int, str]]:
    """Return the given (course, assignment) pairs to which no student may submit any more."""
    course_ids, assignments = {course_id for course_id, _ in pairs}, {assignment for _, assignment in pairs}
    policies = _load_known_policies(session, Policy.course_id.in_(course_ids), assignments)
    extension_query = (
        select(Enrolment.course_id, Extension.assignment, func.max(Extension.due_at))
        .join(Enrolment, Extension.enrolment_id == Enrolment.id)
        .where(Enrolment.course_id.in_(course_ids), Extension.assignment.in_(("", *assignments)))
        .group_by(Enrolment.course_id, Extension.assignment)
    )
    latest_due_dates = {
        (course_id, each): due_at for course_id, each, due_at in session.execute(extension_query) if due_at is not None
    }
    current_time = now(session)
    closed_pairs = set()
    for course_id, assignment in pairs:
        policy = policies.get((course_id, assignment)) or policies.get((course_id, ""))
        if policy is None or policy.due_at is None:
            continue
        extended_dates = [
            latest_due_dates[course_id, each] for each in ("", assignment) if (course_id, each) in latest_due_dates
        ]
        closed_at = replace(policy, due_at=max([policy.due_at, *extended_dates])).closed_at
        if closed_at is not None and current_time > closed_at:
            closed_pairs.add((course_id, assignment))
    return closed_pairs


def _load_attempt_times(
    session: Session, enrolment_id: int, assignments: Collection[str]
) -> dict[str, dict[str, datetime]]:
    """Return the submission times of different submissions that count as attempts, by assignment and hash.

    A submission counts if its grading started and did not end with a fault of the assignment or the host. Where the
    best attempt counts, queued submissions count, too, because a newer one does not replace them.
    """
    submission = SubmissionRow
    counts = or_(
        Job.state == JobState.RUNNING,
        (Job.state == JobState.DONE) & Job.verdict.not_in(_UNCOUNTED_VERDICTS),
        (Job.state == JobState.QUEUED) & match_best_counts(),
    )
    submission_moment = func.coalesce(submission.submitted_at, submission.created_at)
    query = (
        select(submission.assignment, submission.sha256, submission_moment)
        .join(Job, Job.submission_id == submission.id)
        .where(
            submission.enrolment_id == enrolment_id,
            submission.assignment.in_(assignments),
            submission.staff_only.is_(None),
            counts,
        )
        .order_by(submission.attempt)
    )
    times_by_assignment: dict[str, dict[str, datetime]] = {}
    for assignment, sha256, submission_time in session.execute(query):
        times_by_assignment.setdefault(assignment, {})[sha256] = submission_time
    return times_by_assignment
