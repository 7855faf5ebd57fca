"""A grade as staff see it: state, report, replay, neighbouring grades, and submitted files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from sqlalchemy.orm import Session

from service.language import ENGLISH, Language
from service.operations.context import Actor, Service
from service.operations.errors import NotFound
from service.operations.lookup import load_names_for_actor, require_course, require_job, require_submission
from service.plotting import load_own_floors
from service.report_files import render_report_body, render_standalone_report
from service.reports.html import ReportParts
from service.reports.replay.document import build_grade_replay
from service.reports.view import View, build_staff_view, build_student_view
from service.store import audit
from service.store.audit import AuditEntry
from service.store.batches import batch_table, job_lines, regrade_changes, regrades, stored_requests
from service.store.batches.changes import Change
from service.store.batches.job_lines import JobLine
from service.store.batches.regrades import GradingLine
from service.store.courses import policies
from service.store.courses.hidden_names import HiddenNames
from service.store.grades import own_gradings, results
from service.store.grades.own_gradings import OwnGrading
from service.store.states import CancelReason, JobState, Role
from service.store.tables.submissions import Job


@dataclass(frozen=True, slots=True)
class Neighbours:
    """The ids of the previous and next grade in the table of a batch; empty if there is none."""

    before: str = ""
    after: str = ""


@dataclass(frozen=True, slots=True)
class GradeView:
    """A grade with its report, if any, the other grades of its submission, and its activity log."""

    line: JobLine
    batch_id: str | None  # the batch that it was graded in
    report: ReportParts | None
    change: Change | None  # of a regrade
    gradings: list[GradingLine]
    attempts: list[OwnGrading]
    history: list[AuditEntry]
    awaits_approval: bool  # over a limit, and not graded until staff ask for it
    neighbours: Neighbours


@dataclass(frozen=True, slots=True)
class StudentReport:
    """A grade with the report that its student sees when it is published."""

    line: JobLine
    report: ReportParts


@dataclass(frozen=True, slots=True)
class SubmittedFiles:
    """Submitted files, as a zip that can be submitted again."""

    data: bytes
    name: str


def show_state(service: Service, actor: Actor, course_id: int, job_id: str) -> JobLine:
    """Return the state of one grading. Raises NotFound."""
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        _require_course_job(session, actor, course_id, job_id)
        return job_lines.load_job_line(session, job_id).hide_name(hidden_names)


def show_grade(service: Service, actor: Actor, course_id: int, job_id: str, language: Language = ENGLISH) -> GradeView:
    """Return one grade with the data of its page. Raises NotFound."""
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        row = _require_course_job(session, actor, course_id, job_id)
        named_line = job_lines.load_job_line(session, job_id)
        line = named_line.hide_name(hidden_names)
        change = regrade_changes.load_change(session, job_id)
        gradings = regrades.load_gradings(session, row.submission_id)
        attempts = own_gradings.list_newest_gradings(session, row.enrolment_id, line.assignment)
        view = _load_staff_view(session, line, language) if line.state is JobState.DONE else None
        history = audit.load_entries(session, "job", job_id)
        neighbours = _find_neighbours(session, row, hidden_names)
    report = None if view is None else render_report_body(service.store, named_line.id, named_line.plots, view)
    is_put_aside = line.state is JobState.CANCELLED and line.cancelled_for is CancelReason.OVER_LIMIT
    return GradeView(line, row.batch_id, report, change, gradings, attempts, history, is_put_aside, neighbours)


def show_neighbours(service: Service, actor: Actor, course_id: int, job_id: str) -> Neighbours:
    """Return the previous and next grade in the order of the table that the actor sees. Raises NotFound."""
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        return _find_neighbours(session, _require_course_job(session, actor, course_id, job_id), hidden_names)


def show_result(service: Service, actor: Actor, course_id: int, job_id: str) -> View:
    """Return a grade including hidden criteria and trials. Raises NotFound, also before it is graded."""
    return _load_result(service, actor, course_id, job_id, ENGLISH)[1]


def show_report(service: Service, actor: Actor, course_id: int, job_id: str, language: Language = ENGLISH) -> str:
    """Return the report of a grade as a standalone page. Raises NotFound, also before it is graded."""
    line, view = _load_result(service, actor, course_id, job_id, language)
    return render_standalone_report(service.store, line.id, line.plots, view)


def show_student_report(
    service: Service, actor: Actor, course_id: int, job_id: str, language: Language = ENGLISH
) -> StudentReport:
    """Return the report that the student sees of a published grade. Raises NotFound, also before it is graded."""
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        line = _load_graded_line(session, actor, course_id, job_id, hidden_names)
        named_grade = replace(results.load_grade(session, line.id), student=line.student)
    view = build_student_view(named_grade, policies.PUBLISHED_VISIBILITIES, language)
    return StudentReport(line, render_report_body(service.store, line.id, line.plots, view))


def show_replay(service: Service, actor: Actor, course_id: int, job_id: str) -> dict[str, Any]:
    """Return the replay data of the grade's trials. Raises NotFound, also before it is graded."""
    _, view = _load_result(service, actor, course_id, job_id, ENGLISH)
    with service.store.reading() as session:
        return build_replay_document(session, job_id, view)


def show_files(service: Service, actor: Actor, course_id: int, submission_id: int) -> SubmittedFiles:
    """Return the submitted files, which can name the student. Raises NotFound, also if names are hidden."""
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        row = require_submission(session, course_id, submission_id)
        if row.assignment in hidden_names.assignments:
            raise NotFound("There is no such page or item, or you have no access to it.")
        return SubmittedFiles(row.packed, f"submission-{row.id}.zip")


def build_replay_document(session: Session, job_id: str, view: View) -> dict[str, Any]:
    """Return the replay data of the trials in a view of a job's grade."""
    submission = stored_requests.load_submission(session, job_id)
    return build_grade_replay(view, submission, load_own_floors(stored_requests.load_assignment(session, job_id)))


def _require_course_job(session: Session, actor: Actor, course_id: int, job_id: str) -> Job:
    require_course(session, actor, course_id, Role.INSTRUCTOR)
    return require_job(session, course_id, job_id)


def _find_neighbours(session: Session, row: Job, hidden_names: HiddenNames) -> Neighbours:
    if row.batch_id is None:
        return Neighbours()
    job_ids = [line.id for line in batch_table.load_table_lines(session, row.batch_id, (), hidden_names) if line.id]
    if row.id not in job_ids:
        return Neighbours()
    index = job_ids.index(row.id)
    return Neighbours(job_ids[index - 1] if index else "", job_ids[index + 1] if index + 1 < len(job_ids) else "")


def _load_result(
    service: Service, actor: Actor, course_id: int, job_id: str, language: Language
) -> tuple[JobLine, View]:
    hidden_names: HiddenNames = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        line = _load_graded_line(session, actor, course_id, job_id, hidden_names)
        return line, _load_staff_view(session, line, language)


def _load_graded_line(
    session: Session, actor: Actor, course_id: int, job_id: str, hidden_names: HiddenNames
) -> JobLine:
    _require_course_job(session, actor, course_id, job_id)
    line = job_lines.load_job_line(session, job_id).hide_name(hidden_names)
    if line.state is not JobState.DONE:
        raise NotFound("There is no such page or item, or you have no access to it.")
    return line


def _load_staff_view(session: Session, line: JobLine, language: Language) -> View:
    return build_staff_view(replace(results.load_grade(session, line.id), student=line.student), language)
