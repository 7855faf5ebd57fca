"""Test runs: one at a time, a number per hour, and none lost or endless after a worker's death."""

from __future__ import annotations

from datetime import timedelta

import pytest
from sqlalchemy import func, select, update

from builders import echo, grading_request
from service.store.courses.versions import assignment_from_bytes, freeze, keep
from service.store.engine import Store, now
from service.store.people.students import Students, course_of
from service.store.queue import tryouts
from service.store.queue.tryouts import MOST_AN_HOUR, TryoutLine
from service.store.states import TryoutState
from service.store.web_tables import Tryout
from sim.errors import UsageError
from submissions.packed import pack_submission
from submissions.student_identity import Student

PACKED = pack_submission(grading_request().submission)


def _enrolled(store: Store, student: str = "ada") -> int:
    with store.transaction() as session:
        at = now(session)
        return Students(session, course_of(session, "default", at)).enrol(Student(student), at)


def _ask(store: Store, enrolment_id: int) -> str:
    frozen = freeze(echo())
    with store.transaction() as session:
        return tryouts.ask(session, enrolment_id, keep(session, frozen, now(session)), PACKED)


def _line(store: Store, enrolment_id: int, tryout_id: str) -> TryoutLine:
    with store.reading() as session:
        found = tryouts.line(session, enrolment_id, tryout_id)
    assert found is not None
    return found


def _pass(store: Store, seconds: float) -> None:
    """Simulate the passing of this time for all test runs."""
    with store.transaction() as session:
        for row in session.scalars(select(Tryout)):
            row.queued_at -= timedelta(seconds=seconds)
            row.lease_until = row.lease_until and row.lease_until - timedelta(seconds=seconds)


def test_they_are_run_in_turn_and_each_student_sees_their_own(store: Store) -> None:
    ada, bob = _enrolled(store), _enrolled(store, "bob")
    first, second = _ask(store, ada), _ask(store, bob)
    assert (_line(store, bob, second).before, tryouts.due(store)) == (1, 2)
    claimed = tryouts.claim(store, 60)
    assert claimed is not None
    assert (claimed.id, tryouts.due(store)) == (first, 1)
    with store.reading() as session:
        packed, content = tryouts.kept(session, first)
        assert (packed, assignment_from_bytes(content).id) == (PACKED, echo().id)
        assert tryouts.line(session, bob, first) is None
    assert tryouts.finish(store, claimed, {"happened": "it ran"}, b"replay")
    done = _line(store, ada, first)
    assert (done.state, done.words, done.error) == (TryoutState.DONE, {"happened": "it ran"}, "")
    with store.reading() as session:
        assert tryouts.replay_of(session, first) == b"replay"
        assert tryouts.newest(session, ada, echo().id) == first


def test_a_student_has_one_at_a_time_and_so_many_an_hour(store: Store) -> None:
    ada = _enrolled(store)
    _ask(store, ada)
    with pytest.raises(UsageError, match="is not completed yet"):
        _ask(store, ada)
    for number in range(MOST_AN_HOUR):
        claimed = tryouts.claim(store, 60)
        assert claimed is not None
        assert tryouts.finish(store, claimed, {}, None)
        if number < MOST_AN_HOUR - 1:
            _ask(store, ada)
    with pytest.raises(UsageError, match="within an hour"):
        _ask(store, ada)
    _ask(store, _enrolled(store, "bob"))
    _pass(store, 3700)
    _ask(store, ada)


def test_a_dead_workers_is_run_once_more_and_its_late_answer_counts_no_more(store: Store) -> None:
    ada = _enrolled(store)
    tried = _ask(store, ada)
    first = tryouts.claim(store, 60)
    assert first is not None
    assert tryouts.keep(store, first, 60)
    assert tryouts.claim(store, 60) is None
    _pass(store, 61)
    assert tryouts.due(store) == 1
    second = tryouts.claim(store, 60)
    assert second is not None
    assert not tryouts.finish(store, first, {"happened": "late"}, None)
    assert not tryouts.keep(store, first, 60)
    _pass(store, 61)
    assert tryouts.claim(store, 60) is None
    assert (_line(store, ada, tried).state, tryouts.due(store)) == (TryoutState.FAILED, 0)
    assert not tryouts.finish(store, second, {"happened": "late"}, None)
    _ask(store, ada)


def test_a_fault_of_ours_is_tried_once_more(store: Store) -> None:
    ada = _enrolled(store)
    tried = _ask(store, ada)
    for state in (TryoutState.QUEUED, TryoutState.FAILED):
        claimed = tryouts.claim(store, 60)
        assert claimed is not None
        assert tryouts.fail(store, claimed, "The machine failed.")
        assert (_line(store, ada, tried).state, _line(store, ada, tried).error) == (state, "The machine failed.")
    assert tryouts.claim(store, 60) is None


def test_what_was_tried_goes_a_day_after(store: Store) -> None:
    ada = _enrolled(store)
    _ask(store, ada)
    with store.transaction() as session:
        session.execute(update(Tryout).values(state=TryoutState.DONE.value))
    _pass(store, 25 * 3600)
    _ask(store, ada)
    with store.reading() as session:
        assert session.scalar(select(func.count()).select_from(Tryout)) == 1


def test_of_what_a_student_tries_the_newest_program_is_kept(store: Store) -> None:
    ada, bob = _enrolled(store), _enrolled(store, "bob")
    tried = [_ask(store, bob)]
    for _ in range(3):
        tried.append(_ask(store, ada))
        while (claimed := tryouts.claim(store, 60)) is not None:
            assert tryouts.finish(store, claimed, {}, None)
    with store.reading() as session:
        sizes = {row.id: len(row.packed) for row in session.scalars(select(Tryout))}
    assert [sizes[each] > 0 for each in tried] == [True, False, False, True]
