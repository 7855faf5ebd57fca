"""Which grades are shown, and the attempt that counts: of each student and assignment one. Defined here alone.

A grade is trusted, seen by its student, or can count: each is a predicate and an SQL expression of the same, which a
test compares. The attempt that counts is the newest that can, whichever way it was submitted.
"""

from __future__ import annotations

from typing import Protocol

from sqlalchemy import ColumnElement, Select, Subquery, and_, case, func, or_, select, tuple_
from sqlalchemy.orm import aliased

from service.store.models import Job, SubmissionRow
from service.store.states import JobState, Standing

#: What holds of a job that has a grade, and whose worker has not been found to grade wrongly.
IS_TRUSTED: tuple[ColumnElement[bool], ...] = (Job.state == JobState.DONE, Job.suspect.is_(None))
#: What holds of a job beside its submission where students may be shown the grade, once it stands.
IS_FOR_STUDENTS: tuple[ColumnElement[bool], ...] = (*IS_TRUSTED, SubmissionRow.staff_only.is_(None))
#: What holds of a job beside its submission where its student may see the grade, and it can count.
CAN_COUNT: tuple[ColumnElement[bool], ...] = (*IS_FOR_STUDENTS, Job.standing == Standing.STANDS)


class JobOutcome(Protocol):
    """What tells whether there is a grade to rely on: a job, or a line that is read of one."""

    @property
    def state(self) -> str: ...  # noqa: D102
    @property
    def suspect(self) -> str | None: ...  # noqa: D102


class AttemptOutcome(JobOutcome, Protocol):
    """The same with the limit that the submission is over."""

    @property
    def staff_only(self) -> str | None: ...  # noqa: D102


class StandingOutcome(AttemptOutcome, Protocol):
    """The same with what the job is to its submission."""

    @property
    def standing(self) -> Standing: ...  # noqa: D102


def is_trusted(job: JobOutcome) -> bool:
    """As ``IS_TRUSTED``."""
    return job.state == JobState.DONE and job.suspect is None


def is_for_students(attempt: AttemptOutcome) -> bool:
    """As ``IS_FOR_STUDENTS``."""
    return is_trusted(attempt) and attempt.staff_only is None


def can_count(attempt: StandingOutcome) -> bool:
    """As ``CAN_COUNT``."""
    return is_for_students(attempt) and attempt.standing is Standing.STANDS


def counting(*which: ColumnElement[bool]) -> Select[int]:
    """The ids of the submissions that count, among all of the students and assignments that ``which`` selects.

    ``which`` are conditions on ``SubmissionRow`` that hold for all attempts of a student at an assignment or for none.
    """
    ranked = _ranked(*which)
    return select(ranked.c.id).where(ranked.c.place == 1, ranked.c.counts == 1)


def shown(*which: ColumnElement[bool]) -> Select[int]:
    """The same with a submission for every student: the newest over no limit, else the newest, where none counts."""
    ranked = _ranked(*which)
    return select(ranked.c.id).where(ranked.c.place == 1)


def attempted_in(batch_ids: Select[str]) -> ColumnElement[bool]:
    """Condition on ``SubmissionRow``: its student has submitted to its assignment in one of these batches."""
    member = aliased(SubmissionRow)
    pairs = select(member.enrolment_id, member.assignment).where(member.batch_id.in_(batch_ids))
    return tuple_(SubmissionRow.enrolment_id, SubmissionRow.assignment).in_(pairs)


def newer_attempt() -> ColumnElement[int | None]:
    """Of a ``SubmissionRow``: its student's newest attempt after it that does not count; None for none."""
    newer, job = aliased(SubmissionRow), aliased(Job)
    return (
        select(func.max(newer.attempt))
        .join(job, and_(job.submission_id == newer.id, job.standing == Standing.STANDS))
        .where(
            newer.enrolment_id == SubmissionRow.enrolment_id,
            newer.assignment == SubmissionRow.assignment,
            newer.attempt > SubmissionRow.attempt,
            or_(newer.staff_only.is_not(None), job.state != JobState.DONE),
        )
        .correlate(SubmissionRow)
        .scalar_subquery()
    )


def _ranked(*which: ColumnElement[bool]) -> Subquery:
    counts = case((and_(*CAN_COUNT), 1), else_=0)
    best_first = (counts.desc(), SubmissionRow.staff_only.is_not(None), SubmissionRow.attempt.desc())
    pair = (SubmissionRow.enrolment_id, SubmissionRow.assignment)
    place = func.row_number().over(partition_by=pair, order_by=best_first).label("place")
    return (
        select(SubmissionRow.id, counts.label("counts"), place)
        .join(Job, and_(Job.submission_id == SubmissionRow.id, Job.standing == Standing.STANDS))
        .where(*which)
        .subquery()
    )
