"""Test runs of student programs, without submitting them. They leave no marks and are kept for a day."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.operations.errors import NotFound
from service.operations.lookup import own_enrolment
from service.operations.own_views import seen_assignment
from service.operations.submissions import sending
from service.store.queue import tryouts
from service.store.queue.tryouts import TryoutLine
from service.store.states import Role
from service.trying import tryout_assignment
from sim.errors import UsageError
from submissions.assignment.task_sheet import TaskSheet, task_sheet
from submissions.packed import pack_submission, unpack_submission
from submissions.raw_files import SentFile
from submissions.submission import Submission

__all__ = ["TryoutLine"]


@dataclass(frozen=True, slots=True)
class TestRunView:
    """A student's newest test run of an assignment, and the assignment's task."""

    sheet: TaskSheet
    seconds: float | None  # simulated; None without a scenario visible to students
    line: TryoutLine | None
    replay: bytes | None  # compressed
    submission: Submission | None


def start(service: Service, actor: Actor, course_id: int, assignment: str, sent: Sequence[SentFile]) -> str:
    """Queue a test run and notify the workers. Returns the id of the test run.

    Raises NotFound if students cannot see the assignment. Raises UsageError if it is closed or has no visible scenario,
    the files are not a valid submission, or the student has too many test runs.
    """
    way = sending(service, actor, course_id, assignment)
    if tryout_assignment(way.assignment) is None:
        raise UsageError("test runs are not available for this assignment; submit your files instead.")
    packed = pack_submission(way.read(sent).submission)
    with service.store.transaction() as session:
        made = tryouts.ask(session, way.enrolment_id, way.opened.version_id, packed)
    service.notifier.try_out()
    return made


def show_newest(service: Service, actor: Actor, course_id: int, assignment: str) -> TestRunView:
    """Return the actor's newest test run of an assignment, with its program. Raises NotFound if they may not see it."""
    with service.store.reading() as session:
        enrolment_id = own_enrolment(session, actor, course_id, Role.STUDENT).id
        seen = seen_assignment(session, course_id, enrolment_id, assignment)
        newest = tryouts.newest(session, enrolment_id, assignment)
        line = tryouts.line(session, enrolment_id, newest) if newest else None
        replay = tryouts.replay_of(session, newest) if newest else None
        submission = unpack_submission(tryouts.kept(session, newest)[0]) if newest else None
    once = tryout_assignment(seen)
    return TestRunView(task_sheet(seen), once.scenarios[0].seconds if once else None, line, replay, submission)


def find_newest(service: Service, actor: Actor, course_id: int, assignment: str) -> TryoutLine | None:
    """Return the state of the actor's newest test run of an assignment; None if there is none."""
    with service.store.reading() as session:
        enrolment_id = own_enrolment(session, actor, course_id, Role.STUDENT).id
        newest = tryouts.newest(session, enrolment_id, assignment)
        return tryouts.line(session, enrolment_id, newest) if newest else None


def show(service: Service, actor: Actor, course_id: int, tryout_id: str) -> TryoutLine:
    """Return one of the actor's test runs. Raises NotFound."""
    with service.store.reading() as session:
        return _own(session, actor, course_id, tryout_id)


def show_replay(service: Service, actor: Actor, course_id: int, tryout_id: str) -> bytes:
    """Return the compressed replay of one of the actor's test runs. Raises NotFound, also without a replay."""
    with service.store.reading() as session:
        replay = tryouts.replay_of(session, _own(session, actor, course_id, tryout_id).id)
    if replay is None:
        raise NotFound("There is no such page or item, or you have no access to it.")
    return replay


def _own(session: Session, actor: Actor, course_id: int, tryout_id: str) -> TryoutLine:
    line = tryouts.line(session, own_enrolment(session, actor, course_id, Role.STUDENT).id, tryout_id)
    if line is None:
        raise NotFound("There is no such page or item, or you have no access to it.")
    return line
