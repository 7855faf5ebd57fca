"""The states of jobs and all transitions between them. Only ``jobs.py`` applies them."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any, cast

from sqlalchemy import ColumnElement, CursorResult, update
from sqlalchemy.orm import Session

from service.store.locks import match_and_lock_jobs
from service.store.states import JobState
from service.store.tables.submissions import Job


@dataclass(frozen=True, slots=True)
class Transition:
    """A transition of a job: the states before, the state after, and the actor. No state before means a new job."""

    name: str
    before: tuple[JobState, ...]
    after: JobState
    by: str


ENQUEUE = Transition("enqueue", (), JobState.QUEUED, "intake, a regrade, a quarantine")
COPY = Transition("copy", (JobState.QUEUED,), JobState.DONE, "intake")
SUPERSEDE = Transition("supersede", (JobState.QUEUED,), JobState.CANCELLED, "intake")
CLAIM = Transition("claim", (JobState.QUEUED,), JobState.RUNNING, "a worker")
HEARTBEAT = Transition("heartbeat", (JobState.RUNNING,), JobState.RUNNING, "the worker that holds it")
FINISH = Transition("finish", (JobState.RUNNING,), JobState.DONE, "the worker that holds it")
TRY_AGAIN = Transition("try again", (JobState.RUNNING,), JobState.QUEUED, "the worker that holds it, the lease reaper")
GIVE_UP = Transition("give up", (JobState.RUNNING,), JobState.DEAD, "the worker that holds it, the lease reaper")
GIVE_BACK = Transition("give back", (JobState.RUNNING,), JobState.QUEUED, "a worker's end, a quarantine")
CANCEL = Transition("cancel", (JobState.QUEUED, JobState.RUNNING), JobState.CANCELLED, "staff")
RETRY = Transition("retry", (JobState.DEAD,), JobState.QUEUED, "staff")
PUT_ASIDE = Transition("put aside", (JobState.QUEUED,), JobState.CANCELLED, "intake")
ASK_FOR = Transition("ask for", (JobState.CANCELLED,), JobState.QUEUED, "staff")
TRANSITIONS = (
    ENQUEUE, COPY, SUPERSEDE, CLAIM, HEARTBEAT, FINISH, TRY_AGAIN, GIVE_UP, GIVE_BACK, CANCEL, RETRY,
    PUT_ASIDE, ASK_FOR,
)  # fmt: skip


def build_state_columns(state: JobState, current_time: datetime) -> dict[str, Any]:
    """Return the columns that every transition into a state sets."""
    match state:
        case JobState.QUEUED:
            queue_columns = {"progress": 0.0, "due_at": current_time, "notified_at": None, "finished_at": None}
            return {"lease": None, "lease_until": None} | queue_columns
        case JobState.RUNNING:
            return {}
        case JobState.DONE:
            return {"lease": None, "lease_until": None, "finished_at": current_time, "progress": 1.0, "error": None}
        case JobState.DEAD | JobState.CANCELLED:
            return {"lease": None, "lease_until": None, "finished_at": current_time}


def apply_transition(
    session: Session,
    transition: Transition,
    conditions: tuple[ColumnElement[bool], ...],
    current_time: datetime,
    values: dict[str, Any],
) -> int:
    """Apply the transition to those of these jobs that are in a valid state before it. Return their number."""
    columns = {"state": transition.after} | build_state_columns(transition.after, current_time) | values
    conditions = (*conditions, Job.state.in_(transition.before))
    statement = update(Job).where(match_and_lock_jobs(*conditions), *conditions).values(**columns)
    options = {"synchronize_session": False}
    return cast("CursorResult[Any]", session.execute(statement, execution_options=options)).rowcount
