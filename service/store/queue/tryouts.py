"""Test runs: student programs that run without being submitted. Limits, claims and results.

They have a separate queue, leave no marks and are deleted after a day. ``service.trying`` runs them.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, cast

from sqlalchemy import ColumnElement, CursorResult, and_, delete, func, or_, select, update
from sqlalchemy.orm import Session

from service.store.engine import Store, now, retry_conflicts
from service.store.models import AssignmentVersion, Enrolment
from service.store.revision import needs_newer_code
from service.store.states import TryoutState
from service.store.web_tables import Tryout
from sim.errors import UsageError

#: Test runs of one student within an hour.
MOST_AN_HOUR = 30
#: The first death of a worker is retried; a second one is attributed to the program.
MOST_ATTEMPTS = 2
_KEPT = timedelta(days=1)
_SILENT = "The worker stopped responding twice. An operator can find details in the log of the worker."
_UNFINISHED = (TryoutState.QUEUED.value, TryoutState.RUNNING.value)


@dataclass(frozen=True, slots=True)
class TryoutClaim:
    """A test run claimed by one worker; ``attempt`` distinguishes it from later claims."""

    id: str
    attempt: int


@dataclass(frozen=True, slots=True)
class TryoutLane:
    """Number of queued and running test runs, and the waiting time of the oldest."""

    queued: int
    running: int
    oldest_seconds: float


@dataclass(frozen=True, slots=True)
class TryoutLine:
    """A test run, as its student sees it."""

    id: str
    assignment: str
    title: str
    state: TryoutState
    queued_at: datetime
    before: int  # number of older queued ones
    words: dict[str, Any]
    error: str

    @property
    def waits(self) -> bool:
        """Return whether the result is still pending."""
        return self.state.value in _UNFINISHED


def ask(session: Session, enrolment_id: int, version_id: int, packed: bytes) -> str:
    """Queue a program for a test run and return its id.

    Raises UsageError if the student has an unfinished one, or too many within an hour.
    """
    # Serialises concurrent requests, so that the second one finds the first.
    session.execute(select(Enrolment.id).where(Enrolment.id == enrolment_id).with_for_update(key_share=True)).all()
    at = now(session)
    of_student = Tryout.enrolment_id == enrolment_id
    session.execute(delete(Tryout).where(Tryout.queued_at < at - _KEPT, Tryout.state.not_in(_UNFINISHED)))
    if session.scalar(select(func.count()).where(of_student, Tryout.state.in_(_UNFINISHED))):
        raise UsageError("your previous test run is not completed yet; wait for it before you start another one.")
    if (session.scalar(select(func.count()).where(of_student, Tryout.queued_at > at - timedelta(hours=1))) or 0) >= (
        MOST_AN_HOUR
    ):
        raise UsageError(
            "%(count)s test runs within an hour is the limit; wait a few minutes, or submit your files.",
            count=MOST_AN_HOUR,
        )
    _forget_programs(session, enrolment_id, version_id)
    row = Tryout(
        enrolment_id=enrolment_id,
        assignment_version_id=version_id,
        packed=packed,
        state=TryoutState.QUEUED.value,
        queued_at=at,
    )
    session.add(row)
    session.flush()
    return row.id


def _forget_programs(session: Session, enrolment_id: int, version_id: int) -> None:
    """Remove the programs of a student's earlier test runs of the assignment; their results are kept for a day."""
    assignment = select(AssignmentVersion.assignment).where(AssignmentVersion.id == version_id).scalar_subquery()
    versions = select(AssignmentVersion.id).where(AssignmentVersion.assignment == assignment)
    tried = (Tryout.enrolment_id == enrolment_id, Tryout.assignment_version_id.in_(versions))
    session.execute(update(Tryout).where(*tried, Tryout.state.not_in(_UNFINISHED)).values(packed=b""))


@retry_conflicts
def claim(store: Store, lease_seconds: float) -> TryoutClaim | None:
    """Claim the oldest test run; None if none is due. Gives up those that ended two workers."""
    with store.transaction() as session:
        if needs_newer_code(session):
            return None
        at = now(session)
        given_up = update(Tryout).where(_due(at), Tryout.attempt >= MOST_ATTEMPTS)
        session.execute(given_up.values(state=TryoutState.FAILED.value, error=_SILENT, finished_at=at))
        query = select(Tryout.id, Tryout.attempt).where(_due(at)).order_by(Tryout.queued_at, Tryout.id).limit(1)
        found = session.execute(query.with_for_update(skip_locked=True, key_share=True)).one_or_none()
        if found is None:
            return None
        claimed = TryoutClaim(found.id, found.attempt + 1)
        lease = {"lease_until": at + timedelta(seconds=lease_seconds), "attempt": claimed.attempt}
        taken = update(Tryout).where(Tryout.id == found.id)
        session.execute(taken.values(state=TryoutState.RUNNING.value, **lease))
        return claimed


