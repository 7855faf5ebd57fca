"""Programs that students try without submitting them: who may, whose is run next, and what came of it.

They have a lane of their own beside the jobs', leave no marks, and go a day after. Running one is ``service.trying``'s.
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

#: What one student may try within an hour.
MOST_AN_HOUR = 30
#: A worker that dies with one loses nothing; the second death is taken to be the program's doing.
MOST_ATTEMPTS = 2
_KEPT = timedelta(days=1)
_SILENT = "Whatever ran it fell silent twice; whoever runs the installation finds more in its log."
_UNFINISHED = (TryoutState.QUEUED.value, TryoutState.RUNNING.value)


@dataclass(frozen=True, slots=True)
class TryoutClaim:
    """A tryout in the hands of one worker; the number of the attempt tells it from a later one."""

    id: str
    attempt: int


@dataclass(frozen=True, slots=True)
class TryoutLane:
    """How many are waiting and running, and how long the oldest has waited."""

    queued: int
    running: int
    oldest_seconds: float


@dataclass(frozen=True, slots=True)
class TryoutLine:
    """A tryout as its student sees it."""

    id: str
    assignment: str
    title: str
    state: TryoutState
    queued_at: datetime
    before: int  # how many wait longer
    words: dict[str, Any]
    error: str

    @property
    def waits(self) -> bool:
        """Whether something is still to come."""
        return self.state.value in _UNFINISHED


def ask(session: Session, enrolment_id: int, version_id: int, packed: bytes) -> str:
    """Let a program wait to be run. Returns its id.

    Raises UsageError where the student has one waiting, or has tried too many within an hour.
    """
    # One at a time: of two that ask at once, the second finds the first.
    session.execute(select(Enrolment.id).where(Enrolment.id == enrolment_id).with_for_update(key_share=True)).all()
    at = now(session)
    of_student = Tryout.enrolment_id == enrolment_id
    session.execute(delete(Tryout).where(Tryout.queued_at < at - _KEPT, Tryout.state.not_in(_UNFINISHED)))
    if session.scalar(select(func.count()).where(of_student, Tryout.state.in_(_UNFINISHED))):
        raise UsageError("one that you try is not through yet; wait for it, then try the next.")
    if (session.scalar(select(func.count()).where(of_student, Tryout.queued_at > at - timedelta(hours=1))) or 0) >= (
        MOST_AN_HOUR
    ):
        raise UsageError("you have tried %(count)s within an hour; wait a while, or submit it.", count=MOST_AN_HOUR)
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
    """Remove what a student tried before for the same assignment; what came of it is kept for a day."""
    assignment = select(AssignmentVersion.assignment).where(AssignmentVersion.id == version_id).scalar_subquery()
    versions = select(AssignmentVersion.id).where(AssignmentVersion.assignment == assignment)
    tried = (Tryout.enrolment_id == enrolment_id, Tryout.assignment_version_id.in_(versions))
    session.execute(update(Tryout).where(*tried, Tryout.state.not_in(_UNFINISHED)).values(packed=b""))


@retry_conflicts
def claim(store: Store, lease_seconds: float) -> TryoutClaim | None:
    """Take the one that has waited longest; None when none is due. What has killed two workers is given up."""
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
    """Keep the lease; false when it is another's by now."""
    with store.transaction() as session:
        return _held(session, claimed, lease_until=now(session) + timedelta(seconds=lease_seconds))


@retry_conflicts
def finish(store: Store, claimed: TryoutClaim, words: dict[str, Any], replay: bytes | None) -> bool:
    """Keep what came of it; false when it is another's by now."""
    with store.transaction() as session:
        done = {"state": TryoutState.DONE.value, "finished_at": now(session), "lease_until": None}
        return _held(session, claimed, words=words, replay=replay, error=None, **done)


@retry_conflicts
def fail(store: Store, claimed: TryoutClaim, sentence: str) -> bool:
    """A fault of ours: it waits for its other attempt, or has failed."""
    with store.transaction() as session:
        if claimed.attempt < MOST_ATTEMPTS:
            return _held(session, claimed, state=TryoutState.QUEUED.value, lease_until=None, error=sentence)
        failed = {"state": TryoutState.FAILED.value, "finished_at": now(session), "lease_until": None}
        return _held(session, claimed, error=sentence, **failed)


def due(store: Store) -> int:
    """How many could be run now."""
    with store.reading() as session:
        return session.scalar(select(func.count()).where(_due(now(session)))) or 0


def lane(session: Session) -> TryoutLane:
    """How full the lane is."""
    waits, runs = (Tryout.state == each.value for each in (TryoutState.QUEUED, TryoutState.RUNNING))
    counts = (func.count().filter(waits), func.count().filter(runs), func.min(Tryout.queued_at).filter(waits))
    queued, running, since = session.execute(select(*counts).select_from(Tryout)).one()
    return TryoutLane(queued, running, 0.0 if since is None else max(0.0, (now(session) - since).total_seconds()))


def kept(session: Session, tryout_id: str) -> tuple[bytes, bytes]:
    """What is to be run, packed, and the assignment that it is run for, as ``versions`` keeps it."""
    query = select(Tryout.packed, AssignmentVersion.content).join(
        AssignmentVersion, Tryout.assignment_version_id == AssignmentVersion.id
    )
    packed, content = session.execute(query.where(Tryout.id == tryout_id)).one()
    return packed, content


def newest(session: Session, enrolment_id: int, assignment: str) -> str | None:
    """The id of what a student tried last for an assignment; None where there is nothing any more."""
    query = (
        select(Tryout.id)
        .join(AssignmentVersion, Tryout.assignment_version_id == AssignmentVersion.id)
        .where(Tryout.enrolment_id == enrolment_id, AssignmentVersion.assignment == assignment)
    )
    return session.scalar(query.order_by(Tryout.queued_at.desc(), Tryout.id).limit(1))


def line(session: Session, enrolment_id: int, tryout_id: str) -> TryoutLine | None:
    """One of a student's; None where they have none of this id."""
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
    """What the replay plays, compressed; None where there is nothing to play."""
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
