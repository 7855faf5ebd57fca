"""Assignments of a course, prepared by instructors and opened to students.

A prepared assignment is frozen like all others; ``policies.py`` contains deadlines and attempts. Web submissions to an
assignment share one batch, which ends when the assignment is closed.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal
from typing import TYPE_CHECKING

from sqlalchemy import ColumnElement, select
from sqlalchemy.orm import Session

from service.store import webhook_events
from service.store.courses import policies
from service.store.courses.assignment_versions import FrozenAssignment, assignment_from_bytes, store_version
from service.store.engine import now
from service.store.locks import lock_course
from service.store.tables.courses import AssignmentVersion, OpenAssignment
from service.store.tables.submissions import Batch
from sim.errors import UsageError

if TYPE_CHECKING:
    from submissions.assignment.definition import Assignment


@dataclass(frozen=True, slots=True)
class CourseAssignment:
    """An assignment of a course. Students see it from ``opened_at`` and may submit until ``closed_at``."""

    assignment: str
    title: str
    max_marks: Decimal
    version: str
    version_id: int
    opened_at: datetime | None
    closed_at: datetime | None
    names_hidden: bool
    batch_id: str | None  # of web submissions

    @property
    def open(self) -> bool:
        """Return whether students may submit to it."""
        return self.opened_at is not None and self.closed_at is None


def prepare_assignment(session: Session, course_id: int, frozen_assignment: FrozenAssignment) -> CourseAssignment:
    """Add an assignment to a course without opening it, or replace the version of one with the same id."""
    current_time = now(session)
    version_id = store_version(session, frozen_assignment, current_time)
    row = _find_row(session, course_id, frozen_assignment.assignment.id)
    if row is None:
        row = OpenAssignment(
            course_id=course_id, assignment=frozen_assignment.assignment.id, assignment_version_id=version_id
        )
        session.add(row)
    row.assignment_version_id = version_id
    if row.batch_id is not None:
        session.get_one(Batch, row.batch_id).name = _format_batch_name(frozen_assignment.assignment.title)
    session.flush()
    return load_course_assignment(session, course_id, frozen_assignment.assignment.id)


def open_for_students(session: Session, course_id: int, assignment: str) -> None:
    """Show the assignment to students and accept submissions. Raises UsageError if the course does not have it."""
    row, current_time = _require_row(session, course_id, assignment), now(session)
    row.opened_at, row.closed_at = row.opened_at or current_time, None
    if row.batch_id is None:
        title = session.get_one(AssignmentVersion, row.assignment_version_id).title
        batch = Batch(course_id=course_id, name=_format_batch_name(title), created_at=current_time)
        session.add(batch)
        session.flush()
        row.batch_id = batch.id


def check_open(found: CourseAssignment) -> None:
    """Raise UsageError if an assignment does not accept submissions."""
    if not found.open:
        raise UsageError("%(title)s is closed; you can no longer submit to it.", title=found.title)


def close_assignment(session: Session, course_id: int, assignment: str) -> None:
    """Stop accepting submissions; existing ones are kept. Raises UsageError if the course does not have it."""
    lock_course(session, course_id)
    row = _require_row(session, course_id, assignment)
    row.closed_at = now(session)
    session.flush()
    if row.batch_id is not None:
        webhook_events.emit_batch_finished(session, row.batch_id)


def remove_assignment(session: Session, course_id: int, assignment: str) -> None:
    """Remove an assignment and its policy from a course; graded batches are kept.

    Raises UsageError if the course does not have it, students have seen it, or it hides names.
    """
    row = _require_row(session, course_id, assignment)
    if row.opened_at is not None:
        raise UsageError(f"{assignment}: students have already seen it, so it cannot be removed; close it instead")
    if row.names_hidden:
        raise UsageError(f"{assignment}: removing it would show hidden names; show the names first")
    session.delete(row)
    session.flush()
    policies.drop_policy(session, course_id, assignment)


def hide_names(session: Session, course_id: int, assignment: str, names_hidden: bool) -> None:
    """Hide or show students' names to instructors. Raises UsageError if the course does not have it."""
    _require_row(session, course_id, assignment).names_hidden = names_hidden


def load_anonymous_assignments(session: Session, course_id: int) -> frozenset[str]:
    """Return the assignments of a course whose instructors do not see students' names."""
    return frozenset(session.scalars(select(OpenAssignment.assignment).where(*match_anonymous_assignments(course_id))))


def match_anonymous_assignments(course_id: int) -> tuple[ColumnElement[bool], ...]:
    """Return the conditions on an ``OpenAssignment`` that select the course's assignments with hidden names."""
    return OpenAssignment.course_id == course_id, OpenAssignment.names_hidden.is_(True)


def list_assignments(session: Session, course_id: int) -> list[CourseAssignment]:
    """Return all assignments of a course, ordered by id."""
    query = (
        select(OpenAssignment, AssignmentVersion)
        .join(AssignmentVersion, OpenAssignment.assignment_version_id == AssignmentVersion.id)
        .where(OpenAssignment.course_id == course_id)
        .order_by(OpenAssignment.assignment)
    )
    return [_build_course_assignment(row, version) for row, version in session.execute(query)]


def load_course_assignment(session: Session, course_id: int, assignment: str) -> CourseAssignment:
    """Return one assignment of a course. Raises UsageError if the course does not have it."""
    row = _require_row(session, course_id, assignment)
    return _build_course_assignment(row, session.get_one(AssignmentVersion, row.assignment_version_id))


def load_assignment(session: Session, course_id: int, assignment: str) -> Assignment:
    """Load the content of an assignment. Raises UsageError if the course does not have it."""
    row = _require_row(session, course_id, assignment)
    content = session.scalars(
        select(AssignmentVersion.content).where(AssignmentVersion.id == row.assignment_version_id)
    ).one()
    return assignment_from_bytes(content)


def _format_batch_name(title: str) -> str:
    return f"Submitted on the web: {title}"


def _find_row(session: Session, course_id: int, assignment: str) -> OpenAssignment | None:
    is_row = (OpenAssignment.course_id == course_id, OpenAssignment.assignment == assignment)
    return session.scalar(select(OpenAssignment).where(*is_row))


def _require_row(session: Session, course_id: int, assignment: str) -> OpenAssignment:
    row = _find_row(session, course_id, assignment)
    if row is None:
        raise UsageError(f"this course has no assignment {assignment!r}")
    return row


def _build_course_assignment(row: OpenAssignment, version: AssignmentVersion) -> CourseAssignment:
    return CourseAssignment(
        row.assignment,
        version.title,
        version.max_marks,
        version.version,
        version.id,
        row.opened_at,
        row.closed_at,
        row.names_hidden,
        row.batch_id,
    )
