"""Simultaneous actions of staff, workers and the lease reaper cause no deadlock errors and no wrong marks."""

from __future__ import annotations

import ast
import random
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from typing import Any

import pytest
from sqlalchemy import Delete, delete, func, select, text, update
from sqlalchemy.exc import DBAPIError, OperationalError
from sqlalchemy.orm import Session

import acting
import report_builders
import service
from builders import accept_one, grading_request, prepared
from job_choice import choose_job
from paths import ROOT
from processes import until
from service.lti.keys import ensure_signing_key
from service.store.batches import intake
from service.store.batches.intake import accept_batch
from service.store.courses import policies
from service.store.courses.policies import PolicyLimits
from service.store.engine import Store, is_conflict, now, retry_conflicts
from service.store.grades import appeals, overrides
from service.store.people import lti
from service.store.people.lti import Registration
from service.store.purge import PurgeCounts, purge_submissions
from service.store.queue import jobs, lease_reaper, pool_completions, self_tests, test_runs
from service.store.queue.jobs import RetryPolicy
from service.store.states import JobQueue, JobState, Standing
from service.store.tables.base import Base
from service.store.tables.courses import Extension, Policy
from service.store.tables.people import LtiKey, LtiPlatform
from service.store.tables.submissions import Job
from sim.errors import Cancelled, UsageError

GRADE = report_builders.faulty_grade()
CRITERION = GRADE.criteria[0].id
STUDENTS = [f"student-{number}" for number in range(6)]
ROUNDS = 25


def test_all_statements_of_a_reading_transaction_see_the_same_rows(store: Store) -> None:
    accepted = accept_one(store)
    is_accepted = Job.id == accepted.job_id
    with store.reading() as session:
        assert session.scalar(select(func.count()).select_from(Job)) == 1
        with store.transaction() as other:
            other.execute(delete(Job).where(is_accepted))
        assert session.scalar(select(Job.id).where(is_accepted)) == accepted.job_id
    with store.reading() as session:
        assert session.scalar(select(Job.id).where(is_accepted)) is None


def _finish_next(store: Store, worker: str) -> None:
    claim = jobs.claim_job(store, worker, 60)
    if claim is not None:
        jobs.finish_job(store, claim, prepared(GRADE), datetime.now(UTC))


@retry_conflicts
def _mark(store: Store, change: Callable[..., None], job_id: str, *values: object) -> None:
    with store.transaction() as session:
        change(session, job_id, CRITERION, *values, "grace")


def _any_done(store: Store, chance: random.Random) -> str:
    with store.reading() as session:
        return chance.choice(session.scalars(select(Job.id).where(Job.state == JobState.DONE)).all())


def _lose_leases(store: Store, chance: random.Random) -> None:
    jobs.claim_job(store, f"silent-{chance.randrange(3)}", -1)
    lease_reaper.requeue_lost_jobs(store, RetryPolicy(0.0))
    lease_reaper.mark_notified(store, JobQueue.BATCH, 10)


def test_a_purge_keeps_submissions_that_are_regraded_meanwhile(store: Store) -> None:
    kept, removed = accept_one(store), accept_one(store, "bob")
    for _ in range(2):
        _finish_next(store, "worker")
    later = datetime.now(UTC) + timedelta(days=1)
    with ThreadPoolExecutor(1) as pool:
        with store.transaction() as session:
            original = session.get_one(Job, kept.job_id)
            regrade = pool_completions.build_completion(original)
            jobs.enqueue(session, regrade, now(session))
            session.flush()
            purge = pool.submit(purge_submissions, store, later, "staff")
            # On PostgreSQL it marks what it sees, and waits for this transaction; on SQLite it has not begun.
            time.sleep(0.5)
        assert purge.result() == PurgeCounts(1, 1, 1)
    with store.reading() as session:
        assert set(session.scalars(select(Job.submission_id))) == {kept.submission_id}
    assert removed.submission_id != kept.submission_id


