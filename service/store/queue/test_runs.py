"""Test runs: student programs that run without being submitted. Limits, claims and results.

They have a separate queue, leave no marks and are deleted after a day. ``service.test_runs`` runs them. Notebooks share
the queue, with limits of their own (``notebook_runs.py``).
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, cast

from sqlalchemy import ColumnElement, CursorResult, Select, and_, delete, func, or_, select, update
from sqlalchemy.orm import Session

from service.store.engine import Store, now, retry_conflicts
from service.store.queue.run_programs import split_program
from service.store.revision import needs_newer_code
from service.store.states import RunState
from service.store.tables.courses import AssignmentVersion
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Tryout
from sim.errors import UsageError

#: Test runs of one student within an hour.
MAX_TEST_RUNS_PER_HOUR = 30
#: The first death of a worker is retried; a second one is attributed to the program.
MAX_ATTEMPTS = 2
_RETENTION = timedelta(days=1)
#: Ids of the built-in assignments to which runs and checks of notebooks belong. No assignment file can have them.
NOTEBOOK_RUNS, NOTEBOOK_CHECKS = "%notebook-run", "%notebook-check"
_SILENT_WORKER = "The worker stopped responding twice. An operator can find details in the log of the worker."
_UNFINISHED = (RunState.QUEUED.value, RunState.RUNNING.value)


@dataclass(frozen=True, slots=True)
class ClaimedTestRun:
    """A test run claimed by one worker; ``attempt`` distinguishes it from later claims."""

    id: str
    attempt: int


@dataclass(frozen=True, slots=True)
class QueuedTestRuns:
    """Number of queued and running test runs, and the waiting time of the oldest."""

    queued: int
    running: int
    oldest_seconds: float


@dataclass(frozen=True, slots=True)
class StudentTestRun:
    """A test run, as its student sees it."""

    id: str
    assignment: str
    title: str
    state: RunState
    queued_at: datetime
    before: int  # number of older queued ones
    words: dict[str, Any]
    error: str

    @property
    def waits(self) -> bool:
        """Return whether the result is still pending."""
        return self.state.value in _UNFINISHED


def queue_test_run(session: Session, enrolment_id: int, version_id: int, packed_submission: bytes) -> str:
    """Queue a program for a test run and return its id.

    Raises UsageError if the student has an unfinished one, or too many within an hour.
    """
    current_time = begin_queueing(session, enrolment_id)
    is_by_student = and_(Tryout.enrolment_id == enrolment_id, ~match_assignments(NOTEBOOK_RUNS, NOTEBOOK_CHECKS))
    if has_unfinished(session, is_by_student):
        raise UsageError("your previous test run is not completed yet; wait for it before you start another one.")
    if count_within_hour(session, is_by_student, current_time) >= MAX_TEST_RUNS_PER_HOUR:
        raise UsageError(
            "%(count)s test runs within an hour is the limit; wait a few minutes, or submit your files.",
            count=MAX_TEST_RUNS_PER_HOUR,
        )
    _delete_programs(session, enrolment_id, version_id)
    return insert_queued(session, enrolment_id, version_id, packed_submission, current_time)


def begin_queueing(session: Session, enrolment_id: int) -> datetime:
    """Let concurrent requests of a student wait for each other, delete expired runs, and return the current time."""
    # The second request then finds the run of the first.
    session.execute(select(Enrolment.id).where(Enrolment.id == enrolment_id).with_for_update(key_share=True)).all()
    current_time = now(session)
    session.execute(
        delete(Tryout).where(Tryout.queued_at < current_time - _RETENTION, Tryout.state.not_in(_UNFINISHED))
    )
    return current_time


def match_assignments(*assignments: str) -> ColumnElement[bool]:
    """Return the condition on a ``Tryout`` that it is of one of these assignments."""
    versions = select(AssignmentVersion.id).where(AssignmentVersion.assignment.in_(assignments))
    return Tryout.assignment_version_id.in_(versions)


def has_unfinished(session: Session, condition: ColumnElement[bool]) -> bool:
    """Return whether one of the runs is queued or running."""
    return bool(session.scalar(select(func.count()).where(condition, Tryout.state.in_(_UNFINISHED))))


def count_within_hour(session: Session, condition: ColumnElement[bool], current_time: datetime) -> int:
    """Return how many of the runs were queued within the last hour."""
    is_recent = Tryout.queued_at > current_time - timedelta(hours=1)
    return session.scalar(select(func.count()).where(condition, is_recent)) or 0


def insert_queued(session: Session, enrolment_id: int, version_id: int, packed: bytes, current_time: datetime) -> str:
    """Insert a queued run and return its id."""
    row = Tryout(
        enrolment_id=enrolment_id,
        assignment_version_id=version_id,
        packed=packed,
        state=RunState.QUEUED.value,
        queued_at=current_time,
    )
    session.add(row)
    session.flush()
    return row.id


def _delete_programs(session: Session, enrolment_id: int, version_id: int) -> None:
    """Remove the programs of a student's earlier test runs of the assignment; their results are kept for a day."""
    assignment = select(AssignmentVersion.assignment).where(AssignmentVersion.id == version_id).scalar_subquery()
    versions = select(AssignmentVersion.id).where(AssignmentVersion.assignment == assignment)
    is_earlier_run = (Tryout.enrolment_id == enrolment_id, Tryout.assignment_version_id.in_(versions))
    session.execute(update(Tryout).where(*is_earlier_run, Tryout.state.not_in(_UNFINISHED)).values(packed=b""))


