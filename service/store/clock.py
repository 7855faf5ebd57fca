"""What to do when the clock was set back: moments in the future that nothing but a wrong clock can have written.

A clock that was set forward needs no correction: leases run out early, and the workers are fenced.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta

from sqlalchemy import or_, select, update
from sqlalchemy.orm import Session

from service.store.models import Job, JobState, PlotState

#: Clocks are corrected all the time by less than this.
_TOLERANCE = timedelta(seconds=2)


def correct(session: Session, at: datetime, longest_wait: Callable[[int], timedelta]) -> None:
    """Bring moments that lie too far ahead of ``at`` back to where they would be; doing it twice changes nothing.

    ``longest_wait`` is how long a job waits after an attempt that failed. A lease keeps its length, a job that never
    failed is due now, and one that did waits once more.
    """
    ahead = at + _TOLERANCE
    held = select(Job.id, Job.lease, Job.lease_until, Job.heartbeat_at)
    for job_id, lease, lease_until, heartbeat_at in session.execute(
        held.where(Job.state == JobState.RUNNING, Job.heartbeat_at > ahead)
    ).all():
        if lease_until is None or heartbeat_at is None:
            continue
        renewed = {"heartbeat_at": at, "lease_until": at + (lease_until - heartbeat_at)}
        session.execute(update(Job).where(Job.id == job_id, Job.lease == lease).values(**renewed))
    waiting = select(Job.id, Job.attempt, Job.due_at).where(Job.state == JobState.QUEUED, Job.due_at > ahead)
    for job_id, attempt, due_at in session.execute(waiting).all():
        latest = at + longest_wait(attempt) if attempt else at
        if due_at > latest + _TOLERANCE:
            held_back = (Job.id == job_id, Job.state == JobState.QUEUED)
            session.execute(update(Job).where(*held_back).values(due_at=latest, notified_at=None))
    notified = (Job.state == JobState.QUEUED, Job.notified_at > ahead)
    session.execute(update(Job).where(*notified).values(notified_at=None))
    plots = (Job.plots == PlotState.DUE, Job.plots_due_at > ahead)
    written_later = or_(Job.finished_at > ahead, Job.started_at > ahead)
    session.execute(update(Job).where(*plots, written_later).values(plots_due_at=at))
