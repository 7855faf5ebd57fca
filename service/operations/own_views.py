"""Views for students: the assignments of a course, their own submissions, and visible grades."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy.orm import Session

from service.language import ENGLISH, Language
from service.operations import own_submissions
from service.operations.context import Actor, Service
from service.operations.errors import NotFound
from service.operations.grade_views import SubmittedFiles, build_replay_document
from service.operations.lookup import require_own_enrolment, require_own_submission
from service.operations.own_submissions import Allowance, OwnAssignment, OwnSubmission
from service.report_files import render_report_body, render_standalone_report
from service.reports.html import ReportParts
from service.reports.view import View, build_student_view
from service.store.batches import stored_requests
from service.store.batches.rejected_files import RejectedFile, load_rejected_files
from service.store.courses import open_assignments
from service.store.courses.open_assignments import CourseAssignment
from service.store.grades import appeals, results
from service.store.grades.appeals import AppealLine
from service.store.queue.queue_places import QueuePlace, estimate_place, estimate_places
from service.store.states import Role
from service.test_runs import build_single_trial_assignment
from submissions.assignment.definition import Assignment
from submissions.assignment.task_sheet import TaskSheet, build_task_sheet


@dataclass(frozen=True, slots=True)
class TaskView:
    """An assignment with a student's attempts."""

    sheet: TaskSheet
    attempts: list[OwnSubmission]
    counting: OwnSubmission | None
    allowance: Allowance
    is_open: bool
    closed_at: datetime | None  # None if it is open, or was never opened
    can_test_run: bool


@dataclass(frozen=True, slots=True)
class OwnWork:
    """A student's assignments, most urgent first, and rejected files without a later submission."""

    assignments: list[OwnAssignment]
    rejected_files: list[RejectedFile]


@dataclass(frozen=True, slots=True)
class SubmissionView:
    """A submission of a student and its place in the queue; None after it has ended."""

    submission: OwnSubmission
    place: QueuePlace | None


@dataclass(frozen=True, slots=True)
class ReportView:
    """A submission of a student with its report, if any, and the related attempts and appeals."""

    submission: OwnSubmission
    place: QueuePlace | None
    attempts: list[OwnSubmission]
    counting: OwnSubmission | None
    allowance: Allowance
    is_open: bool
    appeals: list[AppealLine]
    report: ReportParts | None


def show_work(service: Service, actor: Actor, course_id: int) -> OwnWork:
    """Return the opened assignments and those that the actor submitted to, and the actor's rejected files.

    Raises NotFound.
    """
    with service.store.reading() as session:
        enrolment = require_own_enrolment(session, actor, course_id, Role.STUDENT)
        lines = own_submissions.load_own_assignments(session, course_id, enrolment.id)
        last_times = {each.assignment: each.newest.submitted_at for each in lines if each.newest is not None}
        rejected_files = [
            each
            for each in load_rejected_files(session, enrolment)
            if each.assignment not in last_times or last_times[each.assignment] < each.created_at
        ]
        return OwnWork(lines, rejected_files)


def list_opened(
    service: Service, actor: Actor, course_id: int, *, limit: int, last_assignment: str = ""
) -> list[tuple[CourseAssignment, Allowance]]:
    """Return at most ``limit`` opened assignments of a course, ordered by id, after this one. Raises NotFound."""
    with service.store.reading() as session:
        enrolment_id = _require_enrolment_id(session, actor, course_id)
        opened_assignments = [
            each for each in open_assignments.list_assignments(session, course_id) if each.opened_at is not None
        ]
        page_assignments = [each for each in opened_assignments if each.assignment > last_assignment][:limit]
        allowances = own_submissions.compute_allowances(
            session, enrolment_id, [each.assignment for each in page_assignments]
        )
        return [(each, allowances[each.assignment]) for each in page_assignments]


def show_sheet(service: Service, actor: Actor, course_id: int, assignment: str) -> TaskSheet:
    """Return the task of an assignment. Raises NotFound if it was not opened, unless the actor submitted to it."""
    with service.store.reading() as session:
        enrolment_id = _require_enrolment_id(session, actor, course_id)
        return build_task_sheet(load_visible_assignment(session, course_id, enrolment_id, assignment))


def show_given_file(service: Service, actor: Actor, course_id: int, assignment: str, file: str) -> bytes:
    """Return a file that an assignment provides to students. Raises NotFound."""
    files = show_sheet(service, actor, course_id, assignment).given
    if file not in files:
        raise _build_not_found()
    return files[file]


def show_task(service: Service, actor: Actor, course_id: int, assignment: str) -> TaskView:
    """Return an assignment with the actor's attempts. Raises NotFound like ``show_sheet``."""
    with service.store.reading() as session:
        enrolment_id = _require_enrolment_id(session, actor, course_id)
        visible_assignment = load_visible_assignment(session, course_id, enrolment_id, assignment)
        opened = find_opened_assignment(session, course_id, assignment)
        is_open = opened is not None and opened.open
        attempts = own_submissions.load_own_attempts(session, enrolment_id, assignment)
        return TaskView(
            build_task_sheet(visible_assignment),
            attempts.newest,
            attempts.counting,
            own_submissions.compute_allowance(session, enrolment_id, assignment),
            is_open,
            None if opened is None else opened.closed_at,
            can_test_run=is_open and build_single_trial_assignment(visible_assignment) is not None,
        )


