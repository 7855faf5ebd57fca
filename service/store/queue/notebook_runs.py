"""Runs and checks of students' notebooks in the queue of test runs: their own limits, and their results.

``test_runs.py`` claims and finishes them. A student has at most one in the queue, so that the oldest first is a fair
share for all. Results are stored for a day, but only the newest ones of each student.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

from sqlalchemy import and_, select, update
from sqlalchemy.orm import Session

from service.store.courses.assignment_versions import FrozenAssignment, store_version
from service.store.queue import test_runs
from service.store.queue.test_runs import NOTEBOOK_CHECKS, NOTEBOOK_RUNS
from service.store.states import RunState
from service.store.tables.courses import AssignmentVersion
from service.store.tables.submissions import Tryout
from sim.errors import UsageError

#: Runs of one student within an hour; each answer of a responder is one. Checks cost as much as gradings.
MAX_RUNS_PER_HOUR, MAX_CHECKS_PER_HOUR = 1000, 30
#: Newest results of one student that are stored. A lost connection needs only the last one.
_MAX_STORED = 20
_LIMITS = {NOTEBOOK_RUNS: MAX_RUNS_PER_HOUR, NOTEBOOK_CHECKS: MAX_CHECKS_PER_HOUR}


class NotebookBusy(UsageError):
    """The student's previous run or check is not completed."""


@dataclass(frozen=True, slots=True)
class StudentNotebookRun:
    """A run or check of a notebook, as its student sees it. ``refused`` says why it did not run."""

    id: str
    kind: Literal["run", "check"]
    state: RunState
    before: int  # number of older queued ones
    refused: str
    error: str

    @property
    def waits(self) -> bool:
        """Return whether the result is still pending."""
        return self.state in (RunState.QUEUED, RunState.RUNNING)


def queue_notebook_run(session: Session, enrolment_id: int, owner: FrozenAssignment, packed: bytes) -> str:
    """Queue a request of a notebook and return its id. ``owner`` is the built-in assignment of its kind.

    Raises NotebookBusy if the student has an unfinished one, UsageError if too many within an hour.
    """
    current_time = test_runs.begin_queueing(session, enrolment_id)
    kind = owner.assignment.id
    is_own = and_(Tryout.enrolment_id == enrolment_id, test_runs.match_assignments(NOTEBOOK_RUNS, NOTEBOOK_CHECKS))
    if test_runs.has_unfinished(session, is_own):
        raise NotebookBusy("your previous run or check is not completed yet; wait for it before you start another one.")
    is_own_kind = and_(Tryout.enrolment_id == enrolment_id, test_runs.match_assignments(kind))
    if test_runs.count_within_hour(session, is_own_kind, current_time) >= _LIMITS[kind]:
        raise UsageError(
            "%(count)s messages and runs, or %(checks)s checks, of a notebook within an hour is the limit; wait a few "
            "minutes.",
            count=MAX_RUNS_PER_HOUR,
            checks=MAX_CHECKS_PER_HOUR,
        )
    newest = select(Tryout.id).where(is_own).order_by(Tryout.queued_at.desc(), Tryout.id).limit(_MAX_STORED)
    # The rows stay for a day, because they are counted.
    session.execute(update(Tryout).where(is_own, Tryout.packed != b"").values(packed=b""))
    is_old = and_(is_own, Tryout.replay.is_not(None), Tryout.id.not_in(select(newest.subquery().c.id)))
    session.execute(update(Tryout).where(is_old).values(replay=None))
    return test_runs.insert_queued(
        session, enrolment_id, store_version(session, owner, current_time), packed, current_time
    )


def find_student_run(session: Session, enrolment_id: int, run_id: str) -> StudentNotebookRun | None:
    """Return one run or check of a student; None if the student does not have it."""
    query = (
        select(Tryout, AssignmentVersion.assignment)
        .join(AssignmentVersion, Tryout.assignment_version_id == AssignmentVersion.id)
        .where(
            Tryout.id == run_id,
            Tryout.enrolment_id == enrolment_id,
            AssignmentVersion.assignment.in_([NOTEBOOK_RUNS, NOTEBOOK_CHECKS]),
        )
    )
    found = session.execute(query).one_or_none()
    if found is None:
        return None
    row, assignment = found
    state = RunState(row.state)
    return StudentNotebookRun(
        row.id,
        "run" if assignment == NOTEBOOK_RUNS else "check",
        state,
        test_runs.count_earlier(session, row.queued_at) if state is RunState.QUEUED else 0,
        (row.words or {}).get("refused", ""),
        row.error or "",
    )


def list_ended(session: Session, run_ids: Collection[str]) -> list[str]:
    """Return those of the runs that are neither queued nor running; unknown ids are not returned."""
    is_ended = Tryout.state.in_([RunState.DONE.value, RunState.FAILED.value])
    return list(session.scalars(select(Tryout.id).where(Tryout.id.in_(run_ids), is_ended)))
