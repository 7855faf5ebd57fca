"""Visibility of grades, and the current attempt of each student and assignment. The only definition of both.

The states "trusted", "for students" and "can count" are each defined as a predicate and as an SQL expression; a test
compares the two. The current attempt is the latest or the best that can count, by the rule of the course, regardless of
how it was submitted. The best has the highest share of its maximum marks, as adjusted by staff; of several, the latest.
"""

from __future__ import annotations

from datetime import datetime
from functools import cache
from typing import Protocol

from sqlalchemy import ColumnElement, Float, Select, Subquery, and_, case, cast, func, or_, select, tuple_
from sqlalchemy.orm import aliased

from service.store.courses import policies
from service.store.states import JobState, Standing
from service.store.tables.grades import CriterionResultRow
from service.store.tables.submissions import Job, SubmissionRow

#: Condition on a job: it is graded, and its worker is not known to grade incorrectly.
IS_TRUSTED: tuple[ColumnElement[bool], ...] = (Job.state == JobState.DONE, Job.suspect.is_(None))
#: Condition on a job joined with its submission: students may see the grade when it is standing.
IS_FOR_STUDENTS: tuple[ColumnElement[bool], ...] = (*IS_TRUSTED, SubmissionRow.staff_only.is_(None))
#: Condition on a job joined with its submission: its student may see the grade, and it can count.
CAN_COUNT: tuple[ColumnElement[bool], ...] = (*IS_FOR_STUDENTS, Job.standing == Standing.STANDS)


#: Shares of marks are compared in billionths: equal shares of different maxima can differ as floats.
_SHARE_UNITS = 10**9


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


def select_unpublished_job(*visibilities: str) -> ColumnElement[str | None]:
    """Return an unpublished job of the student and assignment of a ``SubmissionRow``; None without one.

    It has a criterion with one of these visibilities, and its attempt can count.
    """
    attempt, job = aliased(SubmissionRow), aliased(Job)
    query = _select_other_grade(attempt, job).join(CriterionResultRow, CriterionResultRow.job_id == job.id)
    query = query.where(job.published_at.is_(None), CriterionResultRow.visibility.in_(visibilities))
    return query.correlate(SubmissionRow).scalar_subquery()


def select_unreleased_job(current_time: datetime) -> ColumnElement[str | None]:
    """Return a job of the student and assignment of a ``SubmissionRow`` that can count and is not released."""
    attempt, job = aliased(SubmissionRow), aliased(Job)
    query = _select_other_grade(attempt, job).where(~policies.match_released(current_time, job, attempt))
    return query.correlate(SubmissionRow).scalar_subquery()


def _select_other_grade(attempt: type[SubmissionRow], job: type[Job]) -> Select[str]:
    """Return a query for a grade of the student and assignment of a ``SubmissionRow`` that can count."""
    return (
        select(func.min(job.id))
        .join(attempt, job.submission_id == attempt.id)
        .where(
            attempt.enrolment_id == SubmissionRow.enrolment_id,
            attempt.assignment == SubmissionRow.assignment,
            attempt.staff_only.is_(None),
            job.state == JobState.DONE,
            job.suspect.is_(None),
            job.standing == Standing.STANDS,
        )
    )


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
    rank_order = (
        counts.desc(), _compute_best_share().desc(), SubmissionRow.staff_only.is_not(None), SubmissionRow.attempt.desc()
    )  # fmt: skip
    pair = (SubmissionRow.enrolment_id, SubmissionRow.assignment)
    rank = func.row_number().over(partition_by=pair, order_by=rank_order).label("place")
    return (
        select(SubmissionRow.id, counts.label("counts"), rank)
        .join(Job, and_(Job.submission_id == SubmissionRow.id, Job.standing == Standing.STANDS))
        .where(*conditions)
        .subquery()
    )


def _compute_best_share() -> ColumnElement[int]:
    """Return the share of the maximum marks, in billionths, where the best attempt counts.

    It is -1 for attempts that cannot count and for completely excused ones, and everywhere else.
    """
    can_have_share = and_(*CAN_COUNT, Job.max_marks > 0, policies.match_best_counts())
    share = cast(Job.marks, Float) / cast(Job.max_marks, Float)
    return case((can_have_share, func.round(share * _SHARE_UNITS)), else_=-1)