@retry_conflicts
def claim_test_run(store: Store, lease_seconds: float) -> ClaimedTestRun | None:
    """Claim the oldest test run; None if none is due. Gives up those that ended two workers."""
    with store.transaction() as session:
        if needs_newer_code(session):
            return None
        current_time = now(session)
        abandon_statement = update(Tryout).where(_match_due(current_time), Tryout.attempt >= MAX_ATTEMPTS)
        session.execute(
            abandon_statement.values(state=RunState.FAILED.value, error=_SILENT_WORKER, finished_at=current_time)
        )
        query = (
            select(Tryout.id, Tryout.attempt)
            .where(_match_due(current_time))
            .order_by(Tryout.queued_at, Tryout.id)
            .limit(1)
        )
        run_row = session.execute(query.with_for_update(skip_locked=True, key_share=True)).one_or_none()
        if run_row is None:
            return None
        test_run = ClaimedTestRun(run_row.id, run_row.attempt + 1)
        lease = {"lease_until": current_time + timedelta(seconds=lease_seconds), "attempt": test_run.attempt}
        statement = update(Tryout).where(Tryout.id == run_row.id)
        session.execute(statement.values(state=RunState.RUNNING.value, **lease))
        return test_run


@retry_conflicts
def renew_lease(store: Store, test_run: ClaimedTestRun, lease_seconds: float) -> bool:
    """Renew the lease. Return False if another worker owns the test run."""
    with store.transaction() as session:
        return _update_owned(session, test_run, lease_until=now(session) + timedelta(seconds=lease_seconds))


@retry_conflicts
def finish_test_run(store: Store, test_run: ClaimedTestRun, words: dict[str, Any], replay: bytes | None) -> bool:
    """Store the result. Return False if another worker owns the test run."""
    with store.transaction() as session:
        result_columns = {"state": RunState.DONE.value, "finished_at": now(session), "lease_until": None}
        return _update_owned(session, test_run, words=words, replay=replay, error=None, **result_columns)


@retry_conflicts
def fail_test_run(store: Store, test_run: ClaimedTestRun, sentence: str) -> bool:
    """Handle a host fault: the test run is queued for its second attempt, or has failed."""
    with store.transaction() as session:
        if test_run.attempt < MAX_ATTEMPTS:
            return _update_owned(session, test_run, state=RunState.QUEUED.value, lease_until=None, error=sentence)
        result_columns = {"state": RunState.FAILED.value, "finished_at": now(session), "lease_until": None}
        return _update_owned(session, test_run, error=sentence, **result_columns)


