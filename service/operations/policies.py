"""Policies of a course: deadlines, attempts and release of grades, extensions of students, and rules for grades."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from service.operations.context import Actor, Service
from service.operations.errors import Invalid
from service.operations.lookup import require_course, require_student
from service.store import audit
from service.store.courses import policies
from service.store.courses.assignment_versions import check_assignment
from service.store.courses.policies import PolicyLimits as PolicyLimits
from service.store.states import CompletionRule, CountedAttempt, Role

_MAX_LATE_DAYS, _MAX_ATTEMPTS, _MAX_COOL_DOWN_SECONDS = 365, 1000, 600_000


@dataclass(frozen=True, slots=True)
class ExtensionRequest:
    """An extension for one student; an empty ``assignment`` means all assignments."""

    assignment: str = ""
    due_at: datetime | None = None
    more_attempts: int = 0


def list_policies(service: Service, actor: Actor, course_id: int) -> dict[str, PolicyLimits]:
    """Return the policies of a course, by assignment; an empty assignment is the default. Raises NotFound."""
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        return policies.load_policies(session, course_id)


def set_policy(service: Service, actor: Actor, course_id: int, assignment: str, limits: PolicyLimits) -> None:
    """Set the limits of an assignment; an empty ``assignment`` sets the default of the course.

    Raises:
        NotFound: The course does not exist, or the actor does not instruct it.
        Invalid: A limit is out of range.
        UsageError: The assignment does not exist.
    """
    _check_due_date(limits.due_at)
    if limits.released_at is not None and not _is_plausible(limits.released_at):
        raise Invalid(
            "%(date)s is not a valid date for the release of grades, expected a year from 2000 to 2199",
            date=limits.released_at.date().isoformat(),
        )
    if not 0 <= limits.late_days <= _MAX_LATE_DAYS:
        raise Invalid("the days for late submissions must be from 0 to %(most)s", most=_MAX_LATE_DAYS)
    if limits.attempts is not None and not 1 <= limits.attempts <= _MAX_ATTEMPTS:
        raise Invalid("attempts must be from 1 to %(most)s, or empty for no limit", most=_MAX_ATTEMPTS)
    if not 0 <= limits.cool_down_seconds <= _MAX_COOL_DOWN_SECONDS:
        raise Invalid(
            "the minimum time between submissions must be from 0 to %(most)s minutes",
            most=_MAX_COOL_DOWN_SECONDS // 60,
        )
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        check_assignment(session, assignment)
        policies.set_policy(session, course_id, assignment, limits)
        audit.record_action(
            session,
            actor.name,
            "policy",
            "course",
            str(course_id),
            assignment=assignment,
            due_at=_format_date(limits.due_at),
            late_days=limits.late_days,
            attempts=limits.attempts,
            cool_down_seconds=limits.cool_down_seconds,
            release=limits.release.value,
            released_at=_format_date(limits.released_at),
        )


def show_counted_attempt(service: Service, actor: Actor, course_id: int) -> CountedAttempt:
    """Return the rule of a course for the attempt that counts. Raises NotFound."""
    with service.store.reading() as session:
        return require_course(session, actor, course_id, Role.INSTRUCTOR).counted_attempt


def set_counted_attempt(service: Service, actor: Actor, course_id: int, rule: CountedAttempt) -> None:
    """Set the attempt of each student that counts, for all assignments and existing submissions. Raises NotFound."""
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR).counted_attempt = rule
        audit.record_action(session, actor.name, "policy", "course", str(course_id), counted_attempt=rule.value)


def show_completion_rule(service: Service, actor: Actor, course_id: int) -> CompletionRule:
    """Return the rule of a course for published provisional grades. Raises NotFound."""
    with service.store.reading() as session:
        return require_course(session, actor, course_id, Role.INSTRUCTOR).completion_rule


def set_completion_rule(service: Service, actor: Actor, course_id: int, rule: CompletionRule) -> None:
    """Set whether exact marks replace lower ones only, or all, that were published. Raises NotFound.

    The rule applies to all pools of the course that are completed from now on.
    """
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR).completion_rule = rule
        audit.record_action(session, actor.name, "policy", "course", str(course_id), completion_rule=rule.value)


def drop_policy(service: Service, actor: Actor, course_id: int, assignment: str) -> None:
    """Remove the policy of an assignment, so that the default of the course applies. Raises NotFound."""
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        policies.drop_policy(session, course_id, assignment)
        audit.record_action(
            session, actor.name, "policy", "course", str(course_id), assignment=assignment, dropped=True
        )


def extend(
    service: Service, actor: Actor, course_id: int, enrolment_id: int, request: ExtensionRequest
) -> PolicyLimits:
    """Extend the policy for one student, replacing an earlier extension for the same assignment. Returns their limits.

    Raises:
        NotFound: The student does not exist, or the actor does not instruct the course.
        Invalid: The extension is empty or out of range.
        UsageError: The assignment does not exist.
    """
    if request.due_at is None and not request.more_attempts:
        raise Invalid("an extension needs a later deadline, additional attempts, or both")
    _check_due_date(request.due_at)
    if not 0 <= request.more_attempts <= _MAX_ATTEMPTS:
        raise Invalid("additional attempts must be from 0 to %(most)s", most=_MAX_ATTEMPTS)
    with service.store.transaction() as session:
        row = require_student(session, actor, course_id, enrolment_id)
        check_assignment(session, request.assignment)
        policies.extend_policy(session, enrolment_id, request.assignment, request.due_at, request.more_attempts)
        audit.record_action(
            session,
            actor.name,
            "extend",
            "course",
            str(course_id),
            student=row.student,
            assignment=request.assignment,
            due_at=_format_date(request.due_at),
            more_attempts=request.more_attempts,
        )
        return policies.load_limits(session, enrolment_id, request.assignment)


def show_limits(service: Service, actor: Actor, course_id: int, enrolment_id: int, assignment: str) -> PolicyLimits:
    """Return the limits of one student for an assignment, including extensions. Raises NotFound."""
    with service.store.reading() as session:
        require_student(session, actor, course_id, enrolment_id)
        return policies.load_limits(session, enrolment_id, assignment)


def _check_due_date(due_at: datetime | None) -> None:
    if due_at is not None and not _is_plausible(due_at):
        raise Invalid(
            "%(date)s is not a valid deadline, expected a year from 2000 to 2199", date=due_at.date().isoformat()
        )


def _is_plausible(moment: datetime) -> bool:
    return 2000 <= moment.year < 2200


def _format_date(moment: datetime | None) -> str | None:
    return None if moment is None else moment.isoformat()
