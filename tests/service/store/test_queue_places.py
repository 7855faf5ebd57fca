"""The position of a job in the queue equals the order of the following claims."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import update

import acting
import report_builders
from builders import accept_one, grading_request, prepared
from service.store.batches.intake import accept_batch, accept_submission
from service.store.engine import Store, now
from service.store.queue import jobs, workers
from service.store.queue.queue_places import QueuePlace, estimate_place
from service.store.queue.workers import WorkerDescription
from service.store.states import JobQueue
from service.store.tables.submissions import Job


def _place(store: Store, job_id: str) -> QueuePlace:
    with store.reading() as session:
        return estimate_place(session, job_id)


def _another(store: Store, student: str, program: str) -> str:
    return accept_submission(store, grading_request(student, program), max_attempts=3).job_id


def test_places_are_told_as_jobs_are_claimed(store: Store) -> None:
    ids = [accept_one(store, student).job_id for student in ("ada", "bob", "cid")]
    batch = accept_batch(store, "class", [grading_request("dan"), grading_request("eve")], (), max_attempts=3)
    waiting = [*ids, *(job.job_id for job in batch.jobs)]
    assert sorted(_place(store, job_id).before for job_id in waiting) == [0, 1, 2, 3, 4]
    ordered_ids = sorted(waiting, key=lambda job_id: _place(store, job_id).before)
    assert ordered_ids[:3] == ids
    claimed = jobs.claim_job(store, "worker", 60)
    assert claimed is not None
    assert claimed.job_id == ordered_ids[0]
    assert _place(store, ordered_ids[1]).before == 0
    # A student who was just served waits for the others.
    again = _another(store, "ada", "print('again')\n")
    assert _place(store, again).before == 2
    newcomer = accept_one(store, "fay").job_id
    assert (_place(store, newcomer).before, _place(store, again).before) == (2, 3)


def test_what_is_held_back_is_before_nobody(store: Store) -> None:
    batch = accept_batch(store, "class", [grading_request("dan")], (), max_attempts=3)
    late = accept_one(store, "ada", lane=JobQueue.BATCH).job_id
    before = _place(store, late).before
    acting.pause(store, batch.id)
    assert (before, _place(store, late).before) == (1, 0)


@pytest.mark.parametrize("concurrency", [1, 4])
def test_the_time_left_follows_from_what_gradings_took_and_how_many_run_at_once(store: Store, concurrency: int) -> None:
    graded = accept_one(store, "ada").job_id
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    jobs.finish_job(store, claim, prepared(report_builders.faulty_grade()), datetime.now(UTC))
    with store.transaction() as session:
        ended = datetime(2026, 1, 1, tzinfo=UTC)
        taken = {"started_at": ended - timedelta(seconds=8), "finished_at": ended}
        session.execute(update(Job).where(Job.id == graded).values(**taken))
    first, second = _another(store, "bob", "print(1)\n"), _another(store, "cid", "print(2)\n")
    assert _place(store, second) == QueuePlace(1, None, 0)
    workers.record_heartbeat(store, WorkerDescription("worker", "here", concurrency, "1", "all"))
    assert _place(store, first) == QueuePlace(0, 8.0, 1)
    assert _place(store, second) == QueuePlace(1, 8.0 + 8.0 / concurrency, 1)
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    jobs.renew_lease(store, claim, 60, 0.75)
    with store.transaction() as session:
        started = now(session) - timedelta(seconds=6)
        session.execute(update(Job).where(Job.id == claim.job_id).values(started_at=started))
    place = _place(store, claim.job_id)
    # By elapsed time, not by the number of trials run.
    assert (place.progress, place.seconds) == (pytest.approx(0.75, abs=0.1), pytest.approx(2.0, abs=1))
    with store.transaction() as session:
        started = now(session) - timedelta(seconds=60)
        session.execute(update(Job).where(Job.id == claim.job_id).values(started_at=started))
    assert _place(store, claim.job_id).progress == 0.95