@pytest.mark.long
def test_staff_workers_and_the_lease_reaper_at_once(store: Store) -> None:
    batch = accept_batch(store, "class", [grading_request(name) for name in STUDENTS], [], max_attempts=1000)
    for _ in STUDENTS:
        _finish_next(store, "worker")
    actions: list[Callable[[random.Random], object]] = [
        lambda _: acting.publish(store, batch.id, actor="grace"),
        lambda _: acting.regrade(store, batch.id, None, max_attempts=1000, actor="grace"),
        lambda chance: acting.regrade_one(store, _any_done(store, chance), None, max_attempts=1000, actor="grace"),
        lambda chance: _mark(store, overrides.set_marks, _any_done(store, chance), Decimal(0), "because"),
        lambda chance: _mark(store, overrides.excuse_criterion, _any_done(store, chance), "because"),
        lambda chance: _mark(store, overrides.withdraw_override, _any_done(store, chance)),
        lambda _: _finish_next(store, "worker"),
        lambda _: _finish_next(store, "worker"),
        lambda chance: _lose_leases(store, chance),
        lambda chance: self_tests.quarantine_worker(store, f"silent-{chance.randrange(3)}", "it adds wrongly"),
    ]
    start = threading.Barrier(len(actions))

    def repeat(number: int) -> list[Exception]:
        chance, failures = random.Random(number), []
        start.wait()
        for _ in range(ROUNDS):
            try:
                actions[number](chance)
            except (UsageError, Cancelled):
                continue
            except Exception as error:
                failures.append(error)
        return failures

    with ThreadPoolExecutor(len(actions)) as pool:
        failures = [error for each in pool.map(repeat, range(len(actions))) for error in each]
    assert failures == []
    with store.reading() as session:
        standing = select(Job.submission_id, func.count()).where(Job.standing == Standing.STANDS)
        counts = dict(session.execute(standing.group_by(Job.submission_id)).all())
        assert (len(counts), set(counts.values())) == (len(STUDENTS), {1})
        for job_id, marks in session.execute(select(Job.id, Job.marks).where(Job.state == JobState.DONE)).all():
            assert marks == sum(line.marks for line in overrides.load_criterion_marks(session, job_id)), job_id


def _waiting(store: Store) -> bool:
    with store.reading() as session:
        query = text("SELECT count(*) FROM pg_stat_activity WHERE wait_event_type = 'Lock'")
        return bool(session.scalar(query))


@pytest.mark.long
def test_marks_by_hand_wait_for_a_regrade_that_is_stored_and_do_not_deadlock(server: Store) -> None:
    """Storing a regrade checks its foreign key to the previous grade, which an override has locked."""
    store = server
    accepted = accept_one(store)
    _finish_next(store, "worker")
    again = acting.regrade_one(store, accepted.job_id, None, max_attempts=3, actor="grace")
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    assert claim.job_id == again
    locked, done = threading.Event(), threading.Event()

    def store_regrade() -> None:
        with store.transaction() as session:
            session.execute(update(Job).where(Job.id == again).values(progress=0.5))
            locked.set()
            # The other transaction now waits for this row, with the row of the first grade locked.
            until(lambda: _waiting(store))
            session.execute(update(Job).where(Job.id == again).values(progress=0.6))
        done.set()

    with ThreadPoolExecutor(2) as pool:
        storing = pool.submit(store_regrade)
        locked.wait()
        with store.transaction() as session:
            overrides.set_marks(session, accepted.job_id, CRITERION, Decimal(0), "because", "grace")
        storing.result()
    assert done.is_set()


def _second_waits(store: Store, first: Callable[[Session], object], second: Callable[[], object]) -> Future[object]:
    """Return the result of ``second``, which begins while the transaction of ``first`` is open, and ends after it."""
    with ThreadPoolExecutor(1) as pool:
        with store.transaction() as session:
            first(session)
            second_future = pool.submit(second)
            until(lambda: second_future.done() or _waiting(store))
        return second_future


@pytest.fixture
def server(store: Store) -> Store:
    """Return a database that allows several writers at a time."""
    if store.engine.dialect.name == "sqlite":
        pytest.skip("SQLite has one writer at a time")
    return store


def _set_marks(session: Session, job_id: str, actor: str, seen: int) -> None:
    overrides.set_marks(session, job_id, CRITERION, Decimal(0), "because", actor, expected_override=seen)


def _excuse(session: Session, job_id: str, actor: str, seen: int) -> None:
    overrides.excuse_criterion(session, job_id, CRITERION, "because", actor, expected_override=seen)


