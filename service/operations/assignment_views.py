"""Assignments of a course as its instructors see them, with the policies that apply."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from service.operations.assignments import CourseAssignment
from service.operations.context import Actor, Service
from service.operations.lookup import require_course, require_own_enrolment
from service.store.courses import open_assignments, policies
from service.store.courses.policies import PolicyLimits
from service.store.grades import own_gradings
from service.store.grades.own_gradings import OwnGrading
from service.store.states import CompletionRule, CountedAttempt, Role
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import locate_catalogue_reference
from submissions.assignment.folder import list_catalogue_ids
from submissions.assignment.reader import find_in_catalogue


@dataclass(frozen=True, slots=True)
class CourseAssignments:
    """The assignments of a course, their own policies, the default policy, and the rules for grades."""

    prepared: list[CourseAssignment]
    policies: Mapping[str, PolicyLimits]
    policy: PolicyLimits
    counted_attempt: CountedAttempt
    completion_rule: CompletionRule


@dataclass(frozen=True, slots=True)
class AssignmentView:
    """One assignment of a course, its policy, and the actor's own previews of it."""

    line: CourseAssignment
    assignment: Assignment
    own_policy: PolicyLimits | None
    policy: PolicyLimits  # the one that applies
    previews: list[OwnGrading]
    has_reference: bool
    changed: bool  # the catalogue has a different version


def list_prepared(service: Service, actor: Actor, course_id: int) -> list[CourseAssignment]:
    """Return the assignments of a course, ordered by id. Raises NotFound."""
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        return open_assignments.list_assignments(session, course_id)


def show_all(service: Service, actor: Actor, course_id: int) -> CourseAssignments:
    """Return the assignments of a course with its policies. Raises NotFound."""
    with service.store.reading() as session:
        course = require_course(session, actor, course_id, Role.INSTRUCTOR)
        rules = course.counted_attempt, course.completion_rule
        limits_by_assignment = policies.load_policies(session, course_id)
        course_assignments = open_assignments.list_assignments(session, course_id)
    return CourseAssignments(
        course_assignments, limits_by_assignment, limits_by_assignment.get("") or PolicyLimits(), *rules
    )


def load(service: Service, actor: Actor, course_id: int, assignment: str) -> tuple[CourseAssignment, Assignment]:
    """Return one assignment of a course. Raises NotFound, and UsageError if the course does not have it."""
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        line = open_assignments.load_course_assignment(session, course_id, assignment)
        return line, open_assignments.load_assignment(session, course_id, assignment)


def show(service: Service, actor: Actor, course_id: int, assignment: str) -> AssignmentView:
    """Return one assignment of a course with the data of its page. Raises like ``load``."""
    line, current_version = load(service, actor, course_id, assignment)
    with service.store.reading() as session:
        limits_by_assignment = policies.load_policies(session, course_id)
        enrolment = require_own_enrolment(session, actor, course_id, Role.INSTRUCTOR)
        previews = own_gradings.list_newest_gradings(session, enrolment.id, assignment)
    own_policy = limits_by_assignment.get(assignment)
    newest_version = find_in_catalogue(assignment).version if assignment in list_catalogue_ids() else line.version
    return AssignmentView(
        line,
        current_version,
        own_policy,
        own_policy or limits_by_assignment.get("") or PolicyLimits(),
        previews,
        has_reference=locate_catalogue_reference(current_version) is not None,
        changed=newest_version != line.version,
    )
