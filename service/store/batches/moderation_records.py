"""Records for the moderation sheet of a batch: versions, overrides with withdrawn ones, appeals, the head of the log.

Read-only. The conditions select the jobs of the sheet, so that no statement has a list of ids.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal

from sqlalchemy import ColumnElement, and_, func, select
from sqlalchemy.orm import Session

from service.store.batches.job_lines import match_standing_jobs
from service.store.states import JobState
from service.store.tables.courses import AssignmentVersion
from service.store.tables.grades import Appeal, CriterionResultRow, Override
from service.store.tables.people import Enrolment
from service.store.tables.statements import StatementHead
from service.store.tables.submissions import Job, SubmissionRow

Conditions = Sequence[ColumnElement[bool]]


@dataclass(frozen=True, slots=True)
class VersionRecord:
    """The versions that made the grades of ``count`` submissions."""

    assignment: str  # hash of the assignment's folder
    grader: str  # release
    grader_sha256: str
    sandbox: str
    count: int


@dataclass(frozen=True, slots=True)
class OverrideRecord:
    """An override of a criterion, in force or withdrawn. ``student`` is the id."""

    student: str
    criterion: str
    title: str  # of the criterion; its id if the grade no longer has it
    graded: Decimal | None  # marks of the grader; None if it could not be judged
    marks: Decimal | None  # None: excused
    reason: str
    actor: str
    made_at: datetime
    withdrawn_at: datetime | None


@dataclass(frozen=True, slots=True)
class AppealRecord:
    """An appeal, answered or open. ``student`` is the id."""

    student: str
    text: str
    asked_at: datetime
    answer: str | None
    actor: str | None
    answered_at: datetime | None


@dataclass(frozen=True, slots=True)
class LogHeadRecord:
    """The newest head of the log of statements that was written to be filed."""

    size: int
    root_sha256: str
    made_at: datetime


def match_sheet_jobs(session: Session, batch_id: str, assignment: str) -> Conditions:
    """Return the conditions that select the standing jobs of an assignment in a batch."""
    own_submissions = select(SubmissionRow.id).where(SubmissionRow.assignment == assignment)
    return (*match_standing_jobs(session, batch_id), Job.submission_id.in_(own_submissions))


def load_versions(session: Session, conditions: Conditions) -> list[VersionRecord]:
    """Return the versions that made the grades, most common first."""
    columns = (AssignmentVersion.version, Job.grader_version, Job.grader_sha256, Job.sandbox)
    query = (
        select(*columns, func.count())
        .join(AssignmentVersion, Job.assignment_version_id == AssignmentVersion.id)
        .where(*conditions, Job.state == JobState.DONE)
        .group_by(*columns)
        .order_by(func.count().desc(), *columns)
    )
    return [
        VersionRecord(version, release or "", grader or "", sandbox or "", count)
        for version, release, grader, sandbox, count in session.execute(query)
    ]


def load_overrides(session: Session, conditions: Conditions) -> list[OverrideRecord]:
    """Return all overrides, oldest first."""
    is_same_criterion = and_(CriterionResultRow.job_id == Job.id, CriterionResultRow.criterion == Override.criterion)
    query = (
        select(Override, Enrolment.student, CriterionResultRow)
        .join(Job, Job.submission_id == Override.submission_id)
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .outerjoin(CriterionResultRow, is_same_criterion)
        .where(*conditions)
        .order_by(Override.made_at, Override.id)
    )
    return [
        OverrideRecord(
            student,
            row.criterion,
            row.criterion if result is None else result.title,
            None if result is None or result.unjudged is not None else result.marks,
            row.marks,
            row.reason,
            row.actor,
            row.made_at,
            row.withdrawn_at,
        )
        for row, student, result in session.execute(query)
    ]


def load_appeals(session: Session, conditions: Conditions) -> list[AppealRecord]:
    """Return all appeals, oldest first."""
    query = (
        select(Appeal, Enrolment.student)
        .join(Job, Job.submission_id == Appeal.submission_id)
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .where(*conditions)
        .order_by(Appeal.asked_at, Appeal.id)
    )
    return [
        AppealRecord(student, row.text, row.asked_at, row.answer, row.actor, row.answered_at)
        for row, student in session.execute(query)
    ]


def load_newest_head(session: Session) -> LogHeadRecord | None:
    """Return the newest written head of the log; None if there is none."""
    row = session.scalar(select(StatementHead).order_by(StatementHead.id.desc()).limit(1))
    return None if row is None else LogHeadRecord(row.size, row.root_sha256, row.made_at)