def count_due_runs(store: Store) -> int:
    """Return the number of test runs that are due."""
    with store.reading() as session:
        return session.scalar(select(func.count()).where(_match_due(now(session)))) or 0


def measure_queue(session: Session) -> QueuedTestRuns:
    """Return the load of the test run queue."""
    is_queued, is_running = (Tryout.state == each.value for each in (RunState.QUEUED, RunState.RUNNING))
    counts = (
        func.count().filter(is_queued),
        func.count().filter(is_running),
        func.min(Tryout.queued_at).filter(is_queued),
    )
    queued_count, running_count, oldest_time = session.execute(select(*counts).select_from(Tryout)).one()
    return QueuedTestRuns(
        queued_count,
        running_count,
        0.0 if oldest_time is None else max(0.0, (now(session) - oldest_time).total_seconds()),
    )


def load_program(session: Session, tryout_id: str) -> tuple[bytes, bytes]:
    """Return the packed submission and the encoded assignment of a test run."""
    query = select(Tryout.packed, AssignmentVersion.content).join(
        AssignmentVersion, Tryout.assignment_version_id == AssignmentVersion.id
    )
    stored_program, content = session.execute(query.where(Tryout.id == tryout_id)).one()
    packed_submission, own_content = split_program(stored_program)
    return packed_submission, content if own_content is None else own_content


def find_newest_run(session: Session, enrolment_id: int, assignment: str) -> StudentTestRun | None:
    """Return a student's newest test run of an assignment; None if there is none."""
    query = _select_student_runs(enrolment_id).where(AssignmentVersion.assignment == assignment)
    return _find_run(session, query.order_by(Tryout.queued_at.desc(), Tryout.id).limit(1))


def find_student_run(session: Session, enrolment_id: int, tryout_id: str) -> StudentTestRun | None:
    """Return one test run of a student; None if the student does not have it."""
    return _find_run(session, _select_student_runs(enrolment_id).where(Tryout.id == tryout_id))


def _select_student_runs(enrolment_id: int) -> Select[Tryout, str, str]:
    return (
        select(Tryout, AssignmentVersion.assignment, AssignmentVersion.title)
        .join(AssignmentVersion, Tryout.assignment_version_id == AssignmentVersion.id)
        .where(
            Tryout.enrolment_id == enrolment_id,
            AssignmentVersion.assignment.not_in([NOTEBOOK_RUNS, NOTEBOOK_CHECKS]),
        )
    )


def _find_run(session: Session, query: Select[Tryout, str, str]) -> StudentTestRun | None:
    run_row = session.execute(query).one_or_none()
    if run_row is None:
        return None
    row, assignment, title = run_row
    return StudentTestRun(
        row.id,
        assignment,
        title,
        RunState(row.state),
        row.queued_at,
        count_earlier(session, row.queued_at),
        row.words or {},
        row.error or "",
    )


def count_earlier(session: Session, queued_at: datetime) -> int:
    """Return how many runs are ahead in the queue of one that was queued at this time."""
    is_earlier = (Tryout.state == RunState.QUEUED.value, Tryout.queued_at < queued_at)
    return session.scalar(select(func.count()).where(*is_earlier)) or 0


def load_replay(session: Session, tryout_id: str) -> bytes | None:
    """Return the compressed replay; None without one."""
    return session.scalar(select(Tryout.replay).where(Tryout.id == tryout_id))


def _match_due(current_time: datetime) -> ColumnElement[bool]:
    is_lost = and_(Tryout.state == RunState.RUNNING.value, Tryout.lease_until < current_time)
    return or_(Tryout.state == RunState.QUEUED.value, is_lost)


def _update_owned(session: Session, test_run: ClaimedTestRun, **values: Any) -> bool:
    is_owned = (
        Tryout.id == test_run.id,
        Tryout.attempt == test_run.attempt,
        Tryout.state == RunState.RUNNING.value,
    )
    options = {"synchronize_session": False}
    statement = update(Tryout).where(*is_owned).values(**values)
    return cast("CursorResult[Any]", session.execute(statement, execution_options=options)).rowcount == 1