def list_submissions(
    service: Service, actor: Actor, course_id: int, *, limit: int, before_id: int | None = None
) -> list[SubmissionView]:
    """Return at most ``limit`` submissions of the actor in the course, newest first, before this id.

    Raises NotFound.
    """
    with service.store.reading() as session:
        enrolment_id = _require_enrolment_id(session, actor, course_id)
        submissions = own_submissions.load_submissions_before(session, enrolment_id, before_id, limit)
        waiting_ids = [each.job_id for each in submissions if each.waits]
        places = estimate_places(session, waiting_ids) if waiting_ids else {}
        return [SubmissionView(each, places.get(each.job_id)) for each in submissions]


def show_submission(service: Service, actor: Actor, course_id: int, submission_id: int) -> SubmissionView:
    """Return a submission of the actor and its progress. Raises NotFound."""
    with service.store.reading() as session:
        return _add_queue_place(
            session, _require_submission(session, _require_enrolment_id(session, actor, course_id), submission_id)
        )


def show_submission_report(
    service: Service, actor: Actor, course_id: int, submission_id: int, language: Language = ENGLISH
) -> ReportView:
    """Return a submission of the actor with the data of its page. Raises NotFound."""
    with service.store.reading() as session:
        enrolment_id = _require_enrolment_id(session, actor, course_id)
        submission_with_attempts = own_submissions.find_submission_with_attempts(session, enrolment_id, submission_id)
        if submission_with_attempts is None:
            raise _build_not_found()
        submission, attempts = submission_with_attempts
        assignment, place = submission.assignment, _add_queue_place(session, submission).place
        allowance = own_submissions.compute_allowance(session, enrolment_id, assignment)
        is_open = is_assignment_open(session, course_id, assignment)
        submission_appeals = appeals.load_appeals(session, submission_id)
        visible_view = _load_student_view(session, submission, language) if submission.shown else None
    report = (
        None
        if visible_view is None
        else render_report_body(service.store, submission.job_id, submission.plots, visible_view)
    )
    return ReportView(
        submission, place, attempts.newest, attempts.counting, allowance, is_open, submission_appeals, report
    )


def show_result(service: Service, actor: Actor, course_id: int, submission_id: int) -> tuple[str, View]:
    """Return the id of a grade and the part of it that the actor may see. Raises NotFound if nothing is visible."""
    submission, view = _load_result(service, actor, course_id, submission_id, ENGLISH)
    return submission.job_id, view


def show_report(
    service: Service, actor: Actor, course_id: int, submission_id: int, language: Language = ENGLISH
) -> str:
    """Return the visible part of the report as a standalone page. Raises NotFound like ``show_result``."""
    submission, view = _load_result(service, actor, course_id, submission_id, language)
    return render_standalone_report(service.store, submission.job_id, submission.plots, view)


def show_replay(service: Service, actor: Actor, course_id: int, submission_id: int) -> dict[str, Any]:
    """Return the replay data of the visible trials. Raises NotFound like ``show_result``."""
    submission, view = _load_result(service, actor, course_id, submission_id, ENGLISH)
    with service.store.reading() as session:
        return build_replay_document(session, submission.job_id, view)


def show_files(service: Service, actor: Actor, course_id: int, submission_id: int) -> SubmittedFiles:
    """Return the files of a submission of the actor. Raises NotFound."""
    with service.store.reading() as session:
        require_own_enrolment(session, actor, course_id, Role.STUDENT)
        row = require_own_submission(session, actor, course_id, submission_id)
        return SubmittedFiles(row.packed, f"{row.assignment}-{row.attempt}.zip")


def find_opened_assignment(session: Session, course_id: int, assignment: str) -> CourseAssignment | None:
    """Return an assignment of a course that is open or was closed; None if there is none."""
    course_assignments = open_assignments.list_assignments(session, course_id)
    is_opened = (each for each in course_assignments if each.assignment == assignment and each.opened_at is not None)
    return next(is_opened, None)


def is_assignment_open(session: Session, course_id: int, assignment: str) -> bool:
    """Return whether students can submit to an assignment of a course."""
    opened = find_opened_assignment(session, course_id, assignment)
    return opened is not None and opened.open


def load_visible_assignment(session: Session, course_id: int, enrolment_id: int, assignment: str) -> Assignment:
    """Return an assignment that was opened, or that the student has submitted to. Raises NotFound.

    A closed one is returned as the student submitted to it.
    """
    opened = find_opened_assignment(session, course_id, assignment)
    if opened is None or not opened.open:
        newest_attempts = own_submissions.load_own_attempts(session, enrolment_id, assignment).newest
        if newest_attempts:
            return stored_requests.load_assignment(session, newest_attempts[0].job_id)
    if opened is None:
        raise _build_not_found()
    return open_assignments.load_assignment(session, course_id, assignment)


def _require_enrolment_id(session: Session, actor: Actor, course_id: int) -> int:
    return require_own_enrolment(session, actor, course_id, Role.STUDENT).id


def _require_submission(session: Session, enrolment_id: int, submission_id: int) -> OwnSubmission:
    submission = own_submissions.find_own_submission(session, enrolment_id, submission_id)
    if submission is None:
        raise _build_not_found()
    return submission


def _add_queue_place(session: Session, submission: OwnSubmission) -> SubmissionView:
    return SubmissionView(submission, estimate_place(session, submission.job_id) if submission.waits else None)


def _load_result(
    service: Service, actor: Actor, course_id: int, submission_id: int, language: Language
) -> tuple[OwnSubmission, View]:
    with service.store.reading() as session:
        submission = _require_submission(session, _require_enrolment_id(session, actor, course_id), submission_id)
        if not submission.shown:
            raise _build_not_found()
        return submission, _load_student_view(session, submission, language)


def _load_student_view(session: Session, submission: OwnSubmission, language: Language) -> View:
    return build_student_view(results.load_grade(session, submission.job_id), submission.released, language)


def _build_not_found() -> NotFound:
    return NotFound("There is no such page or item, or you have no access to it.")
