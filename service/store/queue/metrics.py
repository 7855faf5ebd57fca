"""What the database tells of the whole service: how much waits and since when, what ended how, and how long it took.

Only reads, so that every replica that is asked tells the same.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy import case, func, or_, select
from sqlalchemy.orm import Session

from service.store import phases
from service.store.engine import now
from service.store.models import Batch, CriterionResultRow, Enrolment, Job, TrialRow, Worker
from service.store.queue import workers
from service.store.queue.scheduling import claimable
from service.store.states import UNFINISHED, BatchState, JobState, Lane, PlotState

#: Times are told of the jobs that ended in this time, the newest of them.
TIMES_OVER = timedelta(hours=1)
TIMES_MOST = 2000
PACE_OVER = timedelta(minutes=5)
#: A job that was begun longer ago says nothing of whether the queue stands still.
_LATELY = timedelta(hours=1)


@dataclass(frozen=True, slots=True)
class QueueMetrics:
    """What waits, and whether anybody grades it."""

    jobs: Mapping[tuple[Lane, JobState], int]
    claimable: Mapping[Lane, int]
    oldest_seconds: Mapping[Lane, float]  # how long the oldest job that could be claimed has waited
    idle_seconds: float  # since a job was begun or ended; infinite where none was in the last hour
    workers: Sequence[workers.WorkerLine]
    silent_seconds: Mapping[str, float]  # by worker, since it was last heard of

    def count(self, state: JobState) -> int:
        """The number of jobs in a state, of all lanes."""
        return sum(count for (_, each), count in self.jobs.items() if each is state)


@dataclass(frozen=True, slots=True)
class ServiceMetrics:
    """One look at the whole service."""

    queue: QueueMetrics
    verdicts: Mapping[str, int]
    host_faults: int  # attempts that ended through no fault of the student's
    unjudged: int  # criteria that could not be judged
    surprises: int  # trials in which our own code stumbled over what a child sent
    plots: Mapping[PlotState, int]
    paused_batches: int
    quarantined: int
    times: Mapping[str, Sequence[float]]  # seconds by span, sorted


def collect(session: Session) -> ServiceMetrics:
    """All metrics at one moment."""
    verdicts = select(Job.verdict, func.count()).where(Job.verdict.is_not(None)).group_by(Job.verdict)
    # Of the attempts of a job that is graded, or is being graded, the last is no fault.
    good = case((Job.state.in_((JobState.DONE, JobState.RUNNING)), 1), else_=0)
    plots = select(Job.plots, func.count()).where(Job.plots != PlotState.NONE).group_by(Job.plots)
    counts = (
        select(func.sum(Job.attempt - good)).where(Job.attempt > 0),
        select(func.count()).select_from(CriterionResultRow).where(CriterionResultRow.unjudged.is_not(None)),
        select(func.count()).select_from(TrialRow).where(TrialRow.surprise.is_not(None)),
        select(func.count()).select_from(Batch).where(Batch.state == BatchState.PAUSED),
        select(func.count()).select_from(Worker).where(Worker.quarantined_at.is_not(None)),
    )
    faults, unjudged, surprises, paused, quarantined = session.execute(
        select(*(count.scalar_subquery() for count in counts))
    ).one()
    return ServiceMetrics(
        queue=collect_queue(session),
        verdicts={verdict: count for verdict, count in session.execute(verdicts) if verdict is not None},
        host_faults=faults or 0,
        unjudged=unjudged,
        surprises=surprises,
        plots=dict(session.execute(plots).all()),
        paused_batches=paused,
        quarantined=quarantined,
        times=_times(session),
    )


def collect_queue(session: Session) -> QueueMetrics:
    """The part of them that tells whether the queue stands still."""
    at = now(session)
    by_state = select(Job.lane, Job.state, func.count()).group_by(Job.lane, Job.state)
    waiting = select(Job.lane, func.count(), func.min(Job.queued_at)).where(*claimable(at)).group_by(Job.lane)
    rows = session.execute(waiting).all()
    seen = workers.known_workers(session)
    return QueueMetrics(
        jobs={(lane, state): count for lane, state, count in session.execute(by_state)},
        claimable={lane: count for lane, count, _ in rows},
        oldest_seconds={lane: max(0.0, (at - oldest).total_seconds()) for lane, _, oldest in rows},
        idle_seconds=_idle_seconds(session, at),
        workers=seen,
        silent_seconds={each.worker.name: max(0.0, (at - each.seen_at).total_seconds()) for each in seen},
    )


def _idle_seconds(session: Session, at: datetime) -> float:
    lately = Job.started_at > at - _LATELY
    begun, ended = session.execute(select(func.max(Job.started_at), func.max(Job.finished_at)).where(lately)).one()
    moments = [moment for moment in (begun, ended) if moment is not None]
    return max(0.0, (at - max(moments)).total_seconds()) if moments else math.inf


@dataclass(frozen=True, slots=True)
class Pace:
    """How fast a batch is being graded, and how long the rest of it takes beside what else waits."""

    per_minute: float
    left: timedelta


def pace(session: Session, batch_id: str) -> Pace | None:
    """By what ended in the last minutes, of the batch and of all; None where nothing did, or nothing is left."""
    at = now(session)
    unfinished = (
        select(Enrolment.course_id, Job.batch_id, func.count())
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .outerjoin(Batch, Job.batch_id == Batch.id)
        .where(
            Job.state.in_(UNFINISHED),
            or_(Job.batch_id.is_(None), Job.batch_id == batch_id, Batch.state == BatchState.OPEN),
        )
        .group_by(Enrolment.course_id, Job.batch_id)
    )
    waiting: dict[int, dict[str | None, int]] = defaultdict(dict)
    for course, batch, count in session.execute(unfinished).all():
        waiting[course][batch] = count
    of_batch = func.sum(case((Job.batch_id == batch_id, 1), else_=0))
    # The moment of the start has an index.
    ended = (Job.state == JobState.DONE, Job.finished_at > at - PACE_OVER, Job.started_at > at - _LATELY)
    own, everybody, first = session.execute(
        select(of_batch, func.count(), func.min(Job.started_at)).where(*ended)
    ).one()
    before = _graded_before_its_end(waiting, batch_id)
    if not before or not own or first is None:
        return None
    seconds = max(1.0, min((at - first).total_seconds(), PACE_OVER.total_seconds()))
    return Pace(60 * own / seconds, timedelta(seconds=round(before * seconds / everybody)))


def _graded_before_its_end(waiting: Mapping[int, Mapping[str | None, int]], batch_id: str) -> int:
    """How many jobs of all end until the batch has, as each course has the same share, and each batch in a course."""
    course = next((course for course, batches in waiting.items() if batch_id in batches), None)
    if course is None:
        return 0
    of_course = sum(min(count, waiting[course][batch_id]) for count in waiting[course].values())
    return sum(min(sum(batches.values()), of_course) for batches in waiting.values())


def quantile(values: Sequence[float], share: float) -> float:
    """The value that ``share`` of the sorted values do not exceed (nearest rank)."""
    return values[max(0, min(len(values) - 1, round(share * len(values) + 0.5) - 1))]


def _times(session: Session) -> dict[str, list[float]]:
    recent = (
        select(Job.phases)
        .where(Job.finished_at > now(session) - TIMES_OVER, Job.state == JobState.DONE)
        .order_by(Job.finished_at.desc())
        .limit(TIMES_MOST)
    )
    times: dict[str, list[float]] = {span: [] for span in phases.SPANS}
    for stored in session.scalars(recent):
        for span, duration in phases.durations(stored).items():
            # A clock that was set back in between makes nonsense; nothing takes less than no time.
            times[span].append(max(0.0, duration.total_seconds()))
    return {span: sorted(found) for span, found in times.items()}