def _withdraw(session: Session, job_id: str, actor: str, seen: int) -> None:
    overrides.withdraw_override(session, job_id, CRITERION, actor, expected_override=seen)


def _answer_appeal(session: Session, job_id: str, actor: str, seen: int) -> None:
    appeals.answer_appeal(session, 1, 1, "It is right.", actor)


@pytest.mark.long
@pytest.mark.parametrize("later", [_set_marks, _excuse, _withdraw])
@pytest.mark.parametrize("first", [_set_marks, _excuse])
def test_of_two_who_change_the_same_marks_at_once_the_second_is_refused(
    server: Store, first: Callable[..., None], later: Callable[..., None]
) -> None:
    job_id, seen = _marked_by_hand(server)

    def second() -> None:
        with server.transaction() as session:
            later(session, job_id, "hopper", seen)

    second_future = _second_waits(server, lambda session: first(session, job_id, "grace", seen), second)
    with pytest.raises(UsageError, match="Another person changed the marks"):
        second_future.result()


@pytest.mark.long
@pytest.mark.parametrize(
    ("change", "refused"), [(_withdraw, "are not adjusted"), (_answer_appeal, "already has an answer")]
)
def test_what_two_do_at_once_that_is_done_once_the_second_is_refused(
    server: Store, change: Callable[..., None], refused: str
) -> None:
    job_id, seen = _marked_by_hand(server)

    def second() -> None:
        with server.transaction() as session:
            change(session, job_id, "hopper", seen)

    second_future = _second_waits(server, lambda session: change(session, job_id, "grace", seen), second)
    with pytest.raises(UsageError, match=refused):
        second_future.result()


def _set_policy(session: Session) -> None:
    policies.set_policy(session, 1, "", PolicyLimits(attempts=1))


def _extend(session: Session) -> None:
    policies.extend_policy(session, 1, "", None, 1)


def _register(session: Session) -> None:
    site = "https://platform.example.org"
    lti.register_platform(
        session, Registration("Moodle", site, "c", ("1",), f"{site}/auth", f"{site}/token", f"{site}/keys")
    )


@pytest.mark.long
@pytest.mark.parametrize(
    ("make", "table"),
    [(_set_policy, Policy), (_extend, Extension), (_register, LtiPlatform), (ensure_signing_key, LtiKey)],
)
def test_of_two_who_make_the_first_row_at_once_one_does(
    server: Store, make: Callable[[Session], object], table: type[Base]
) -> None:
    accept_one(server)

    def second() -> None:
        with server.transaction() as session:
            make(session)

    _second_waits(server, make, second).result()
    with server.reading() as session:
        assert session.scalar(select(func.count()).select_from(table)) == 1


def _marked_by_hand(store: Store) -> tuple[str, int]:
    """Return a grade with an override and an appeal, and the number of the override."""
    accepted = accept_one(store)
    _finish_next(store, "worker")
    with store.transaction() as session:
        overrides.excuse_criterion(session, accepted.job_id, CRITERION, "because", "grace")
        appeals.open_appeal(session, accepted.submission_id, "Please look again.")
    with store.reading() as session:
        return accepted.job_id, overrides.load_overrides(session, [accepted.job_id])[accepted.job_id][CRITERION].id


@pytest.mark.long
def test_one_student_tries_one_program_at_a_time(server: Store) -> None:
    enrolment_id, version_id = _one_submission(server)

    def second() -> None:
        with server.transaction() as session:
            test_runs.queue_test_run(session, enrolment_id, version_id, b"")

    second_future = _second_waits(
        server, lambda session: test_runs.queue_test_run(session, enrolment_id, version_id, b""), second
    )
    with pytest.raises(UsageError, match="not completed yet"):
        second_future.result()


def _one_submission(store: Store) -> tuple[int, int]:
    accepted = accept_one(store)
    with store.reading() as session:
        job = session.get_one(Job, accepted.job_id)
        return job.enrolment_id, job.assignment_version_id


@pytest.mark.long
def test_two_workers_at_once_claim_the_two_oldest_jobs_of_a_batch(server: Store) -> None:
    batch = accept_batch(server, "class", [grading_request(name) for name in STUDENTS], [], max_attempts=3)
    with server.transaction() as session:
        first = choose_job(session, "first")
        # The second worker does not wait for the first one's transaction.
        second = jobs.claim_job(server, "second", 60)
    assert second is not None
    assert [first, second.job_id] == sorted(job.job_id for job in batch.jobs)[:2]


