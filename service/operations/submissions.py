"""Submissions by students. The student is always the actor, regardless of the content of the files.

``submissions.bundle`` defines valid files; ``own_views.py`` shows submissions to students.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from service.operations.context import Actor, Service
from service.operations.errors import Invalid, NotFound
from service.operations.lookup import require_own_enrolment
from service.store.batches import intake
from service.store.batches.intake import AcceptedSubmission
from service.store.courses import open_assignments
from service.store.courses.open_assignments import CourseAssignment
from service.store.states import JobQueue, Role
from service.store.tables.courses import Course
from sim.errors import UsageError
from submissions.assignment.definition import Assignment, Parts
from submissions.bundle import build_submission
from submissions.grading_request import GradingRequest
from submissions.part_fitting import find_empty_parts, find_missing_part
from submissions.raw_files import MEGABYTE, UploadedFile, read_uploaded, sanitise_name
from submissions.student_identity import Student
from submissions.submission import PART_FILES, Submission

__all__ = ["AcceptedSubmission"]


class MissingPart(Invalid):
    """One of two parts is missing, by mistake or on purpose."""


@dataclass(frozen=True, slots=True)
class SubmissionRequest:
    """Files for an assignment; ``even_in_part`` permits a missing part."""

    assignment: str
    sent: Sequence[UploadedFile]
    even_in_part: bool = False


@dataclass(frozen=True, slots=True)
class SubmissionTarget:
    """A student's enrolment, and the open assignment that they submit to."""

    course: str
    enrolment_id: int
    student: Student
    opened: CourseAssignment
    assignment: Assignment

    def read(self, files: Sequence[UploadedFile]) -> GradingRequest:
        """Read the submission in these files. Raises UsageError if they are not a valid one."""
        submission, source = read_sent_files(files, self.student.id, self.assignment.id, self.assignment.parts)
        return GradingRequest(submission, self.assignment, source, listed_student=self.student)


def read_sent_files(
    files: Sequence[UploadedFile], student: str, assignment: str, parts: Parts
) -> tuple[Submission, str]:
    """Return the submission in these files, fitted to ``parts``, and the names of the files.

    Raises UsageError if they are not a valid submission.
    """
    if not files:
        raise UsageError("no files were submitted; select a file, or paste a program.")
    source = sanitise_name(", ".join(dict.fromkeys(each.flat_name for each in files)))
    submission = build_submission(read_uploaded(files, source), source, student, assignment, parts)
    for name in find_empty_parts(submission):
        raise UsageError("%(name)s is empty, expected a program.", name=name)
    return submission, source


def load_submission_target(service: Service, actor: Actor, course_id: int, assignment: str) -> SubmissionTarget:
    """Return the student's enrolment and the open assignment.

    Raises NotFound if students cannot see the assignment, UsageError if it is closed.
    """
    with service.store.reading() as session:
        enrolment = require_own_enrolment(session, actor, course_id, Role.STUDENT)
        open_assignment = {each.assignment: each for each in open_assignments.list_assignments(session, course_id)}.get(
            assignment
        )
        if open_assignment is None or open_assignment.opened_at is None:
            raise NotFound("There is no such page or item, or you have no access to it.")
        open_assignments.check_open(open_assignment)
        assignment_version = open_assignments.load_assignment(session, course_id, assignment)
        course = session.get_one(Course, course_id).name
        return SubmissionTarget(course, enrolment.id, Student(enrolment.written), open_assignment, assignment_version)


def submit(service: Service, actor: Actor, course_id: int, request: SubmissionRequest) -> AcceptedSubmission:
    """Accept a student's files for an assignment, and notify the workers.

    Raises:
        NotFound: Students cannot see the assignment.
        MissingPart: One of two parts is missing.
        UsageError: The assignment is closed, or the files are not a valid submission.
    """
    target = load_submission_target(service, actor, course_id, request.assignment)
    grading_request = target.read(request.sent)
    missing_part = find_missing_part(grading_request.submission, target.assignment.parts)
    if missing_part is not None and not request.even_in_part:
        raise MissingPart(
            "there is no %(name)s; add it, or confirm below that you want to submit without it, which uses an attempt.",
            name=PART_FILES[missing_part],
        )
    accepted_submission = intake.accept_submission(
        service.store,
        grading_request,
        course=target.course,
        max_attempts=service.settings.max_attempts,
        batch_id=target.opened.batch_id,
        max_bytes=service.settings.student_quota_mb * MEGABYTE,
        enrolment_id=target.enrolment_id,
    )
    if accepted_submission.copied_from is None and not accepted_submission.staff_only:
        service.notifier.grade(JobQueue.INTERACTIVE)
    return accepted_submission
