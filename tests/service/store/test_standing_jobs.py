"""Each submission has exactly one standing job, whatever staff, workers and quarantines do, in any order."""

from __future__ import annotations

import random
from datetime import UTC, datetime

import pytest
from sqlalchemy import case, func, select, update
from sqlalchemy.exc import IntegrityError

import acting
import report_builders
from builders import accept_one, grading_request, prepared
from rows import quick_first
from service.store.batches.intake import accept_batch
from service.store.engine import Store
from service.store.queue import jobs, self_tests
from service.store.states import JobState, Standing
from service.store.tables.submissions import Job
from sim.errors import UsageError

GRADE = report_builders.faulty_grade()


def _grade_next(store: Store, worker: str) -> bool:
    claim = jobs.claim_job(store, worker, 60)
    if claim is not None:
        jobs.finish_job(store, claim, prepared(GRADE), datetime.now(UTC))
    return claim is not None


def _standing(store: Store) -> dict[int, int]:
    """Return the number of standing jobs by submission."""
    with store.reading() as session:
        stands = func.sum(case((Job.standing == Standing.STANDS, 1), else_=0))
        return dict(session.execute(select(Job.submission_id, stands).group_by(Job.submission_id)).all())


def test_a_waiting_regrade_replaces_the_rerun_of_a_quarantined_grade(store: Store) -> None:
    accepted = accept_one(store)
    assert _grade_next(store, "wrong")
    proposed = acting.regrade_one(store, accepted.job_id, None, max_attempts=3, actor="staff")
    assert _grade_next(store, "right")
    (rerun,) = self_tests.quarantine_worker(store, "wrong", "it adds wrongly").again
    assert acting.publish_one(store, proposed, actor="staff").replaced == 1
    with store.reading() as session:
        standing = select(Job.id).where(Job.submission_id == accepted.submission_id, Job.standing == Standing.STANDS)
        assert session.scalars(standing).all() == [proposed]
        assert session.get_one(Job, rerun).standing is Standing.KEPT
    assert _grade_next(store, "right")
    assert _standing(store) == {accepted.submission_id: 1}


def test_the_database_refuses_a_second_job_that_stands(store: Store) -> None:
    accepted = accept_one(store)
    assert _grade_next(store, "worker")
    acting.regrade_one(store, accepted.job_id, None, max_attempts=3, actor="staff")
    with pytest.raises(IntegrityError), store.transaction() as session:
        session.execute(update(Job).values(standing=Standing.STANDS))


@pytest.mark.parametrize("seed", quick_first(range(4)))
def test_one_job_stands_after_any_order_of_actions(store: Store, seed: int) -> None:
    chance = random.Random(seed)
    accept_batch(store, "class", [grading_request(name) for name in ("ada", "bob")], [], max_attempts=3)
    for number in range(40):
        with store.reading() as session:
            ids = session.scalars(select(Job.id).order_by(Job.queued_at, Job.id)).all()
            done = session.scalars(select(Job.id).where(Job.state == JobState.DONE).order_by(Job.id)).all()
        match chance.choice(("grade", "grade", "regrade", "publish", "quarantine")):
            case "grade":
                _grade_next(store, f"worker-{number // 8}")
            case "regrade" if done:
                try:
                    acting.regrade_one(store, chance.choice(done), None, max_attempts=3, actor="staff")
                except UsageError as error:
                    assert "not graded yet" in str(error)  # noqa: PT017 - refusing is one of two right answers
            case "publish":
                acting.publish_one(store, chance.choice(ids), actor="staff")
            case "quarantine":
                self_tests.quarantine_worker(store, f"worker-{chance.randrange(number // 8 + 1)}", "it adds wrongly")
        assert set(_standing(store).values()) == {1}