@retry_conflicts
def keep(store: Store, claimed: TryoutClaim, lease_seconds: float) -> bool:
    """Renew the lease. Return False if another worker owns the test run."""
    with store.transaction() as session:
        return _held(session, claimed, lease_until=now(session) + timedelta(seconds=lease_seconds))


@retry_conflicts
def finish(store: Store, claimed: TryoutClaim, words: dict[str, Any], replay: bytes | None) -> bool:
    """Store the result. Return False if another worker owns the test run."""
    with store.transaction() as session:
        done = {"state": TryoutState.DONE.value, "finished_at": now(session), "lease_until": None}
        return _held(session, claimed, words=words, replay=replay, error=None, **done)


@retry_conflicts
def fail(store: Store, claimed: TryoutClaim, sentence: str) -> bool:
    """Handle a host fault: the test run is queued for its second attempt, or has failed."""
    with store.transaction() as session:
        if claimed.attempt < MOST_ATTEMPTS:
            return _held(session, claimed, state=TryoutState.QUEUED.value, lease_until=None, error=sentence)
        failed = {"state": TryoutState.FAILED.value, "finished_at": now(session), "lease_until": None}
        return _held(session, claimed, error=sentence, **failed)


def due(store: Store) -> int:
    """Return the number of test runs that are due."""
    with store.reading() as session:
        return session.scalar(select(func.count()).where(_due(now(session)))) or 0


def lane(session: Session) -> TryoutLane:
    """Return the load of the test run queue."""
    waits, runs = (Tryout.state == each.value for each in (TryoutState.QUEUED, TryoutState.RUNNING))
    counts = (func.count().filter(waits), func.count().filter(runs), func.min(Tryout.queued_at).filter(waits))
    queued, running, since = session.execute(select(*counts).select_from(Tryout)).one()
    return TryoutLane(queued, running, 0.0 if since is None else max(0.0, (now(session) - since).total_seconds()))


def kept(session: Session, tryout_id: str) -> tuple[bytes, bytes]:
    """Return the packed program and the encoded assignment of a test run."""
    query = select(Tryout.packed, AssignmentVersion.content).join(
        AssignmentVersion, Tryout.assignment_version_id == AssignmentVersion.id
    )
    packed, content = session.execute(query.where(Tryout.id == tryout_id)).one()
    return packed, content


def newest(session: Session, enrolment_id: int, assignment: str) -> str | None:
    """Return the id of a student's newest test run of an assignment; None if there is none."""
    query = (
        select(Tryout.id)
        .join(AssignmentVersion, Tryout.assignment_version_id == AssignmentVersion.id)
        .where(Tryout.enrolment_id == enrolment_id, AssignmentVersion.assignment == assignment)
    )
    return session.scalar(query.order_by(Tryout.queued_at.desc(), Tryout.id).limit(1))


def line(session: Session, enrolment_id: int, tryout_id: str) -> TryoutLine | None:
    """Return one test run of a student; None if the student does not have it."""
    query = (
        select(Tryout, AssignmentVersion.assignment, AssignmentVersion.title)
        .join(AssignmentVersion, Tryout.assignment_version_id == AssignmentVersion.id)
        .where(Tryout.id == tryout_id, Tryout.enrolment_id == enrolment_id)
    )
    found = session.execute(query).one_or_none()
    if found is None:
        return None
    row, assignment, title = found
    longer = (Tryout.state == TryoutState.QUEUED.value, Tryout.queued_at < row.queued_at)
    return TryoutLine(
        row.id,
        assignment,
        title,
        TryoutState(row.state),
        row.queued_at,
        session.scalar(select(func.count()).where(*longer)) or 0,
        row.words or {},
        row.error or "",
    )


def replay_of(session: Session, tryout_id: str) -> bytes | None:
    """Return the compressed replay; None without one."""
    return session.scalar(select(Tryout.replay).where(Tryout.id == tryout_id))


def _due(at: datetime) -> ColumnElement[bool]:
    lost = and_(Tryout.state == TryoutState.RUNNING.value, Tryout.lease_until < at)
    return or_(Tryout.state == TryoutState.QUEUED.value, lost)


def _held(session: Session, claimed: TryoutClaim, **values: Any) -> bool:
    held = (
        Tryout.id == claimed.id,
        Tryout.attempt == claimed.attempt,
        Tryout.state == TryoutState.RUNNING.value,
    )
    options = {"synchronize_session": False}
    statement = update(Tryout).where(*held).values(**values)
    return cast("CursorResult[Any]", session.execute(statement, execution_options=options)).rowcount == 1
