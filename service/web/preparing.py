"""Assignments taken into a course, and their reference solutions graded: the one way for the pages and for the API.

What an assignment's folder may hold is ``submissions.assignment``'s to say.
"""

from __future__ import annotations

from pathlib import Path

from service.store import audit
from service.store.batches import intake
from service.store.courses import open_assignments
from service.store.courses.open_assignments import CourseAssignment
from service.store.courses.versions import freeze
from service.store.models import Course, Enrolment
from service.store.people.credentials import Identity
from service.store.states import Lane
from service.web.access import actor_of, enrolment_in
from service.web.context import WebContext
from sim.errors import UsageError
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import EXAMPLES
from submissions.assignment.folder import FILE_NAME, REFERENCE, assignment_folder, catalogue
from submissions.assignment.reader import find_in_catalogue, read_assignment
from submissions.bundle import read_submission
from submissions.grading_request import GradingRequest
from submissions.people import Student
from submissions.unzipping import unzip

_MOST_ENTRIES, _MOST_BYTES = 2000, 200_000_000


class StudentsKnowAnother(UsageError):
    """Students have been shown another assignment of this id, and nobody said that it is to be replaced."""


def prepare(context: WebContext, identity: Identity, course_id: int, found: Assignment) -> CourseAssignment:
    """Let the course have an assignment, not yet open; one of the same id is marked by this version from now on."""
    frozen = freeze(found)
    with context.store.transaction() as session:
        made = open_assignments.prepare(session, course_id, frozen)
        told = {"assignment": found.id, "version": found.version}
        audit.note(session, actor_of(identity), "prepare", "course", str(course_id), **told)
    return made


def prepare_own(
    context: WebContext, identity: Identity, course_id: int, path: Path, *, replace: bool
) -> CourseAssignment:
    """Let the course have the assignment whose folder is in a zip; where there is one, grade its reference solution.

    Raises UsageError, with every mistake in a line, where it is none; StudentsKnowAnother.
    """
    folder = _unpacked(path)
    found = read_assignment(folder)
    if not replace:
        _refuse_one_that_students_know(context, course_id, found)
    made = prepare(context, identity, course_id, found)
    reference = folder / EXAMPLES / REFERENCE
    if reference.is_dir():
        _grade(context, identity, course_id, found, reference)
    return made


def reference_of(found: Assignment) -> Path | None:
    """The catalogue's reference solution, where the course marks by the catalogue's version."""
    if found.id not in catalogue() or find_in_catalogue(found.id).version != found.version:
        return None
    folder = assignment_folder(found.id) / EXAMPLES / REFERENCE
    return folder if folder.is_dir() else None


def preview(context: WebContext, identity: Identity, course_id: int, assignment: str) -> str:
    """Grade the catalogue's reference solution as the instructor's own; the id of its job.

    Raises UsageError where there is none of the version that the course has.
    """
    with context.store.reading() as session:
        found = open_assignments.load(session, course_id, assignment)
    reference = reference_of(found)
    if reference is None:
        raise UsageError(f"there is no reference solution of this version of {assignment}; upload its folder again")
    return _grade(context, identity, course_id, found, reference)


def _refuse_one_that_students_know(context: WebContext, course_id: int, found: Assignment) -> None:
    with context.store.reading() as session:
        there = [each for each in open_assignments.of_course(session, course_id) if each.assignment == found.id]
    if any(each.opened_at is not None and each.version != found.version for each in there):
        raise StudentsKnowAnother(
            f"{found.id}: students have been shown another assignment of this id, {there[0].title!r}; "
            "give yours another id, or say that it takes that one's place"
        )


def _grade(context: WebContext, identity: Identity, course_id: int, found: Assignment, reference: Path) -> str:
    with context.store.reading() as session:
        own: Enrolment = enrolment_in(session, identity, course_id)
        student, course = Student(own.written), session.get_one(Course, course_id).name
    submission = read_submission(reference, student=student.id, asked=found.parts)
    accepted = intake.accept(
        context.store,
        GradingRequest(submission, found, REFERENCE, whose=student),
        course=course,
        max_attempts=context.settings.max_attempts,
    )
    if accepted.copied_from is None:
        context.notifier.grade(Lane.INTERACTIVE)
    return accepted.job_id


def _unpacked(path: Path) -> Path:
    """The folder of the assignment: the zip's own, or the only one in it."""
    # What is wrong in it is named by this folder where the zip has none of its own.
    inside = path.parent / "unpacked" / path.stem
    inside.mkdir(parents=True)
    unzip(path, inside, _MOST_ENTRIES, _MOST_BYTES)
    found = [each for each in inside.iterdir() if each.name != "__MACOSX"]
    folder = found[0] if len(found) == 1 and found[0].is_dir() else inside
    if not (folder / FILE_NAME).is_file():
        raise UsageError(f"{path.name}: has no {FILE_NAME} at its top or in its only folder, expected one")
    return folder
