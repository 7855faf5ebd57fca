"""Upload of assignments by instructors, and previews that grade reference solutions.

``submissions.assignment`` defines the content of an assignment's folder.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from service.operations.assignments import CourseAssignment, prepare
from service.operations.context import Actor, Service
from service.operations.errors import Conflict
from service.operations.lookup import require_course, require_own_enrolment
from service.store.batches import intake
from service.store.courses import open_assignments
from service.store.states import JobQueue, Role
from service.store.tables.courses import Course
from sim.errors import UsageError
from submissions.archive_extraction import unzip
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import EXAMPLES, locate_catalogue_reference
from submissions.assignment.folder import FILE_NAME, REFERENCE
from submissions.assignment.reader import find_in_catalogue, read_assignment
from submissions.bundle import read_submission
from submissions.grading_request import GradingRequest
from submissions.student_identity import Student

_MAX_ENTRIES, _MAX_BYTES = 2000, 200_000_000


class AssignmentAlreadySeen(Conflict):
    """Students have seen a different assignment with this id, and the request does not permit replacing it."""


@dataclass(frozen=True, slots=True)
class UploadRequest:
    """The zip of an assignment's folder.

    ``replace`` permits replacing a different assignment that students have seen.
    """

    path: Path
    replace: bool = False


def prepare_from_catalogue(service: Service, actor: Actor, course_id: int, assignment: str) -> CourseAssignment:
    """Add the newest version of a catalogue assignment to a course, without opening it.

    Raises NotFound if the actor does not instruct the course, UsageError if the assignment does not exist.
    """
    return prepare(service, actor, course_id, find_in_catalogue(assignment))


def upload(service: Service, actor: Actor, course_id: int, request: UploadRequest) -> CourseAssignment:
    """Add an assignment from a zipped folder to a course, and grade its reference solution if it has one.

    Raises:
        NotFound: The actor does not instruct the course.
        AssignmentAlreadySeen: The upload would replace an assignment that students have seen.
        UsageError: The zip contains no valid assignment; each mistake is a line.
    """
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
    folder = _unpack_assignment(request.path)
    assignment = read_assignment(folder)
    if not request.replace:
        _check_replacement(service, course_id, assignment)
    course_assignment = prepare(service, actor, course_id, assignment)
    reference = folder / EXAMPLES / REFERENCE
    if reference.is_dir():
        _grade_reference(service, actor, course_id, assignment, reference)
    return course_assignment


def preview(service: Service, actor: Actor, course_id: int, assignment: str) -> str:
    """Grade the catalogue's reference solution as the actor's own submission. Returns the id of its grade.

    Raises NotFound if the actor does not instruct the course, UsageError if there is no reference solution for the
    course's version.
    """
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        current_version = open_assignments.load_assignment(session, course_id, assignment)
    reference = locate_catalogue_reference(current_version)
    if reference is None:
        raise UsageError(
            "this version of %(assignment)s has no reference solution; upload its folder again",
            assignment=assignment,
        )
    return _grade_reference(service, actor, course_id, current_version, reference)


def _check_replacement(service: Service, course_id: int, assignment: Assignment) -> None:
    with service.store.reading() as session:
        existing_assignments = [
            each for each in open_assignments.list_assignments(session, course_id) if each.assignment == assignment.id
        ]
    if any(each.opened_at is not None and each.version != assignment.version for each in existing_assignments):
        raise AssignmentAlreadySeen(
            "%(id)s: students have already seen another assignment with this ID, %(title)s; "
            "use another ID, or confirm that yours replaces it",
            id=assignment.id,
            title=repr(existing_assignments[0].title),
        )


def _grade_reference(service: Service, actor: Actor, course_id: int, assignment: Assignment, reference: Path) -> str:
    with service.store.reading() as session:
        student = Student(require_own_enrolment(session, actor, course_id, Role.INSTRUCTOR).written)
        course = session.get_one(Course, course_id).name
    submission = read_submission(reference, student=student.id, required_parts=assignment.parts)
    accepted_submission = intake.accept_submission(
        service.store,
        GradingRequest(submission, assignment, REFERENCE, listed_student=student),
        course=course,
        max_attempts=service.settings.max_attempts,
    )
    if accepted_submission.copied_from is None:
        service.notifier.grade(JobQueue.INTERACTIVE)
    return accepted_submission.job_id


def _unpack_assignment(path: Path) -> Path:
    """Unzip an assignment and return its folder: the top level, or the only folder in it."""
    # Error messages name this folder if the zip has no top folder.
    destination = path.parent / "unpacked" / path.stem
    destination.mkdir(parents=True)
    unzip(path, destination, _MAX_ENTRIES, _MAX_BYTES)
    entries = [each for each in destination.iterdir() if each.name != "__MACOSX"]
    folder = entries[0] if len(entries) == 1 and entries[0].is_dir() else destination
    if not (folder / FILE_NAME).is_file():
        raise UsageError(
            "%(zip)s: has no %(file)s, expected it at the top level or in the only folder",
            zip=path.name,
            file=FILE_NAME,
        )
    return folder
