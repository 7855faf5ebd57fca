"""Causes of lost marks that reruns showed: claiming the grades that have none yet, storing and loading the causes.

Causes follow the marks and do not affect them. They are a file of the job. A claim stores it without causes, so each
grade is explained at most once, even if its explanation ends the process.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, replace
from datetime import timedelta
from typing import Any

from sqlalchemy import ColumnElement, delete, exists, func, select
from sqlalchemy.orm import Session

from service.grading.grade import Grade, ShownCause
from service.store.artifacts import File, load_each_files, store_files
from service.store.engine import Store, now, retry_conflicts
from service.store.grades.grade_sentences import encode_sentences, restore_sentences
from service.store.revision import needs_newer_code
from service.store.states import JobQueue, JobState
from service.store.tables.grades import Artifact
from service.store.tables.submissions import Job, SubmissionRow

CAUSES_NAME = "causes.json"
#: Older grades are not explained, for example after an upgrade.
_MAX_AGE = timedelta(hours=6)
_MAX_COUNT = 100


@dataclass(frozen=True, slots=True)
class StoredCauses:
    """The causes of a grade, and how many causes in hidden trials its student sees because of it."""

    causes: tuple[ShownCause, ...]
    revealed: int = 0


@retry_conflicts
def claim_unexplained_grade(store: Store) -> str | None:
    """Claim the newest grade with lost marks whose causes were not searched yet; None if there is none."""
    with store.transaction() as session:
        if needs_newer_code(session):
            return None
        query = select(Job.id).where(*_build_conditions(session)).order_by(Job.finished_at.desc(), Job.id).limit(1)
        job_id = session.scalar(query.with_for_update(skip_locked=True, key_share=True, of=Job))
        if job_id is not None:
            store_files(session, job_id, [_build_file(StoredCauses(()))], now(session))
        return job_id


def count_unexplained_grades(store: Store) -> int:
    """Return the number of grades that ``claim_unexplained_grade`` returns, at most 100."""
    with store.reading() as session:
        unexplained = select(Job.id).where(*_build_conditions(session)).limit(_MAX_COUNT).subquery()
        return session.scalar(select(func.count()).select_from(unexplained)) or 0


def _build_conditions(session: Session) -> tuple[ColumnElement[bool], ...]:
    has_causes = exists().where(Artifact.job_id == Job.id, Artifact.name == CAUSES_NAME)
    return (
        Job.state == JobState.DONE,
        Job.lane.in_(tuple(JobQueue)),  # so that an index serves the next condition
        Job.due_at > now(session) - _MAX_AGE,
        Job.marks < Job.max_marks,
        ~has_causes,
    )


@retry_conflicts
def release_grade(store: Store, job_id: str) -> None:
    """Undo the claim of a grade whose search was interrupted, so that it is searched later."""
    with store.transaction() as session:
        session.execute(delete(Artifact).where(Artifact.job_id == job_id, Artifact.name == CAUSES_NAME))


@retry_conflicts
def store_causes(store: Store, job_id: str, stored_causes: StoredCauses) -> None:
    """Store the causes of a grade."""
    with store.transaction() as session:
        store_files(session, job_id, [_build_file(stored_causes)], now(session))


def load_causes(session: Session, job_ids: Collection[str]) -> dict[str, StoredCauses]:
    """Return the causes by job, without jobs whose causes were not searched. Executes at most one statement."""
    if not job_ids:
        return {}
    return {
        job_id: read_causes(files[CAUSES_NAME])
        for job_id, files in load_each_files(session, job_ids, prefix=CAUSES_NAME)
        if CAUSES_NAME in files
    }


def count_revealed_causes(session: Session, job_id: str) -> int:
    """Return how many causes in hidden trials the student of a job sees in other grades for the same assignment."""
    submission = select(SubmissionRow.enrolment_id, SubmissionRow.assignment).join(
        Job, Job.submission_id == SubmissionRow.id
    )
    enrolment_id, assignment = session.execute(submission.where(Job.id == job_id)).one()
    query = (
        select(Job.id)
        .join(SubmissionRow, Job.submission_id == SubmissionRow.id)
        .where(SubmissionRow.enrolment_id == enrolment_id, SubmissionRow.assignment == assignment, Job.id != job_id)
    )
    stored_causes = load_causes(session, session.scalars(query).all())
    return sum(each.revealed for each in stored_causes.values())


def _build_file(stored_causes: StoredCauses) -> File:
    grade = replace(_EMPTY_GRADE, causes=stored_causes.causes)
    document = {
        "causes": [asdict(each) for each in stored_causes.causes],
        "sentences": encode_sentences(grade),
        "revealed": stored_causes.revealed,
    }
    return File(CAUSES_NAME, "application/json", json.dumps(document).encode())


def read_causes(file: File) -> StoredCauses:
    """Return the causes in a file of a job."""
    document: Mapping[str, Any] = json.loads(file.data)
    causes = tuple(ShownCause(**{**each, "files": tuple(each["files"])}) for each in document["causes"])
    grade = restore_sentences(replace(_EMPTY_GRADE, causes=causes), document["sentences"])
    return StoredCauses(grade.causes, document["revealed"])


_EMPTY_GRADE = Grade(
    assignment="",
    assignment_title="",
    assignment_version="",
    submission="",
    student="",
    criteria=(),
    trials=(),
    sandbox="",
    grader_version="",
)
