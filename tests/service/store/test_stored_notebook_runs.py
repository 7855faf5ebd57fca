"""Runs and checks of notebooks: one at a time, a number per hour, apart from test runs, and few results each."""

from __future__ import annotations

from datetime import timedelta

import pytest
from sqlalchemy import select

from builders import echo, grading_request
from service.notebook_engine.stored_requests import build_owner
from service.store.courses.assignment_versions import freeze_assignment, store_version
from service.store.engine import Store, now
from service.store.people.students import Students, ensure_course
from service.store.queue import notebook_runs, test_runs
from service.store.queue.notebook_runs import NotebookBusy, StudentNotebookRun
from service.store.queue.test_runs import NOTEBOOK_CHECKS, NOTEBOOK_RUNS
from service.store.states import RunState
from service.store.tables.submissions import Tryout
from sim.errors import UsageError
from submissions.stored_submission import pack_submission
from submissions.student_identity import Student


def _enrolled(store: Store, student: str = "ada") -> int:
    with store.transaction() as session:
        at = now(session)
        return Students(session, ensure_course(session, "default", at)).enrol(Student(student), at)


def _ask(store: Store, enrolment_id: int, kind: str = NOTEBOOK_RUNS) -> str:
    owner = freeze_assignment(build_owner(kind))
    with store.transaction() as session:
        return notebook_runs.queue_notebook_run(session, enrolment_id, owner, b"a request")


def _finish(store: Store) -> str:
    claimed = test_runs.claim_test_run(store, 60)
    assert claimed is not None
    assert test_runs.finish_test_run(store, claimed, {}, b"a result")
    return claimed.id


def _find(store: Store, enrolment_id: int, run_id: str) -> StudentNotebookRun | None:
    with store.reading() as session:
        return notebook_runs.find_student_run(session, enrolment_id, run_id)


def _result(store: Store, run_id: str) -> bytes | None:
    with store.reading() as session:
        return test_runs.load_replay(session, run_id)


def test_the_oldest_comes_first_and_each_student_has_one(store: Store) -> None:
    ada, bob = _enrolled(store), _enrolled(store, "bob")
    first, second = _ask(store, ada), _ask(store, bob)
    for kind in (NOTEBOOK_RUNS, NOTEBOOK_CHECKS):
        with pytest.raises(NotebookBusy, match="not completed yet"):
            _ask(store, ada, kind)
    waiting = _find(store, bob, second)
    assert waiting == StudentNotebookRun(second, "run", RunState.QUEUED, 1, "", "")
    assert _find(store, ada, second) is None
    with store.reading() as session:
        assert notebook_runs.list_ended(session, [first, second, "unknown"]) == []
    assert _finish(store) == first
    again = _ask(store, ada, NOTEBOOK_CHECKS)
    assert (_finish(store), _finish(store)) == (second, again)  # a fair share for bob
    with store.reading() as session:
        assert set(notebook_runs.list_ended(session, [first, second, again])) == {first, second, again}
    found = _find(store, ada, again)
    assert found is not None
    assert (found.kind, found.waits) == ("check", False)


def test_test_runs_and_notebooks_are_counted_and_found_apart(store: Store) -> None:
    ada = _enrolled(store)
    packed = pack_submission(grading_request().submission)
    run_id = _ask(store, ada)
    with store.transaction() as session:
        version_id = store_version(session, freeze_assignment(echo()), now(session))
        tryout_id = test_runs.queue_test_run(session, ada, version_id, packed)
    assert _find(store, ada, tryout_id) is None
    with store.reading() as session:
        assert test_runs.find_student_run(session, ada, run_id) is None
        newest = test_runs.find_newest_run(session, ada, echo().id)
        assert newest is not None
        assert newest.id == tryout_id
    with store.transaction() as session, pytest.raises(UsageError, match="is not completed yet"):
        test_runs.queue_test_run(session, ada, version_id, packed)


@pytest.mark.parametrize("kind", [NOTEBOOK_RUNS, NOTEBOOK_CHECKS])
def test_a_student_has_so_many_an_hour(store: Store, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(notebook_runs._LIMITS, kind, 3)
    ada = _enrolled(store)
    for _ in range(3):
        _ask(store, ada, kind)
        _finish(store)
    with pytest.raises(UsageError, match="within an hour is the limit"):
        _ask(store, ada, kind)
    with store.transaction() as session:
        for row in session.scalars(select(Tryout)):
            row.queued_at -= timedelta(minutes=61)
    _ask(store, ada, kind)


def test_only_the_newest_results_are_stored_and_no_request_longer_than_needed(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(notebook_runs, "_MAX_STORED", 2)
    ada, bob = _enrolled(store), _enrolled(store, "bob")
    of_bob = _ask(store, bob)
    _finish(store)
    ids = []
    for _ in range(4):
        ids.append(_ask(store, ada))
        _finish(store)
    last = _ask(store, ada)
    assert [_result(store, each) for each in ids] == [None, None, b"a result", b"a result"]
    assert _result(store, of_bob) == b"a result"
    with store.reading() as session:
        stored = session.scalars(select(Tryout.id).where(Tryout.packed != b"", Tryout.enrolment_id == ada)).all()
        assert stored == [last]
    with store.transaction() as session:
        for row in session.scalars(select(Tryout)):
            row.queued_at -= timedelta(hours=25)
    _finish(store)
    _ask(store, ada)
    assert _find(store, ada, ids[-1]) is None


def test_the_built_in_assignments_are_stored_once_and_no_file_can_have_their_ids(store: Store) -> None:
    ada = _enrolled(store)
    for _ in range(2):
        _ask(store, ada)
        _finish(store)
    with store.reading() as session:
        assert len(set(session.scalars(select(Tryout.assignment_version_id)))) == 1
    assert not {NOTEBOOK_RUNS, NOTEBOOK_CHECKS} & {echo().id}
    assert NOTEBOOK_RUNS.startswith("%")
    assert NOTEBOOK_CHECKS.startswith("%")
