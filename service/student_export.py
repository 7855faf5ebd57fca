"""All there is of one student, as they may see it, in one zip: who they are, what they submitted, what came of it.

What a student may see is ``service.reports.view``'s; nothing is removed here.
"""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Mapping, Sequence, Set
from typing import Any

from sqlalchemy import or_, select
from sqlalchemy.orm import Session

from service.report_files import report_alone
from service.reports.formats.json_output import json_document
from service.reports.view import student_view
from service.store.batches import batches
from service.store.courses import policies
from service.store.engine import Store
from service.store.grades import results
from service.store.models import Course, Enrolment, Extension, Job, Person, SubmissionRow
from service.store.people import membership
from service.store.states import JobState, Standing
from service.store.web_tables import Appeal, Credential


def export_student(store: Store, enrolment_id: int, without: Set[str] = frozenset()) -> bytes:
    """Return the zip, without the submissions for some assignments.

    Times and sizes would tell which rows with hidden names are the student's. So would the times of sign-ins and of the
    enrolment, which are left out with them.
    """
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED) as archive:
        with store.reading() as session:
            student = _student(session, enrolment_id) | ({} if without else _moments(session, enrolment_id))
            mine = (SubmissionRow.enrolment_id == enrolment_id, SubmissionRow.assignment.not_in(without))
            ids = session.scalars(select(SubmissionRow.id).where(*mine).order_by(SubmissionRow.id)).all()
        told = []
        for submission_id in ids:
            document, files = _submission(store, submission_id)
            folder = f"submissions/{re.sub('[^a-zA-Z0-9._-]', '_', document['assignment'])}-{document['attempt']}"
            for name, data in files.items():
                archive.writestr(f"{folder}/{name}", data)
            told.append({**document, "folder": folder})
        archive.writestr("student.json", _written({**student, "submissions": told}))
    return sink.getvalue()


def _student(session: Session, enrolment_id: int) -> dict[str, Any]:
    enrolment = session.get_one(Enrolment, enrolment_id)
    allowed = select(Extension).where(Extension.enrolment_id == enrolment_id).order_by(Extension.id)
    return {
        "course": session.get_one(Course, enrolment.course_id).name,
        "id": enrolment.student,
        "written": enrolment.written,
        "name": enrolment.name,
        "email": enrolment.email,
        "role": enrolment.role.value,
        "extensions": [_columns(row, ("assignment", "due_at", "more_attempts")) for row in session.scalars(allowed)],
    }


def _moments(session: Session, enrolment_id: int) -> dict[str, Any]:
    """When a student came and signed in, as far as it belongs to this course."""
    enrolment = session.get_one(Enrolment, enrolment_id)
    person = session.get_one(Person, enrolment.person_id)
    here = Credential.course_id == enrolment.course_id
    if not membership.is_more_than(session, enrolment):
        # One course is all they have, so what reaches everywhere reaches this course alone.
        here = or_(here, Credential.course_id.is_(None))
    signs_in = select(Credential).where(Credential.person_id == person.id, here).order_by(Credential.created_at)
    names = ("kind", "name", "created_at", "expires_at", "used_at", "revoked_at")
    return {
        "since": person.created_at.date(),
        "signed_in_with": [_columns(row, names) for row in session.scalars(signs_in)],
    }


def _submission(store: Store, submission_id: int) -> tuple[dict[str, Any], dict[str, bytes]]:
    """What is told of a submission, and its files: what was submitted, and the grade where its student may see it."""
    with store.reading() as session:
        row = session.get_one(SubmissionRow, submission_id)
        asked = select(Appeal).where(Appeal.submission_id == submission_id).order_by(Appeal.id)
        names = ("assignment", "attempt", "source", "sha256", "created_at", "submitted_at", "days_late", "staff_only")
        appeals = [_columns(each, ("text", "asked_at", "answer", "answered_at")) for each in session.scalars(asked)]
        document = {**_columns(row, names), "appeals": appeals}
        files = {"submission.zip": row.packed}
        stands = (Job.submission_id == submission_id, Job.standing == Standing.STANDS, Job.state == JobState.DONE)
        job_id = session.scalar(select(Job.id).where(*stands, Job.suspect.is_(None)))
        if job_id is None or row.staff_only is not None:
            return document, files
        view = student_view(results.load(session, job_id), policies.released(session, job_id))
        line = batches.job_line(session, job_id)
    files["grade.json"] = _written(json_document(view))
    files["report.html"] = report_alone(store, line, view).encode()
    return document, files


def _columns(row: object, names: Sequence[str]) -> dict[str, Any]:
    return {name: getattr(row, name) for name in names}


def _written(document: Mapping[str, Any]) -> bytes:
    return (json.dumps(document, indent=2, default=str) + "\n").encode()
