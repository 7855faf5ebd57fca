"""Assignments of a course: add, open, close and remove them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.operations.lookup import require_course
from service.store import audit
from service.store.courses import open_assignments
from service.store.courses.assignment_versions import freeze_assignment
from service.store.courses.open_assignments import CourseAssignment as CourseAssignment
from service.store.states import Role

if TYPE_CHECKING:
    from submissions.assignment.definition import Assignment


def prepare(service: Service, actor: Actor, course_id: int, assignment: Assignment) -> CourseAssignment:
    """Add an assignment to a course without opening it, or replace the version of one with the same id.

    Raises NotFound if the course does not exist, or the actor does not instruct it.
    """
    frozen_assignment = freeze_assignment(assignment)
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        course_assignment = open_assignments.prepare_assignment(session, course_id, frozen_assignment)
        detail = {"assignment": course_assignment.assignment, "version": course_assignment.version}
        audit.record_action(session, actor.name, "prepare", "course", str(course_id), **detail)
    return course_assignment


def open_for_students(service: Service, actor: Actor, course_id: int, assignment: str) -> CourseAssignment:
    """Open an assignment to students. Raises NotFound, and UsageError if the course does not have it."""
    return _apply_change(service, actor, course_id, assignment, "open", open_assignments.open_for_students)


def close(service: Service, actor: Actor, course_id: int, assignment: str) -> CourseAssignment:
    """Close an assignment to new submissions; existing ones are kept. Raises like ``open_for_students``."""
    return _apply_change(service, actor, course_id, assignment, "close", open_assignments.close_assignment)


def remove(service: Service, actor: Actor, course_id: int, assignment: str) -> None:
    """Remove an assignment that students have not seen; graded batches are kept.

    Raises NotFound, and UsageError if the course does not have it or must keep it.
    """
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        open_assignments.remove_assignment(session, course_id, assignment)
        audit.record_action(session, actor.name, "remove", "course", str(course_id), assignment=assignment)


def hide_names(
    service: Service, actor: Actor, course_id: int, assignment: str, *, names_hidden: bool
) -> CourseAssignment:
    """Hide or show students' names to all instructors of the course. Raises like ``open_for_students``."""
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        open_assignments.hide_names(session, course_id, assignment, names_hidden)
        audit.record_action(
            session, actor.name, "names", "course", str(course_id), assignment=assignment, hidden=names_hidden
        )
        return open_assignments.load_course_assignment(session, course_id, assignment)


def _apply_change(
    service: Service,
    actor: Actor,
    course_id: int,
    assignment: str,
    action: str,
    change: Callable[[Session, int, str], None],
) -> CourseAssignment:
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        change(session, course_id, assignment)
        audit.record_action(session, actor.name, action, "course", str(course_id), assignment=assignment)
        return open_assignments.load_course_assignment(session, course_id, assignment)
