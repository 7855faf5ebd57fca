"""Privacy: export and erasure of a student's data, and purging of old submissions."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path

from service.operations.context import Actor, Service
from service.operations.errors import Invalid
from service.operations.lookup import (
    check_machine,
    check_no_names_hidden,
    require_course,
    require_own_enrolment,
    require_student,
)
from service.pending_uploads import PendingUploads
from service.store import purge as purging
from service.store.backup import back_up
from service.store.courses import open_assignments
from service.store.engine import now, retry_conflicts
from service.store.locks import lock_course
from service.store.purge import PurgeCounts as PurgeCounts
from service.store.states import Role

_MAX_DAYS = 36_500


@dataclass(frozen=True, slots=True)
class StudentData:
    """All data of a student, as a zip."""

    enrolment_id: int
    zip: bytes


@dataclass(frozen=True, slots=True)
class PurgeRequest:
    """The minimum age in days of the submissions to remove; ``only_count`` removes nothing."""

    older_than_days: int
    only_count: bool = False


def export_own(service: Service, actor: Actor, course_id: int) -> StudentData:
    """Export the actor's own data in a course as a student, as visible to them. Raises NotFound."""
    # Reports take long to import.
    from service.student_export import export_student as exported

    with service.store.reading() as session:
        enrolment_id = require_own_enrolment(session, actor, course_id, Role.STUDENT).id
    return StudentData(enrolment_id, exported(service.store, enrolment_id))


def export_student(service: Service, actor: Actor, course_id: int, enrolment_id: int) -> StudentData:
    """Export a student's data as visible to them. Raises NotFound.

    For instructors, assignments with hidden names are left out.
    """
    from service.student_export import export_student as exported

    with service.store.reading() as session:
        require_student(session, actor, course_id, enrolment_id)
        anonymous_assignments = (
            frozenset() if actor.is_machine else open_assignments.load_anonymous_assignments(session, course_id)
        )
    return StudentData(enrolment_id, exported(service.store, enrolment_id, anonymous_assignments))


@retry_conflicts
def erase_student(service: Service, actor: Actor, course_id: int, enrolment_id: int) -> PurgeCounts:
    """Permanently remove all submissions of a student, their results, and personal data.

    Uploads to the course that wait for confirmation may contain the student's files, so they are removed, too.

    Raises NotFound, Invalid if names are hidden, and UsageError while a submission of the student is being graded.
    """
    with service.store.transaction() as session:
        lock_course(session, course_id)
        require_student(session, actor, course_id, enrolment_id)
        check_no_names_hidden(session, actor, course_id)
        removed = purging.erase_student(session, enrolment_id, actor.name)
    PendingUploads(service.settings.home).remove_course(course_id)
    return removed


def archive(service: Service, actor: Actor, file: Path) -> int:
    """Copy the whole database into a new file. Returns its size in bytes.

    Raises:
        Forbidden: The actor is not a command on the machine.
        UsageError: The file exists.
        HostError: The file cannot be written.
    """
    check_machine(actor)
    back_up(service.store.engine, file)
    return file.stat().st_size


def purge(service: Service, actor: Actor, course_id: int, request: PurgeRequest) -> PurgeCounts:
    """Remove old submissions of a course, with grades, recordings, and students without remaining submissions.

    Raises Forbidden unless called by a command, NotFound, and Invalid for a number of days that is out of range.
    """
    check_machine(actor)
    if not 1 <= request.older_than_days <= _MAX_DAYS:
        raise Invalid("the age must be from 1 to %(most)s days", most=_MAX_DAYS)
    with service.store.reading() as session:
        require_course(session, actor, course_id)
        cutoff = now(session) - timedelta(days=request.older_than_days)
    return purging.purge_submissions(
        service.store, cutoff, actor.name, course_id=course_id, only_count=request.only_count
    )
