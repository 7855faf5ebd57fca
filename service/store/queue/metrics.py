"""Metrics of the whole service from the database: queue lengths and ages, outcomes, and durations.

Read-only, so every replica reports the same values.
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
from service.store.queue.scheduling import match_claimable_jobs
from service.store.states import UNFINISHED, BatchState, JobQueue, JobState, PlotState

#: Durations cover the newest jobs that ended within this time.
TIMES_WINDOW = timedelta(hours=1)
MOST_TIMES = 2000
PACE_WINDOW = timedelta(minutes=5)
#: Older starts are ignored when deciding whether the queue is stuck.
_RECENT_PERIOD = timedelta(hours=1)


@dataclass(frozen=True, slots=True)
class QueueMetrics:
    """Queued jobs and the activity of the workers."""

    jobs: Mapping[tuple[JobQueue, JobState], int]
    claimable: Mapping[JobQueue, int]
    oldest_seconds: Mapping[JobQueue, float]  # waiting time of the oldest claimable job
    idle_seconds: float  # since a job last started or ended; infinite if none did in the last hour
    workers: Sequence[workers.WorkerLine]
    silent_seconds: Mapping[str, float]  # by worker, since last seen

    def count(self, state: JobState) -> int:
        """Return the number of jobs in a state, over all queues."""
        return sum(count for (_, each), count in self.jobs.items() if each is state)


@dataclass(frozen=True, slots=True)
class ServiceMetrics:
    """Metrics of the whole service at one moment."""

    queue: QueueMetrics
    verdicts: Mapping[str, int]
    host_faults: int  # attempts that ended with a host fault
    unjudged: int  # criteria that could not be judged
    surprises: int  # trials in which Robomark's own code failed on data from a child
    plots: Mapping[PlotState, int]
    paused_batches: int
    quarantined: int
    times: Mapping[str, Sequence[float]]  # seconds by span, sorted


def collect_service_metrics(session: Session) -> ServiceMetrics:
    """Collect all metrics."""
    verdicts = select(Job.verdict, func.count()).where(Job.verdict.is_not(None)).group_by(Job.verdict)
    # The last attempt of a graded or running job is not a fault.
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
        queue=collect_queue_metrics(session),
        verdicts={verdict: count for verdict, count in session.execute(verdicts) if verdict is not None},
        host_faults=faults or 0,
        unjudged=unjudged,
        surprises=surprises,
        plots=dict(session.execute(plots).all()),
        paused_batches=paused,
        quarantined=quarantined,
        times=_load_times(session),
    )


def collect_queue_metrics(session: Session) -> QueueMetrics:
    """Collect only the metrics that show whether the queue is stuck."""
    at = now(session)
    by_state = select(Job.lane, Job.state, func.count()).group_by(Job.lane, Job.state)
    waiting = (
        select(Job.lane, func.count(), func.min(Job.queued_at)).where(*match_claimable_jobs(at)).group_by(Job.lane)
    )
    rows = session.execute(waiting).all()
    seen = workers.load_workers(session)
    return QueueMetrics(
        jobs={(lane, state): count for lane, state, count in session.execute(by_state)},
        claimable={lane: count for lane, count, _ in rows},
        oldest_seconds={lane: max(0.0, (at - oldest).total_seconds()) for lane, _, oldest in rows},
        idle_seconds=_measure_idle_seconds(session, at),
        workers=seen,
        silent_seconds={each.worker.name: max(0.0, (at - each.seen_at).total_seconds()) for each in seen},
    )


def _measure_idle_seconds(session: Session, at: datetime) -> float:
    lately = Job.started_at > at - _RECENT_PERIOD
    begun, ended = session.execute(select(func.max(Job.started_at), func.max(Job.finished_at)).where(lately)).one()
    moments = [moment for moment in (begun, ended) if moment is not None]
    return max(0.0, (at - max(moments)).total_seconds()) if moments else math.inf


@dataclass(frozen=True, slots=True)
class Pace:
    """Grading speed of a batch, and the estimated remaining time next to other queued jobs."""

    per_minute: float
    left: timedelta


def estimate_pace(session: Session, batch_id: str) -> Pace | None:
    """Estimate the pace from the last minutes; None if nothing ended then, or nothing remains."""
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
    # The start time is indexed.
    ended = (Job.state == JobState.DONE, Job.finished_at > at - PACE_WINDOW, Job.started_at > at - _RECENT_PERIOD)
    own, everybody, first = session.execute(
        select(of_batch, func.count(), func.min(Job.started_at)).where(*ended)
    ).one()
    before = _count_jobs_before_end(waiting, batch_id)
    if not before or not own or first is None:
        return None
    seconds = max(1.0, min((at - first).total_seconds(), PACE_WINDOW.total_seconds()))
    return Pace(60 * own / seconds, timedelta(seconds=round(before * seconds / everybody)))


def _count_jobs_before_end(waiting: Mapping[int, Mapping[str | None, int]], batch_id: str) -> int:
    """Return the number of jobs, in all courses, that end before the batch does.

    Courses share the workers equally, and so do the batches of a course.
    """
    course = next((course for course, batches in waiting.items() if batch_id in batches), None)
    if course is None:
        return 0
    of_course = sum(min(count, waiting[course][batch_id]) for count in waiting[course].values())
    return sum(min(sum(batches.values()), of_course) for batches in waiting.values())


def compute_quantile(values: Sequence[float], share: float) -> float:
    """Return the nearest-rank quantile of sorted values for a ``share`` of 0 to 1."""
    return values[max(0, min(len(values) - 1, round(share * len(values) + 0.5) - 1))]


def _load_times(session: Session) -> dict[str, list[float]]:
    recent = (
        select(Job.phases)
        .where(Job.finished_at > now(session) - TIMES_WINDOW, Job.state == JobState.DONE)
        .order_by(Job.finished_at.desc())
        .limit(MOST_TIMES)
    )
    times: dict[str, list[float]] = {span: [] for span in phases.SPANS}
    for stored in session.scalars(recent):
        for span, duration in phases.compute_durations(stored).items():
            # A clock that was set back can give negative durations, which count as 0.
            times[span].append(max(0.0, duration.total_seconds()))
    return {span: sorted(found) for span, found in times.items()}
