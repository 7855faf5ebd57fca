"""Retries of failed jobs by other workers, clocks that are set back, and the recorded times of a job."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from sqlalchemy import select, update

import report_builders
from builders import accept_one, prepared
from service.queue.celery_app import make_celery
from service.queue.notifier import Notifier
from service.settings import Settings
from service.store import phases
from service.store.engine import Store, now, select_clock
from service.store.grades import plots
from service.store.queue import jobs, metrics, workers
from service.store.queue.jobs import RetryPolicy
from service.store.queue.lease_reaper import count_missing_notices, requeue_lost_jobs
from service.store.states import JobQueue, JobState
from service.store.tables.installation import Heartbeat
from service.store.tables.submissions import Job

pytestmark = pytest.mark.fast

HOUR = timedelta(hours=1)
NO_WAIT = RetryPolicy(0.0)


def _worker(name: str) -> workers.WorkerDescription:
    return workers.WorkerDescription(name, "here", 1, "1", "sandbox")


def _change(store: Store, table: Any, **values: Any) -> None:
    with store.transaction() as session:
        session.execute(update(table).values(**values))


def _job(store: Store, job_id: str) -> Job:
    with store.reading() as session:
        return session.get_one(Job, job_id)


def test_a_job_that_failed_goes_to_another_worker_where_there_is_one(store: Store) -> None:
    accept_one(store)
    workers.record_heartbeat(store, _worker("first"))
    failed = jobs.claim_job(store, "first", 60)
    assert failed is not None
    jobs.fail_job(store, failed, "it broke", NO_WAIT)
    workers.record_heartbeat(store, _worker("second"))
    assert jobs.claim_job(store, "first", 60) is None
    claim = jobs.claim_job(store, "second", 60)
    assert claim is not None
    assert claim.attempt == 2
    jobs.fail_job(store, claim, "it broke again", NO_WAIT)
    # The other worker was last seen long ago, so the same worker is better than none.
    _change(store, Heartbeat, seen_at=datetime.now(UTC) - HOUR)
    assert jobs.claim_job(store, "second", 60) is not None


def test_a_clock_that_is_set_back_holds_nothing_up(store: Store) -> None:
    waits = accept_one(store, "waits").job_id
    begun = accept_one(store, "begun").job_id
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    assert claim.job_id == waits
    ahead = datetime.now(UTC) + HOUR
    _change(store, Job, due_at=ahead, notified_at=ahead)
    with store.transaction() as session:
        later = {"heartbeat_at": ahead, "lease_until": ahead + timedelta(seconds=60)}
        session.execute(update(Job).where(Job.id == waits).values(**later))
    for _ in range(2):
        assert requeue_lost_jobs(store, NO_WAIT) == 0
    held = _job(store, waits)
    assert held.lease_until is not None
    assert timedelta(seconds=50) < held.lease_until - datetime.now(UTC) <= timedelta(seconds=60)
    assert count_missing_notices(store, 3600)[JobQueue.INTERACTIVE].stale == 1
    other = jobs.claim_job(store, "worker", 60)
    assert other is not None
    assert other.job_id == begun


def test_the_times_of_a_grade_are_kept_and_told(store: Store) -> None:
    job_id = accept_one(store).job_id
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    trials_at, graded_at = claim.at + timedelta(seconds=2), claim.at + timedelta(seconds=3)
    jobs.finish_job(store, claim, prepared(report_builders.faulty_grade()), graded_at, trials_at)
    plots.store_plots(store, job_id, {})
    job = _job(store, job_id)
    assert (job.state, set(job.phases)) == (JobState.DONE, set(phases.NAMES))
    durations = phases.compute_durations(job.phases)
    assert (durations["trials"], durations["judging"]) == (timedelta(seconds=2), timedelta(seconds=1))
    with store.reading() as session:
        assert metrics.collect_service_metrics(session).times["trials"] == [2.0]


def test_a_notice_that_could_not_be_given_is_not_remembered_as_given(store: Store, service_settings: Settings) -> None:
    job_id = accept_one(store).job_id
    away = service_settings.with_broker(f"redis+socket://{service_settings.home / 'nothing.sock'}")
    Notifier(make_celery(away), store, away).grade(JobQueue.INTERACTIVE)
    assert _job(store, job_id).notified_at is None


def test_the_clock_stands_still_only_for_transactions_that_read(store: Store) -> None:
    with store.reading() as session:
        read_at = now(session)
        assert now(session) == read_at
        clock = session.scalars(select(select_clock(session))).one()
        assert read_at <= clock <= read_at + HOUR
    with store.transaction() as session:
        moments = [now(session) for _ in range(2)]
        while moments[-1] == moments[0]:
            moments.append(now(session))
        assert sorted(moments) == moments
