"""Assignments of a course: put into it, opened to students, closed and removed."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.operations.lookup import course_for
from service.store import audit
from service.store.courses import open_assignments
from service.store.courses.open_assignments import CourseAssignment as CourseAssignment
from service.store.courses.versions import freeze
from service.store.states import Role

if TYPE_CHECKING:
    from submissions.assignment.definition import Assignment


def prepare(service: Service, actor: Actor, course_id: int, assignment: Assignment) -> CourseAssignment:
    """Put an assignment into a course, not yet open; one of the same id is marked by this version from now on.

    Raises NotFound where there is no such course, or the actor does not instruct it.
    """
    frozen = freeze(assignment)
    with service.store.transaction() as session:
        course_for(session, actor, course_id, Role.INSTRUCTOR)
        made = open_assignments.prepare(session, course_id, frozen)
        detail = {"assignment": made.assignment, "version": made.version}
        audit.note(session, actor.name, "prepare", "course", str(course_id), **detail)
    return made


def open_for_students(service: Service, actor: Actor, course_id: int, assignment: str) -> CourseAssignment:
    """Let students see an assignment and submit to it. Raises NotFound, and UsageError where the course has none."""
    return _change(service, actor, course_id, assignment, "open", open_assignments.open_for_students)


def close(service: Service, actor: Actor, course_id: int, assignment: str) -> CourseAssignment:
    """Take no more submissions to an assignment; those there are stay. Raises as ``open_for_students`` does."""
    return _change(service, actor, course_id, assignment, "close", open_assignments.close)


def remove(service: Service, actor: Actor, course_id: int, assignment: str) -> None:
    """Remove an assignment that no student has been shown; graded batches stay.

    Raises NotFound, and UsageError where the course has none of this id, or has to keep it.
    """
    with service.store.transaction() as session:
        course_for(session, actor, course_id, Role.INSTRUCTOR)
        open_assignments.remove(session, course_id, assignment)
        audit.note(session, actor.name, "remove", "course", str(course_id), assignment=assignment)


def hide_names(service: Service, actor: Actor, course_id: int, assignment: str, *, hidden: bool) -> CourseAssignment:
    """Hide or show whose work it is, for all who instruct the course. Raises as ``open_for_students`` does."""
    with service.store.transaction() as session:
        course_for(session, actor, course_id, Role.INSTRUCTOR)
        open_assignments.hide_names(session, course_id, assignment, hidden)
        audit.note(session, actor.name, "names", "course", str(course_id), assignment=assignment, hidden=hidden)
        return open_assignments.find(session, course_id, assignment)


def _change(
    service: Service,
    actor: Actor,
    course_id: int,
    assignment: str,
    action: str,
    change: Callable[[Session, int, str], None],
) -> CourseAssignment:
    with service.store.transaction() as session:
        course_for(session, actor, course_id, Role.INSTRUCTOR)
        change(session, course_id, assignment)
        audit.note(session, actor.name, action, "course", str(course_id), assignment=assignment)
        return open_assignments.find(session, course_id, assignment)
