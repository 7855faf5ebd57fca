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
from service.store.queue import workers
from service.store.queue.scheduling import match_claimable_jobs
from service.store.states import UNFINISHED, BatchState, JobQueue, JobState, PlotState
from service.store.tables.grades import CriterionResultRow, TrialRow
from service.store.tables.installation import Worker
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Batch, Job

#: Durations cover the newest jobs that ended within this time.
TIMES_WINDOW = timedelta(hours=1)
MAX_TIMES = 2000
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
    successful_attempts = case((Job.state.in_((JobState.DONE, JobState.RUNNING)), 1), else_=0)
    plots = select(Job.plots, func.count()).where(Job.plots != PlotState.NONE).group_by(Job.plots)
    counts = (
        select(func.sum(Job.attempt - successful_attempts)).where(Job.attempt > 0),
        select(func.count()).select_from(CriterionResultRow).where(CriterionResultRow.unjudged.is_not(None)),
        select(func.count()).select_from(TrialRow).where(TrialRow.surprise.is_not(None)),
        select(func.count()).select_from(Batch).where(Batch.state == BatchState.PAUSED),
        select(func.count()).select_from(Worker).where(Worker.quarantined_at.is_not(None)),
    )
    fault_count, unjudged_count, surprise_count, paused_count, quarantined_count = session.execute(
        select(*(count.scalar_subquery() for count in counts))
    ).one()
    return ServiceMetrics(
        queue=collect_queue_metrics(session),
        verdicts={verdict: count for verdict, count in session.execute(verdicts) if verdict is not None},
        host_faults=fault_count or 0,
        unjudged=unjudged_count,
        surprises=surprise_count,
        plots=dict(session.execute(plots).all()),
        paused_batches=paused_count,
        quarantined=quarantined_count,
        times=_load_times(session),
    )


def collect_queue_metrics(session: Session) -> QueueMetrics:
    """Collect only the metrics that show whether the queue is stuck."""
    current_time = now(session)
    state_counts = select(Job.lane, Job.state, func.count()).group_by(Job.lane, Job.state)
    claimable_query = (
        select(Job.lane, func.count(), func.min(Job.queued_at))
        .where(*match_claimable_jobs(current_time))
        .group_by(Job.lane)
    )
    rows = session.execute(claimable_query).all()
    worker_lines = workers.load_workers(session)
    return QueueMetrics(
        jobs={(lane, state): count for lane, state, count in session.execute(state_counts)},
        claimable={lane: count for lane, count, _ in rows},
        oldest_seconds={lane: max(0.0, (current_time - oldest).total_seconds()) for lane, _, oldest in rows},
        idle_seconds=_measure_idle_seconds(session, current_time),
        workers=worker_lines,
        silent_seconds={
            each.worker.name: max(0.0, (current_time - each.seen_at).total_seconds()) for each in worker_lines
        },
    )


def _measure_idle_seconds(session: Session, current_time: datetime) -> float:
    is_recent = Job.started_at > current_time - _RECENT_PERIOD
    last_start, last_finish = session.execute(
        select(func.max(Job.started_at), func.max(Job.finished_at)).where(is_recent)
    ).one()
    moments = [moment for moment in (last_start, last_finish) if moment is not None]
    return max(0.0, (current_time - max(moments)).total_seconds()) if moments else math.inf


@dataclass(frozen=True, slots=True)
class Pace:
    """Grading speed of a batch, and the estimated remaining time next to other queued jobs."""

    per_minute: float
    left: timedelta


def estimate_pace(session: Session, batch_id: str) -> Pace | None:
    """Estimate the pace from the last minutes; None if nothing ended then, or nothing remains."""
    current_time = now(session)
    unfinished_query = (
        select(Enrolment.course_id, Job.batch_id, func.count())
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .outerjoin(Batch, Job.batch_id == Batch.id)
        .where(
            Job.state.in_(UNFINISHED),
            or_(Job.batch_id.is_(None), Job.batch_id == batch_id, Batch.state == BatchState.OPEN),
        )
        .group_by(Enrolment.course_id, Job.batch_id)
    )
    unfinished_jobs: dict[int, dict[str | None, int]] = defaultdict(dict)
    for course, batch, count in session.execute(unfinished_query).all():
        unfinished_jobs[course][batch] = count
    batch_count = func.sum(case((Job.batch_id == batch_id, 1), else_=0))
    # The start time is indexed.
    is_recently_done = (
        Job.state == JobState.DONE,
        Job.finished_at > current_time - PACE_WINDOW,
        Job.started_at > current_time - _RECENT_PERIOD,
    )
    batch_done, total_done, first_start = session.execute(
        select(batch_count, func.count(), func.min(Job.started_at)).where(*is_recently_done)
    ).one()
    jobs_before_end = _count_jobs_before_end(unfinished_jobs, batch_id)
    if not jobs_before_end or not batch_done or first_start is None:
        return None
    seconds = max(1.0, min((current_time - first_start).total_seconds(), PACE_WINDOW.total_seconds()))
    return Pace(60 * batch_done / seconds, timedelta(seconds=round(jobs_before_end * seconds / total_done)))


def _count_jobs_before_end(unfinished_jobs: Mapping[int, Mapping[str | None, int]], batch_id: str) -> int:
    """Return the number of jobs, in all courses, that end before the batch does.

    Courses share the workers equally, and so do the batches of a course.
    """
    course = next((course for course, batches in unfinished_jobs.items() if batch_id in batches), None)
    if course is None:
        return 0
    course_share = sum(min(count, unfinished_jobs[course][batch_id]) for count in unfinished_jobs[course].values())
    return sum(min(sum(batches.values()), course_share) for batches in unfinished_jobs.values())


def compute_quantile(values: Sequence[float], share: float) -> float:
    """Return the nearest-rank quantile of sorted values for a ``share`` of 0 to 1."""
    return values[max(0, min(len(values) - 1, round(share * len(values) + 0.5) - 1))]


def _load_times(session: Session) -> dict[str, list[float]]:
    recent_phases = (
        select(Job.phases)
        .where(Job.finished_at > now(session) - TIMES_WINDOW, Job.state == JobState.DONE)
        .order_by(Job.finished_at.desc())
        .limit(MAX_TIMES)
    )
    times: dict[str, list[float]] = {span: [] for span in phases.SPANS}
    for phase_times in session.scalars(recent_phases):
        for span, duration in phases.compute_durations(phase_times).items():
            # A clock that was set back can give negative durations, which count as 0.
            times[span].append(max(0.0, duration.total_seconds()))
    return {span: sorted(found) for span, found in times.items()}
