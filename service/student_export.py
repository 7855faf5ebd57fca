"""Export of one student's data as a zip: personal data, submissions, test runs and results, as visible to the student.

``service.reports.view`` decides on visibility; nothing is removed here.
"""

from __future__ import annotations

import io
import json
import re
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import asdict
from typing import Any

from sqlalchemy import ColumnElement, and_, or_, select
from sqlalchemy.orm import Session

from service.notebook_engine.stored_requests import list_stored_files
from service.report_files import render_each_report
from service.reports.formats.json_output import build_json_document
from service.reports.view import View, build_student_view
from service.store.batches.rejected_files import load_rejected_files
from service.store.courses import policies
from service.store.engine import Store, now
from service.store.grades import current_grades, results
from service.store.people import membership
from service.store.queue.run_programs import split_program
from service.store.queue.test_runs import NOTEBOOK_CHECKS, NOTEBOOK_RUNS
from service.store.tables.courses import AssignmentVersion, Course, Extension
from service.store.tables.grades import Appeal
from service.store.tables.people import Credential, Enrolment, Person
from service.store.tables.submissions import Job, SubmissionRow, Tryout

#: Number of submissions fetched at once.
_CHUNK_SIZE = 10


def export_student(store: Store, enrolment_id: int, hidden_assignments: Set[str] = frozenset()) -> bytes:
    """Return the zip, without the submissions to the assignments in ``hidden_assignments``.

    With such assignments, times of sign-ins and of the enrolment are left out, too. Like times and sizes of
    submissions, they could identify the student's rows among hidden names.
    """
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED) as archive, store.reading() as session:
        query = select(Enrolment, Course.name, Person).join(Course, Enrolment.course_id == Course.id)
        query = query.join(Person, Enrolment.person_id == Person.id).where(Enrolment.id == enrolment_id)
        enrolment, course, person = session.execute(query).one()
        student = _build_student(session, enrolment, course) | (
            {} if hidden_assignments else _load_times(session, enrolment, person)
        )
        condition = and_(
            SubmissionRow.enrolment_id == enrolment_id, SubmissionRow.assignment.not_in(hidden_assignments)
        )
        folders, documents = {}, []
        for submission_id, document, packed_submission in _load_submissions(session, condition):
            folder = f"submissions/{_clean_name(document['assignment'])}-{document['attempt']}"
            archive.writestr(f"{folder}/submission.zip", packed_submission, zipfile.ZIP_STORED)
            folders[submission_id] = folder
            documents.append({**document, "folder": folder})
        for submission_id, view, report in _load_seen_grades(session, condition):
            archive.writestr(f"{folders[submission_id]}/grade.json", _encode_json(build_json_document(view)))
            archive.writestr(f"{folders[submission_id]}/report.html", report)
        runs = []
        for number, (document, files) in enumerate(_load_test_runs(session, enrolment_id, hidden_assignments), 1):
            folder = f"test-runs/{_clean_name(document['assignment'])}-{number}"
            for name, data in files.items():
                archive.writestr(f"{folder}/{name}", data)
            runs.append({**document, "folder": folder})
        rejected = _load_rejected_files(session, enrolment, hidden_assignments)
        document = {**student, "submissions": documents, "test_runs": runs, "rejected_files": rejected}
        archive.writestr("student.json", _encode_json(document))
    return sink.getvalue()


def _build_student(session: Session, enrolment: Enrolment, course: str) -> dict[str, Any]:
    extension_query = select(Extension).where(Extension.enrolment_id == enrolment.id).order_by(Extension.id)
    return {
        "course": course,
        "id": enrolment.student,
        "written": enrolment.written,
        "name": enrolment.name,
        "email": enrolment.email,
        "role": enrolment.role.value,
        "extensions": [
            _read_columns(row, ("assignment", "due_at", "more_attempts")) for row in session.scalars(extension_query)
        ],
    }


def _load_times(session: Session, enrolment: Enrolment, person: Person) -> dict[str, Any]:
    """Return the times of enrolment and sign-ins that belong to this course."""
    is_course_credential = Credential.course_id == enrolment.course_id
    if not membership.has_other_access(session, enrolment):
        # The student has only this course, so unlimited credentials belong to it, too.
        is_course_credential = or_(is_course_credential, Credential.course_id.is_(None))
    query = (
        select(Credential)
        .where(Credential.person_id == person.id, is_course_credential)
        .order_by(Credential.created_at)
    )
    names = ("kind", "name", "created_at", "expires_at", "used_at", "revoked_at")
    return {
        "since": person.created_at.date(),
        "signed_in_with": [_read_columns(row, names) for row in session.scalars(query)],
    }


