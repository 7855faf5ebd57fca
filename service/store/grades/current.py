"""The attempt that counts: of each student and assignment one, whichever way it was submitted. Defined here alone.

It is the newest that is graded, not suspect, and over no limit. Every page, export and gradebook asks this module.
"""

from __future__ import annotations

from sqlalchemy import ColumnElement, Select, Subquery, and_, case, func, or_, select, tuple_
from sqlalchemy.orm import aliased

from service.store.models import Job, SubmissionRow
from service.store.states import JobState, Standing

#: What holds of a submission and the job that stands for it, where it can count.
CAN_COUNT: tuple[ColumnElement[bool], ...] = (
    SubmissionRow.staff_only.is_(None),
    Job.standing == Standing.STANDS,
    Job.state == JobState.DONE,
    Job.suspect.is_(None),
)


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
