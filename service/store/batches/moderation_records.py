"""Records for the moderation sheet of a batch, with the ids of students.

Read-only. The conditions select the jobs of the sheet, so that no statement has a list of ids.
"""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import ColumnElement, and_, func, select
from sqlalchemy.orm import Session

from service.moderation_records import SheetAppeal, SheetLogHead, SheetOverride, SheetVersion
from service.store.batches.job_lines import match_standing_jobs
from service.store.states import JobState
from service.store.tables.courses import AssignmentVersion
from service.store.tables.grades import Appeal, CriterionResultRow, Override
from service.store.tables.people import Enrolment
from service.store.tables.statements import StatementHead
from service.store.tables.submissions import Job, SubmissionRow

Conditions = Sequence[ColumnElement[bool]]


def match_sheet_jobs(session: Session, batch_id: str, assignment: str) -> Conditions:
    """Return the conditions that select the standing jobs of an assignment in a batch."""
    own_submissions = select(SubmissionRow.id).where(SubmissionRow.assignment == assignment)
    return (*match_standing_jobs(session, batch_id), Job.submission_id.in_(own_submissions))


def load_versions(session: Session, conditions: Conditions) -> list[SheetVersion]:
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
        SheetVersion(version, release or "", grader or "", sandbox or "", count)
        for version, release, grader, sandbox, count in session.execute(query)
    ]


def load_overrides(session: Session, conditions: Conditions) -> list[SheetOverride]:
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
        SheetOverride(
            student,
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


def load_appeals(session: Session, conditions: Conditions) -> list[SheetAppeal]:
    """Return all appeals, oldest first."""
    query = (
        select(Appeal, Enrolment.student)
        .join(Job, Job.submission_id == Appeal.submission_id)
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .where(*conditions)
        .order_by(Appeal.asked_at, Appeal.id)
    )
    return [
        SheetAppeal(student, row.text, row.asked_at, row.answer, row.actor, row.answered_at)
        for row, student in session.execute(query)
    ]


def load_newest_head(session: Session) -> SheetLogHead | None:
    """Return the newest written head of the log; None if there is none."""
    row = session.scalar(select(StatementHead).order_by(StatementHead.id.desc()).limit(1))
    return None if row is None else SheetLogHead(row.size, row.root_sha256, row.made_at)
