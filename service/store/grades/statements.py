"""Statements on published grades: each change of a published mark is appended to the log, in its transaction.

``service.statements`` defines the formats. The callers are publishing, marking, completions of pools and quarantine.
"""

from __future__ import annotations

import secrets
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from functools import lru_cache
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.statements.facts import (
    OPENING_KEY_BYTES,
    Fact,
    FactKind,
    OpenFact,
    commit_to_values,
    encode_value,
    open_fact,
)
from service.statements.statement import Change, format_moment, name_entries
from service.store.grades import overrides
from service.store.statement_log import Draft, append_entries, load_newest_entry
from service.store.states import JobState, Standing
from service.store.tables.courses import AssignmentVersion, Course
from service.store.tables.grades import CriterionResultRow, TrialRow
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Job, SubmissionRow
from sim.readers.json_text import read_json

_CHUNK_SIZE = 200
_CACHE_SIZE = 10_000


@dataclass(slots=True)
class GradeFacts:
    """The values of the facts of a stored grade as it counts, by kind, each as the JSON of its commitment."""

    values: dict[FactKind, list[str]] = field(default_factory=lambda: {kind: [] for kind in FactKind})

    def open_facts(self, opening_key: bytes, *kinds: FactKind) -> tuple[OpenFact, ...]:
        """Return the facts of these kinds with their salts."""
        return tuple(
            open_fact(Fact(kind, number, read_json(value)), opening_key)
            for kind in kinds
            for number, value in enumerate(self.values[kind], 1)
        )

    def commit(self, opening_key: bytes, *kinds: FactKind) -> dict[str, Any]:
        """Return the commitments of a statement to the facts of these kinds."""
        return {kind.value: commit_to_values(kind, self.values[kind], opening_key) for kind in kinds}


def state_publication(session: Session, job_ids: Collection[str]) -> None:
    """Append a statement for each of these grades, which were published or replace published ones."""
    session.flush()
    drafts = []
    for chunk in _split(sorted(job_ids)):
        facts_by_job = load_facts(session, chunk)
        rows = session.execute(_SELECT_SUBJECT.where(Job.id.in_(chunk)).order_by(Job.id))
        drafts += [_build_draft(row, facts_by_job[row[0].id]) for row in rows]
    append_entries(session, drafts)


def state_change(session: Session, submission_id: int) -> None:
    """Append a statement for the published grade of a submission after its marks changed, if it has one."""
    published_job = session.scalar(
        select(Job).where(
            Job.submission_id == submission_id,
            Job.standing == Standing.STANDS,
            Job.published_at.is_not(None),
            Job.state == JobState.DONE,
        )
    )
    if published_job is not None:
        state_publication(session, [published_job.id])


def state_withdrawal(session: Session, submission_ids: Collection[int], reason: str) -> None:
    """Append a statement that the published grade of each of these submissions is no longer valid."""
    drafts = []
    for submission_id in sorted(submission_ids):
        entry = load_newest_entry(session, submission_id)
        if entry is not None:
            subjects = name_entries([(entry.number, entry.leaf_sha256)])
            predicate = {"grade": entry.job_id, "reason": reason}
            drafts.append(Draft(Change.WITHDRAWN, subjects, predicate, submission_id, entry.job_id))
    append_entries(session, drafts)


def load_facts(session: Session, job_ids: Collection[str]) -> dict[str, GradeFacts]:
    """Return the facts of grades by job, read in four statements."""
    facts_by_job = load_marks_facts(session, job_ids)
    trial = TrialRow
    columns = (trial.job_id, trial.scenario, trial.scenario_index, trial.seed, trial.sha256)
    query = select(*columns).where(trial.job_id.in_(job_ids)).order_by(trial.job_id, trial.position)
    for job_id, scenario, index, seed, recording_sha256 in session.execute(query):
        value = {"scenario": scenario, "index": index, "seed": seed, "recording_sha256": recording_sha256}
        facts_by_job[job_id].values[FactKind.TRIAL].append(encode_value(value))
    return facts_by_job


def load_marks_facts(session: Session, job_ids: Collection[str]) -> dict[str, GradeFacts]:
    """Return the facts of grades by job, without those on trials."""
    facts_by_job = {}
    totals_query = select(Job.id, Job.marks, Job.max_marks, Job.provisional).where(Job.id.in_(job_ids))
    for job_id, marks, max_marks, provisional in session.execute(totals_query):
        facts_by_job[job_id] = GradeFacts()
        facts_by_job[job_id].values[FactKind.TOTAL].append(_encode_total(marks, max_marks, provisional))
    overrides_by_job = overrides.load_overrides(session, job_ids)
    row = CriterionResultRow
    columns = (row.job_id, row.criterion, row.title, row.marks, row.max_marks, row.visibility)
    query = select(*columns).where(row.job_id.in_(job_ids)).order_by(row.job_id, row.position)
    for job_id, criterion, title, marks, worth, visibility in session.connection().execute(query):
        override = overrides_by_job.get(job_id, {}).get(criterion)
        effective_marks, max_marks = (marks, worth) if override is None else override.compute_marks(worth)
        value = _encode_criterion(criterion, title, effective_marks, max_marks, override is not None)
        kind = FactKind.HIDDEN_CRITERION if visibility == "hidden" else FactKind.CRITERION
        facts_by_job[job_id].values[kind].append(value)
    return facts_by_job


# Students of a class get the same marks for the same criteria again and again.
@lru_cache(_CACHE_SIZE)
def _encode_total(marks: Decimal, max_marks: Decimal, is_provisional: bool) -> str:
    return encode_value({"marks": _format(marks), "max_marks": _format(max_marks), "provisional": is_provisional})


@lru_cache(_CACHE_SIZE)
def _encode_criterion(criterion: str, title: str, marks: Decimal, max_marks: Decimal, is_set_by_staff: bool) -> str:
    value = {"id": criterion, "title": title, "marks": _format(marks), "max_marks": _format(max_marks)}
    return encode_value({**value, "set_by_staff": is_set_by_staff})


_SELECT_SUBJECT = (
    select(Job, SubmissionRow, Enrolment.student, Course.name, AssignmentVersion)
    .join(SubmissionRow, Job.submission_id == SubmissionRow.id)
    .join(Enrolment, SubmissionRow.enrolment_id == Enrolment.id)
    .join(Course, Enrolment.course_id == Course.id)
    .join(AssignmentVersion, Job.assignment_version_id == AssignmentVersion.id)
)


def _build_draft(row: Any, facts: GradeFacts) -> Draft:
    job, submission, student, course, version = row
    opening_key = secrets.token_bytes(OPENING_KEY_BYTES)
    predicate = {
        "grade": job.id,
        "course": course,
        "student": student,
        "assignment": {"id": version.assignment, "version": version.version},
        "attempt": submission.attempt,
        "submitted_at": format_moment(submission.submitted_at or submission.created_at),
        "graded_at": None if job.graded_at is None else format_moment(job.graded_at),
        "published_at": format_moment(job.published_at),
        "grader": {"version": job.grader_version, "sha256": job.grader_sha256},
        "commitments": facts.commit(opening_key, *FactKind),
    }
    subjects = {"submission": submission.sha256}
    return Draft(Change.PUBLISHED, subjects, predicate, submission.id, job.id, opening_key)


def _format(marks: Decimal) -> str:
    """Return marks as text without trailing zeros: databases store the digits differently."""
    return f"{marks.normalize():f}"


def _split(job_ids: Sequence[str]) -> list[Sequence[str]]:
    return [job_ids[start : start + _CHUNK_SIZE] for start in range(0, len(job_ids), _CHUNK_SIZE)]
