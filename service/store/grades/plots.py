"""Plots of stored grades: claiming and storing them. Plots follow the marks and do not affect them.

``service.plotting`` draws them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from datetime import datetime, timedelta

from sqlalchemy import func, or_, select, update
from sqlalchemy.orm import Session

from service.store import artifacts, phases
from service.store.engine import Store, now, retry_conflicts
from service.store.locks import match_and_lock_jobs
from service.store.models import Job
from service.store.revision import needs_newer_code
from service.store.states import PlotState

MOST_ATTEMPTS = 3
_PREFIX, _SUFFIX = "plot-", ".png"


@retry_conflicts
def claim_plots(store: Store, lease_seconds: float) -> str | None:
    """Claim the job whose plots are due longest; None if no plots are due.

    Drawing twice does no harm, so a claim is only postponed, not fenced. The plots fail after three attempts.
    """
    with store.transaction() as session:
        if needs_newer_code(session):
            return None
        at = now(session)
        due = (Job.plots == PlotState.DUE, Job.plots_due_at <= at)
        tried = (*due, Job.plots_attempt >= MOST_ATTEMPTS)
        session.execute(update(Job).where(match_and_lock_jobs(*tried), *tried).values(plots=PlotState.FAILED))
        query = select(Job.id).where(*due).order_by(Job.finished_at, Job.id).limit(1)
        job_id = session.scalar(query.with_for_update(skip_locked=True, key_share=True))
        if job_id is not None:
            until = at + timedelta(seconds=lease_seconds)
            put_off = update(Job).where(Job.id == job_id)
            session.execute(put_off.values(plots_due_at=until, plots_attempt=Job.plots_attempt + 1))
        return job_id


@retry_conflicts
def store_plots(store: Store, job_id: str, drawn: Mapping[str, bytes]) -> None:
    """Store the plots of a job, a mapping of name to PNG."""
    files = [artifacts.File(f"{_PREFIX}{name}{_SUFFIX}", "image/png", data) for name, data in drawn.items()]
    with store.transaction() as session:
        at = now(session)
        artifacts.store_files(session, job_id, files, at)
        before = session.scalars(select(Job.phases).where(Job.id == job_id)).one()
        reached = {**before, **phases.encode_times({phases.PLOTTED: at})}
        done = update(Job).where(Job.id == job_id)
        session.execute(done.values(plots=PlotState.DONE, plots_due_at=None, plotted_at=at, phases=reached))


def load_plots(session: Session, job_id: str) -> dict[str, bytes]:
    """Return the stored plots of a job, a mapping of name to PNG."""
    return _strip_file_names(artifacts.load_files(session, job_id, prefix=_PREFIX))


def load_each_plots(session: Session, job_ids: Collection[str]) -> Iterator[tuple[str, dict[str, bytes]]]:
    """Yield each job id with its plots, read in one statement and ordered by id."""
    return (
        (job_id, _strip_file_names(kept))
        for job_id, kept in artifacts.load_each_files(session, job_ids, prefix=_PREFIX)
    )


def _strip_file_names(kept: Mapping[str, artifacts.File]) -> dict[str, bytes]:
    return {name.removeprefix(_PREFIX).removesuffix(_SUFFIX): file.data for name, file in kept.items()}


def count_due_plots(store: Store) -> int:
    """Return the number of jobs whose plots are due."""
    with store.reading() as session:
        waiting = (Job.plots == PlotState.DUE, Job.plots_due_at <= now(session))
        return session.scalar(select(func.count()).select_from(Job).where(*waiting)) or 0


def correct_due_times(session: Session, at: datetime, ahead: datetime) -> None:
    """Make plots due ``at`` if a wrong clock scheduled them after ``ahead``."""
    waiting = (Job.plots == PlotState.DUE, Job.plots_due_at > ahead)
    written_later = or_(Job.finished_at > ahead, Job.started_at > ahead)
    which = (*waiting, written_later)
    session.execute(update(Job).where(match_and_lock_jobs(*which), *which).values(plots_due_at=at))
