"""Visibility of grades, and the current attempt of each student and assignment. The only definition of both.

The states "trusted", "for students" and "can count" are each defined as a predicate and as an SQL expression; a test
compares the two. The current attempt is the newest that can count, regardless of how it was submitted.
"""

from __future__ import annotations

from functools import cache
from typing import Protocol

from sqlalchemy import ColumnElement, Select, Subquery, and_, case, func, or_, select, tuple_
from sqlalchemy.orm import aliased

from service.store.states import JobState, Standing
from service.store.tables.submissions import Job, SubmissionRow

#: Condition on a job: it is graded, and its worker is not known to grade incorrectly.
IS_TRUSTED: tuple[ColumnElement[bool], ...] = (Job.state == JobState.DONE, Job.suspect.is_(None))
#: Condition on a job joined with its submission: students may see the grade when it is standing.
IS_FOR_STUDENTS: tuple[ColumnElement[bool], ...] = (*IS_TRUSTED, SubmissionRow.staff_only.is_(None))
#: Condition on a job joined with its submission: its student may see the grade, and it can count.
CAN_COUNT: tuple[ColumnElement[bool], ...] = (*IS_FOR_STUDENTS, Job.standing == Standing.STANDS)


class JobStatus(Protocol):
    """Fields that decide whether a grade is trusted: a job, or a line read from one."""

    @property
    def state(self) -> str: ...  # noqa: D102
    @property
    def suspect(self) -> str | None: ...  # noqa: D102


class AttemptStatus(JobStatus, Protocol):
    """Fields of ``JobStatus``, with the limit that the submission exceeds."""

    @property
    def staff_only(self) -> str | None: ...  # noqa: D102


def is_trusted(job: JobStatus) -> bool:
    """Return whether ``IS_TRUSTED`` applies."""
    return job.state == JobState.DONE and job.suspect is None


def is_for_students(attempt: AttemptStatus) -> bool:
    """Return whether ``IS_FOR_STUDENTS`` applies."""
    return is_trusted(attempt) and attempt.staff_only is None


def select_counted_submissions(*conditions: ColumnElement[bool]) -> Select[int]:
    """Return a query for the ids of the submissions that count, among those selected by ``conditions``.

    Each condition on ``SubmissionRow`` must select all attempts of a student at an assignment, or none.
    """
    rank_table = _select_ranked(*conditions)
    return select(rank_table.c.id).where(rank_table.c.place == 1, rank_table.c.counts == 1)


def select_shown_submissions(*conditions: ColumnElement[bool]) -> Select[int]:
    """Return a query like ``select_counted_submissions``, with one submission for every student.

    If none counts, it is the newest within the limits, otherwise the newest.
    """
    rank_table = _select_ranked(*conditions)
    return select(rank_table.c.id).where(rank_table.c.place == 1)


def match_students_of_batches(batch_ids: Select[str]) -> ColumnElement[bool]:
    """Return the condition that the student of a ``SubmissionRow`` has submitted to its assignment in these batches."""
    member = aliased(SubmissionRow)
    pairs = select(member.enrolment_id, member.assignment).where(member.batch_id.in_(batch_ids))
    return tuple_(SubmissionRow.enrolment_id, SubmissionRow.assignment).in_(pairs)


@cache
def select_newer_attempt() -> ColumnElement[int | None]:
    """Return the newest later attempt of the student of a ``SubmissionRow`` that does not count; None without one."""
    newer_submission, job = aliased(SubmissionRow), aliased(Job)
    return (
        select(func.max(newer_submission.attempt))
        .join(job, and_(job.submission_id == newer_submission.id, job.standing == Standing.STANDS))
        .where(
            newer_submission.enrolment_id == SubmissionRow.enrolment_id,
            newer_submission.assignment == SubmissionRow.assignment,
            newer_submission.attempt > SubmissionRow.attempt,
            or_(newer_submission.staff_only.is_not(None), job.state != JobState.DONE),
        )
        .correlate(SubmissionRow)
        .scalar_subquery()
    )


def _select_ranked(*conditions: ColumnElement[bool]) -> Subquery:
    counts = case((and_(*CAN_COUNT), 1), else_=0)
    rank_order = (counts.desc(), SubmissionRow.staff_only.is_not(None), SubmissionRow.attempt.desc())
    pair = (SubmissionRow.enrolment_id, SubmissionRow.assignment)
    rank = func.row_number().over(partition_by=pair, order_by=rank_order).label("place")
    return (
        select(SubmissionRow.id, counts.label("counts"), rank)
        .join(Job, and_(Job.submission_id == SubmissionRow.id, Job.standing == Standing.STANDS))
        .where(*conditions)
        .subquery()
    )