@pytest.mark.long
def test_an_attempt_that_is_claimed_while_the_next_comes_in_counts_alone(
    server: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    accept_one(server)
    with server.transaction() as session:
        policies.set_policy(session, 1, "", PolicyLimits(attempts=1))
    claims: list[jobs.Claim | None] = []

    def rule_then_claim(*arguments: Any) -> policies.Ruling:
        ruling = policies.apply_policy(*arguments)
        claims.append(jobs.claim_job(server, "worker", 60))
        return ruling

    monkeypatch.setattr(intake, "apply_policy", rule_then_claim)
    newer = intake.accept_submission(server, grading_request("ada", "print('newer')\n"), max_attempts=1)
    begun = [claim for claim in claims if claim is not None]
    assert (len(begun), newer.staff_only) in ((0, ""), (1, "attempt 2, allowed: 1"))


@pytest.mark.long
def test_a_submission_over_a_limit_is_either_graded_for_staff_or_removed_for_a_newer_one(
    server: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    def submit(number: int) -> str:
        request = grading_request("ada", f"print({number})\n")
        return intake.accept_submission(server, request, max_attempts=1, max_bytes=10**6).job_id

    submit(1)
    _finish_next(server, "worker")
    with server.transaction() as session:
        policies.set_policy(session, 1, "", PolicyLimits(attempts=1))
    over_limit = submit(2)

    def ask_for_grade() -> bool:
        with server.transaction() as session:
            return jobs.queue_over_limit_job(session, over_limit, datetime.now(UTC))

    futures: list[Future[bool]] = []
    with ThreadPoolExecutor(1) as pool:

        def ask_then_delete(table: type[Base]) -> Delete:
            if not futures:
                futures.append(pool.submit(ask_for_grade))
                until(lambda: futures[0].done() or _waiting(server))
            return delete(table)

        monkeypatch.setattr(intake, "delete", ask_then_delete)
        submit(3)
    with server.reading() as session:
        assert futures[0].result() == (session.get(Job, over_limit) is not None)


class _Deadlock(Exception):
    sqlstate = "40P01"


@pytest.mark.parametrize(("times", "calls"), [(0, 1), (1, 2), (2, 2)])
def test_a_transaction_is_run_again_once_after_a_conflict(times: int, calls: int) -> None:
    called: list[int] = []

    @retry_conflicts
    def transact() -> str:
        called.append(len(called))
        if len(called) <= times:
            raise OperationalError("UPDATE job", {}, _Deadlock())
        return "done"

    if times < 2:
        assert transact() == "done"
    else:
        with pytest.raises(DBAPIError) as caught:
            transact()
        assert is_conflict(caught.value)
    assert len(called) == calls


def test_other_errors_are_not_run_again() -> None:
    called: list[int] = []

    @retry_conflicts
    def transact() -> None:
        called.append(1)
        raise OperationalError("UPDATE job", {}, OSError("gone"))

    with pytest.raises(OperationalError):
        transact()
    assert called == [1]


def _calls(name: str) -> Iterator[tuple[str, ast.Call]]:
    """Yield the calls of a method of this name in the service, with their places."""
    for file in sorted((ROOT / service.__name__).rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == name:
                yield f"{file.relative_to(ROOT)}:{node.lineno}", node


@pytest.mark.long
def test_no_lock_keeps_foreign_keys_from_being_checked() -> None:
    """``FOR UPDATE`` blocks the ``KEY SHARE`` lock of a foreign key check; ``key_share=True`` does not."""
    lock_calls = dict(_calls("with_for_update"))
    assert len(lock_calls) > 5
    weak = {where for where, call in lock_calls.items() if {"key_share", "read"} & {each.arg for each in call.keywords}}
    # Before rows are deleted, no other row may come to refer to them.
    assert [where.partition(":")[0] for where in set(lock_calls) - weak] == ["service/store/locks.py"]
    for where, call in _calls("get_one"):
        assert not any(
            each.arg == "with_for_update" and isinstance(each.value, ast.Constant) for each in call.keywords
        ), where
