"""A queue that stands still is said not to be well, also where everything that could grade lives."""

from __future__ import annotations

from datetime import timedelta

import pytest
from sqlalchemy import update

from builders import accept_one
from service.doctor import examine_service
from service.settings import Settings
from service.store.engine import Store, now
from service.store.models import Job
from service.store.queue import jobs, workers
from service.store.queue.workers import WorkerDescription


def _queue(settings: Settings, store: Store) -> tuple[bool, str]:
    found = {each.what: each for each in examine_service(settings.with_broker("redis://127.0.0.1:1/0"), store)}["queue"]
    return found.well, found.sentence


@pytest.mark.parametrize(("minutes", "is_begun", "well"), [(1, False, True), (10, False, False), (10, True, True)])
def test_a_queue_that_stands_still_is_not_well(
    service_settings: Settings, store: Store, minutes: int, is_begun: bool, well: bool
) -> None:
    assert _queue(service_settings, store) == (True, "0 waiting")
    workers.beat(store, WorkerDescription("worker", "host", 1, "0", "all of it"))
    accept_one(store, "ada")
    accept_one(store, "bob")
    with store.transaction() as session:
        session.execute(update(Job).values(queued_at=now(session) - timedelta(minutes=minutes)))
    if is_begun:
        assert jobs.claim(store, "worker", 60) is not None
    found, sentence = _queue(service_settings, store)
    assert found is well
    assert ("none begins it" in sentence) is not well
