"""Result cache: the same submission, assignment, seeds and grader give the same marks, without another run.

A copy has its own rows and names the original grade. This module decides which grades can be copied, not when.
"""

from __future__ import annotations

import hashlib
from datetime import datetime
from typing import Any

from sqlalchemy import exists, insert, literal, select
from sqlalchemy.orm import Session

from service.store import phases
from service.store.grades import current_grades
from service.store.grades.causes import CAUSES_NAME
from service.store.states import PlotState
from service.store.tables.courses import AssignmentVersion
from service.store.tables.grades import Artifact, CriterionResultRow, TrialRow
from service.store.tables.installation import Worker
from service.store.tables.submissions import Job, SubmissionRow

#: The end of such a trial depends on the machine and its load, so another run may differ.
_NOT_REPEATABLE = ("cpu_limit", "memory_limit", "stalled", "host_error")


def compute_cache_key(session: Session, job_id: str, grader_sha256: str, secret_sha256: str) -> str:
    """Return the cache key of a job. Equal keys mean equal grades: assignment and secret determine the seeds."""
    query = (
        select(SubmissionRow.sha256, AssignmentVersion.sha256, Job.whole_pools)
        .join(Job, Job.submission_id == SubmissionRow.id)
        .join(AssignmentVersion, Job.assignment_version_id == AssignmentVersion.id)
        .where(Job.id == job_id)
    )
    submission_sha256, assignment_sha256, whole_pools = session.execute(query).one()
    key = combine_cache_key(submission_sha256, assignment_sha256, grader_sha256, secret_sha256)
    return hashlib.sha256(f"{key}\nwhole pools".encode()).hexdigest() if whole_pools else key


def combine_cache_key(submission_sha256: str, assignment_sha256: str, grader_sha256: str, secret_sha256: str) -> str:
    """Return the cache key from its parts, for submissions without a job."""
    parts = (submission_sha256, assignment_sha256, grader_sha256, secret_sha256)
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def find_cached_grade(session: Session, key: str) -> str | None:
    """Return the newest grade that may be copied for this key; None if it must be run.

    Never returns a grade made without the sandbox or by a quarantined worker, cut short by a limit of the machine, or
    with unjudged criteria.
    """
    has_quarantined_worker = exists().where(Worker.name == Job.worker, Worker.quarantined_at.is_not(None))
    has_cut_trial = exists().where(TrialRow.job_id == Job.id, TrialRow.verdict.in_(_NOT_REPEATABLE))
    has_unjudged_criterion = exists().where(
        CriterionResultRow.job_id == Job.id, CriterionResultRow.unjudged.is_not(None)
    )
    query = (
        select(Job.id)
        .where(
            Job.cache_key == key,
            *current_grades.IS_TRUSTED,
            Job.copied_from.is_(None),
            # The key includes the sandbox policy; these conditions require both layers to be active.
            Job.sandbox.contains("Landlock"),
            Job.sandbox.contains("seccomp"),
            ~has_quarantined_worker,
            ~has_cut_trial,
            ~has_unjudged_criterion,
        )
        .order_by(Job.finished_at.desc(), Job.id)
        .limit(1)
    )
    return session.scalar(query)


def copy_rows(session: Session, source_id: str, job_id: str) -> None:
    """Copy the rows of a grade to another job that has none."""
    for table in (TrialRow, CriterionResultRow, Artifact):
        columns = table.__table__.columns
        copied_columns = [column for column in columns if column.name not in ("id", "job_id")]
        rows = select(literal(job_id), *copied_columns).where(columns["job_id"] == source_id)
        if table is Artifact:
            # What causes reveal of hidden trials is counted for each student.
            rows = rows.where(columns["name"] != CAUSES_NAME)
        session.execute(insert(table).from_select(["job_id", *(column.name for column in copied_columns)], rows))


def build_copied_values(session: Session, source_id: str, job_id: str, current_time: datetime) -> dict[str, Any]:
    """Return the column values that a job takes over from a copied grade."""
    source = session.scalars(select(Job).where(Job.id == source_id)).one()
    queued_at = session.scalar(select(Job.queued_at).where(Job.id == job_id))
    grade_columns = ("verdict", "sandbox", "grader_version", "missing", "hints", "sentences", "provisional", "cost")
    names = (*grade_columns, "grader_sha256", "secret_sha256", "cache_key")
    has_plots = source.plots is PlotState.DONE
    return {name: getattr(source, name) for name in names} | {
        "notes": _merge_notes(session, source, job_id),
        "copied_from": source_id,
        "graded_at": current_time,
        "phases": phases.encode_times({phases.QUEUED: queued_at, phases.COMMITTED: current_time}),
        "plots": PlotState.DONE if has_plots else PlotState.DUE,
        "plots_due_at": None if has_plots else current_time,
        "plotted_at": current_time if has_plots else None,
    }


def _merge_notes(session: Session, source: Job, job_id: str) -> list[str]:
    """Return the notes of reading this submission, then those of the grading.

    The notes of reading the other submission are left out, because they may name its folder.
    """
    from submissions.stored_submission import unpack_submission

    packed_query = select(SubmissionRow.packed).join(Job, Job.submission_id == SubmissionRow.id)
    source_notes, own_notes = (
        unpack_submission(session.scalars(packed_query.where(Job.id == each)).one()).notes
        for each in (source.id, job_id)
    )
    return [*own_notes, *(note for note in source.notes if note not in source_notes)]
