"""Where a job stands in the queue, and about how long it takes: what whoever waits for it asks. Only reads.

An estimate: whose turn it really is, is decided by ``scheduling.py`` when a worker asks.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import ColumnElement, and_, func, or_, select
from sqlalchemy.orm import InstrumentedAttribute, Session

from service.store.engine import now
from service.store.models import Enrolment, Job
from service.store.queue import workers
from service.store.queue.scheduling import claimable, recently_begun, shares
from service.store.states import JobState, Lane

#: A grading takes as long as the mean of so many before it.
_MEASURED = 20
#: What is shown of a grading that takes longer than usual.
_MOST_PROGRESS = 0.95


@dataclass(frozen=True, slots=True)
class QueuePlace:
    """How many jobs come before one, and how long it is to its marks; None where nothing tells how long.

    ``progress`` (0 to 1) follows from the time that gradings usually take: the share of trials that have run would tell
    students how many there are.
    """

    before: int
    seconds: float | None
    workers: int  # that live
    progress: float = 0.0


def queue_place(session: Session, job_id: str) -> QueuePlace:
    """Of a job that waits or runs."""
    at = now(session)
    job = session.get_one(Job, job_id)
    lively = [seen.worker for seen in workers.known_workers(session) if seen.lately]
    before = _before(session, job, at) if job.state is JobState.QUEUED else 0
    each = _usual_seconds(session)
    if each is None or not lively:
        return QueuePlace(before, None, len(lively))
    running = (at - job.started_at).total_seconds() if job.state is JobState.RUNNING and job.started_at else 0.0
    progress = min(running / each, _MOST_PROGRESS) if each else 0.0
    slots = sum(worker.concurrency for worker in lively)
    return QueuePlace(before, before * each / slots + each * (1 - progress), len(lively), progress)


def _before(session: Session, job: Job, at: datetime) -> int:
    recent = recently_begun(at).cte("recent")
    of_course = shares(recent.c.course_id)
    of_batch, of_student = shares(recent.c.batch_id), shares(recent.c.enrolment_id)
    keys: list[ColumnElement[Any] | InstrumentedAttribute[Any]] = [
        func.coalesce(of_course.c.begun, 0),
        func.coalesce(of_batch.c.begun, 0),
        func.coalesce(of_student.c.begun, 0),
        Job.queued_at,
        Job.id,
    ]
    own = select(*keys).select_from(Job).join(Enrolment, Job.enrolment_id == Enrolment.id)
    joined = (
        (of_course, of_course.c.share == Enrolment.course_id),
        (of_batch, of_batch.c.share == Job.batch_id),
        (of_student, of_student.c.share == Job.enrolment_id),
    )
    others = select(func.count()).select_from(Job).join(Enrolment, Job.enrolment_id == Enrolment.id)
    for share, on in joined:
        own, others = own.outerjoin(share, on), others.outerjoin(share, on)
    mine = session.execute(own.where(Job.id == job.id)).one()
    earlier = [
        and_(*(key == value for key, value in zip(keys[:number], mine, strict=False)), keys[number] < mine[number])
        for number in range(len(keys))
    ]
    sooner = and_(Job.lane == job.lane, or_(*earlier))
    if job.lane is Lane.BATCH:
        sooner = or_(sooner, Job.lane == Lane.INTERACTIVE)
    return session.scalar(others.where(*claimable(at), Job.id != job.id, sooner)) or 0


def _usual_seconds(session: Session) -> float | None:
    run = (Job.state == JobState.DONE, Job.copied_from.is_(None), Job.started_at.is_not(None))
    query = select(Job.started_at, Job.finished_at).where(*run).order_by(Job.started_at.desc()).limit(_MEASURED)
    taken = [
        (finished - started).total_seconds() for started, finished in session.execute(query) if started and finished
    ]
    return sum(taken) / len(taken) if taken else None
