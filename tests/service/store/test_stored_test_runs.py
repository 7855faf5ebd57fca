"""Test runs: one at a time, a number per hour, and none lost or endless after a worker's death."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta

import pytest
from sqlalchemy import func, select, update

from builders import echo, grading_request
from service.store.courses.assignment_versions import (
    assignment_from_bytes,
    assignment_to_bytes,
    freeze_assignment,
    store_version,
)
from service.store.engine import Store, now
from service.store.people.students import Students, ensure_course
from service.store.queue import test_runs
from service.store.queue.run_programs import add_assignment
from service.store.queue.test_runs import MAX_TEST_RUNS_PER_HOUR, StudentTestRun
from service.store.states import RunState
from service.store.tables.submissions import Tryout
from sim.errors import UsageError
from submissions.stored_submission import pack_submission
from submissions.student_identity import Student

PACKED = pack_submission(grading_request().submission)


def _enrolled(store: Store, student: str = "ada") -> int:
    with store.transaction() as session:
        at = now(session)
        return Students(session, ensure_course(session, "default", at)).enrol(Student(student), at)


def _ask(store: Store, enrolment_id: int) -> str:
    frozen = freeze_assignment(echo())
    with store.transaction() as session:
        return test_runs.queue_test_run(session, enrolment_id, store_version(session, frozen, now(session)), PACKED)


def _line(store: Store, enrolment_id: int, tryout_id: str) -> StudentTestRun:
    with store.reading() as session:
        student_run = test_runs.find_student_run(session, enrolment_id, tryout_id)
    assert student_run is not None
    return student_run


def _pass(store: Store, seconds: float) -> None:
    """Simulate the passing of this time for all test runs."""
    with store.transaction() as session:
        for row in session.scalars(select(Tryout)):
            row.queued_at -= timedelta(seconds=seconds)
            row.lease_until = row.lease_until and row.lease_until - timedelta(seconds=seconds)


def test_they_are_run_in_turn_and_each_student_sees_their_own(store: Store) -> None:
    ada, bob = _enrolled(store), _enrolled(store, "bob")
    first, second = _ask(store, ada), _ask(store, bob)
    assert (_line(store, bob, second).before, test_runs.count_due_runs(store)) == (1, 2)
    claimed = test_runs.claim_test_run(store, 60)
    assert claimed is not None
    assert (claimed.id, test_runs.count_due_runs(store)) == (first, 1)
    with store.reading() as session:
        packed, content = test_runs.load_program(session, first)
        assert (packed, assignment_from_bytes(content).id) == (PACKED, echo().id)
        assert test_runs.find_student_run(session, bob, first) is None
    assert test_runs.finish_test_run(store, claimed, {"happened": "it ran"}, b"replay")
    done = _line(store, ada, first)
    assert (done.state, done.words, done.error) == (RunState.DONE, {"happened": "it ran"}, "")
    with store.reading() as session:
        assert test_runs.load_replay(session, first) == b"replay"
        assert test_runs.find_newest_run(session, ada, echo().id) == done


@pytest.mark.long
def test_a_student_has_one_at_a_time_and_so_many_an_hour(store: Store) -> None:
    ada = _enrolled(store)
    _ask(store, ada)
    with pytest.raises(UsageError, match="is not completed yet"):
        _ask(store, ada)
    for number in range(MAX_TEST_RUNS_PER_HOUR):
        claimed = test_runs.claim_test_run(store, 60)
        assert claimed is not None
        assert test_runs.finish_test_run(store, claimed, {}, None)
        if number < MAX_TEST_RUNS_PER_HOUR - 1:
            _ask(store, ada)
    with pytest.raises(UsageError, match="within an hour"):
        _ask(store, ada)
    _ask(store, _enrolled(store, "bob"))
    _pass(store, 3700)
    _ask(store, ada)


def test_a_dead_workers_is_run_once_more_and_its_late_answer_counts_no_more(store: Store) -> None:
    ada = _enrolled(store)
    tried = _ask(store, ada)
    first = test_runs.claim_test_run(store, 60)
    assert first is not None
    assert test_runs.renew_lease(store, first, 60)
    assert test_runs.claim_test_run(store, 60) is None
    _pass(store, 61)
    assert test_runs.count_due_runs(store) == 1
    second = test_runs.claim_test_run(store, 60)
    assert second is not None
    assert not test_runs.finish_test_run(store, first, {"happened": "late"}, None)
    assert not test_runs.renew_lease(store, first, 60)
    _pass(store, 61)
    assert test_runs.claim_test_run(store, 60) is None
    assert (_line(store, ada, tried).state, test_runs.count_due_runs(store)) == (RunState.FAILED, 0)
    assert not test_runs.finish_test_run(store, second, {"happened": "late"}, None)
    _ask(store, ada)


def test_a_fault_of_ours_is_tried_once_more(store: Store) -> None:
    ada = _enrolled(store)
    tried = _ask(store, ada)
    for state in (RunState.QUEUED, RunState.FAILED):
        claimed = test_runs.claim_test_run(store, 60)
        assert claimed is not None
        assert test_runs.fail_test_run(store, claimed, "The machine failed.")
        assert (_line(store, ada, tried).state, _line(store, ada, tried).error) == (state, "The machine failed.")
    assert test_runs.claim_test_run(store, 60) is None


def test_what_was_tried_goes_a_day_after(store: Store) -> None:
    ada = _enrolled(store)
    _ask(store, ada)
    with store.transaction() as session:
        session.execute(update(Tryout).values(state=RunState.DONE.value))
    _pass(store, 25 * 3600)
    _ask(store, ada)
    with store.reading() as session:
        assert session.scalar(select(func.count()).select_from(Tryout)) == 1


def test_of_what_a_student_tries_the_newest_program_is_kept(store: Store) -> None:
    ada, bob = _enrolled(store), _enrolled(store, "bob")
    tried = [_ask(store, bob)]
    for _ in range(3):
        tried.append(_ask(store, ada))
        while (claimed := test_runs.claim_test_run(store, 60)) is not None:
            assert test_runs.finish_test_run(store, claimed, {}, None)
    with store.reading() as session:
        sizes = {row.id: len(row.packed) for row in session.scalars(select(Tryout))}
    assert [sizes[each] > 0 for each in tried] == [True, False, False, True]


@pytest.mark.parametrize("count", [20, pytest.param(200, marks=pytest.mark.long)])
def test_many_students_at_once_are_each_run_before_one_of_them_is_run_again(store: Store, count: int) -> None:
    """A student who starts the next run as soon as one has ended waits behind all others each time."""
    eager = _enrolled(store, "eager")
    owners = {_ask(store, eager): "eager"}
    owners |= {_ask(store, _enrolled(store, f"student {number}")): "another" for number in range(count - 1)}
    order: list[str] = []
    while (claimed := test_runs.claim_test_run(store, 60)) is not None and len(order) < count + 2:
        order.append(owners[claimed.id])
        assert test_runs.finish_test_run(store, claimed, {}, None)
        if owners[claimed.id] == "eager":
            owners[_ask(store, eager)] = "eager"
    assert [place for place, owner in enumerate(order) if owner == "eager"] == [0, count, count + 1]


def test_runs_with_a_world_of_their_own_count_in_the_same_limits(store: Store) -> None:
    ada = _enrolled(store)
    other = replace(echo(), id="another", title="Another")
    stored = add_assignment(PACKED, assignment_to_bytes(other))
    frozen = freeze_assignment(echo())
    with store.transaction() as session:
        version_id = store_version(session, frozen, now(session))
        run = test_runs.queue_test_run(session, ada, version_id, stored)
        packed, content = test_runs.load_program(session, run)
    assert (packed, assignment_from_bytes(content).id) == (PACKED, "another")
    with pytest.raises(UsageError, match="is not completed yet"):
        _ask(store, ada)
