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
from service.store.revision import needs_newer_code
from service.store.states import PlotState
from service.store.tables.submissions import Job

MAX_ATTEMPTS = 3
_PREFIX, _SUFFIX = "plot-", ".png"


@retry_conflicts
def claim_plots(store: Store, lease_seconds: float) -> str | None:
    """Claim the job whose plots have been due the longest; None if no plots are due.

    Drawing twice is harmless, so a claim is only postponed, not fenced. The plots fail after three attempts.
    """
    with store.transaction() as session:
        if needs_newer_code(session):
            return None
        current_time = now(session)
        is_due = (Job.plots == PlotState.DUE, Job.plots_due_at <= current_time)
        exhausted_attempts = (*is_due, Job.plots_attempt >= MAX_ATTEMPTS)
        session.execute(
            update(Job)
            .where(match_and_lock_jobs(*exhausted_attempts), *exhausted_attempts)
            .values(plots=PlotState.FAILED)
        )
        query = select(Job.id).where(*is_due).order_by(Job.finished_at, Job.id).limit(1)
        job_id = session.scalar(query.with_for_update(skip_locked=True, key_share=True))
        if job_id is not None:
            lease_end = current_time + timedelta(seconds=lease_seconds)
            postpone_statement = update(Job).where(Job.id == job_id)
            session.execute(postpone_statement.values(plots_due_at=lease_end, plots_attempt=Job.plots_attempt + 1))
        return job_id


@retry_conflicts
def store_plots(store: Store, job_id: str, plots: Mapping[str, bytes]) -> None:
    """Store the plots of a job, a mapping of name to PNG."""
    files = [artifacts.File(f"{_PREFIX}{name}{_SUFFIX}", "image/png", data) for name, data in plots.items()]
    with store.transaction() as session:
        current_time = now(session)
        artifacts.store_files(session, job_id, files, current_time)
        earlier_phases = session.scalars(select(Job.phases).where(Job.id == job_id)).one()
        phase_times = {**earlier_phases, **phases.encode_times({phases.PLOTTED: current_time})}
        statement = update(Job).where(Job.id == job_id)
        session.execute(
            statement.values(plots=PlotState.DONE, plots_due_at=None, plotted_at=current_time, phases=phase_times)
        )


def load_plots(session: Session, job_id: str) -> dict[str, bytes]:
    """Return the stored plots of a job, a mapping of name to PNG."""
    return _strip_file_names(artifacts.load_files(session, job_id, prefix=_PREFIX))


def load_each_plots(session: Session, job_ids: Collection[str]) -> Iterator[tuple[str, dict[str, bytes]]]:
    """Yield each job id with its plots, read in one statement and ordered by id."""
    return (
        (job_id, _strip_file_names(kept))
        for job_id, kept in artifacts.load_each_files(session, job_ids, prefix=_PREFIX)
    )


def _strip_file_names(files: Mapping[str, artifacts.File]) -> dict[str, bytes]:
    return {name.removeprefix(_PREFIX).removesuffix(_SUFFIX): file.data for name, file in files.items()}


def count_due_plots(store: Store) -> int:
    """Return the number of jobs whose plots are due."""
    with store.reading() as session:
        is_due = (Job.plots == PlotState.DUE, Job.plots_due_at <= now(session))
        return session.scalar(select(func.count()).select_from(Job).where(*is_due)) or 0


def correct_due_times(session: Session, current_time: datetime, latest_time: datetime) -> None:
    """Make plots due ``current_time`` if a wrong clock scheduled them after ``latest_time``."""
    scheduled_later = (Job.plots == PlotState.DUE, Job.plots_due_at > latest_time)
    is_written_later = or_(Job.finished_at > latest_time, Job.started_at > latest_time)
    conditions = (*scheduled_later, is_written_later)
    session.execute(update(Job).where(match_and_lock_jobs(*conditions), *conditions).values(plots_due_at=current_time))