def _load_submissions(session: Session, condition: ColumnElement[bool]) -> Iterator[tuple[int, dict[str, Any], bytes]]:
    """Yield the id, the data and the packed files of each submission, ordered by id."""
    appeal_query = select(Appeal).join(SubmissionRow, Appeal.submission_id == SubmissionRow.id).where(condition)
    appeals: dict[int, list[Appeal]] = {}
    for appeal in session.scalars(appeal_query.order_by(Appeal.id)):
        appeals.setdefault(appeal.submission_id, []).append(appeal)
    names = ("assignment", "attempt", "source", "sha256", "created_at", "submitted_at", "days_late", "staff_only")
    columns = ("text", "asked_at", "answer", "answered_at")
    query = select(SubmissionRow, SubmissionRow.packed).where(condition).order_by(SubmissionRow.id)
    for row, packed_submission in session.execute(query, execution_options={"yield_per": _CHUNK_SIZE}):
        appeal_fields = [_read_columns(each, columns) for each in appeals.get(row.id, ())]
        yield row.id, {**_read_columns(row, names), "appeals": appeal_fields}, packed_submission


def _load_seen_grades(session: Session, condition: ColumnElement[bool]) -> Iterator[tuple[int, View, str]]:
    """Yield the id, view and report of each submission whose grade the student may see."""
    query = select(Job.id, Job.submission_id).join(SubmissionRow, Job.submission_id == SubmissionRow.id)
    is_seen = (condition, *current_grades.CAN_COUNT, policies.match_released(now(session)))
    submission_of = dict(session.execute(query.where(*is_seen)).all())
    visibilities = policies.load_visibilities_by_job(session, submission_of)
    grades = results.load_each_grade(session, submission_of)
    views = ((job_id, build_student_view(grade, visibilities[job_id])) for job_id, grade in grades)
    for job_id, view, report in render_each_report(session, views, submission_of):
        yield submission_of[job_id], view, report


def _load_test_runs(
    session: Session, enrolment_id: int, without: Set[str]
) -> Iterator[tuple[dict[str, Any], dict[str, bytes]]]:
    """Yield the data and the files of each stored test run, oldest first."""
    query = select(Tryout, AssignmentVersion.assignment, Tryout.packed, Tryout.replay)
    query = query.join(AssignmentVersion, Tryout.assignment_version_id == AssignmentVersion.id)
    # A check can be of any assignment.
    left_out = {*without, NOTEBOOK_CHECKS} if without else without
    query = query.where(Tryout.enrolment_id == enrolment_id, AssignmentVersion.assignment.not_in(left_out))
    names = ("state", "queued_at", "finished_at", "words", "error")
    ordered = query.order_by(Tryout.queued_at, Tryout.id)
    for row, assignment, packed, replay in session.execute(ordered, execution_options={"yield_per": _CHUNK_SIZE}):
        files = list_stored_files(split_program(packed)[0]) if packed else {}
        if replay:
            files["result.json" if assignment in (NOTEBOOK_RUNS, NOTEBOOK_CHECKS) else "replay.json"] = zlib.decompress(
                replay
            )
        yield {"assignment": assignment, **_read_columns(row, names)}, files


def _load_rejected_files(session: Session, enrolment: Enrolment, without: Set[str]) -> list[dict[str, Any]]:
    """Return the student's rejected files.

    With assignments in ``without``, files without a known assignment are left out, too.
    """
    return [
        asdict(each)
        for each in load_rejected_files(session, enrolment)
        if not (without and each.assignment in {"", *without})
    ]


def _clean_name(text: str) -> str:
    return re.sub("[^a-zA-Z0-9._-]", "_", text)


def _read_columns(row: object, names: Sequence[str]) -> dict[str, Any]:
    return {name: getattr(row, name) for name in names}


def _encode_json(document: Mapping[str, Any]) -> bytes:
    return (json.dumps(document, indent=2, default=str) + "\n").encode()
