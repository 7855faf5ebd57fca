"""A lease is kept for as long as work is done under it, however long that says nothing, and no longer."""

from __future__ import annotations

import os
import threading
import time
from dataclasses import replace
from datetime import datetime
from threading import Event, Thread, Timer

import pytest
from sqlalchemy.exc import OperationalError

from builders import accept_one, echo
from floods import ECHO, FLOODS
from processes import until
from responders.code import Code
from service.grading.trial_runner import TrialRunner
from service.queue.grading_job import JobOutcome, grade_next
from service.queue.lease_keeper import LeaseKeeper
from service.settings import Settings
from service.store.batches.intake import accept
from service.store.engine import Store
from service.store.models import Job
from service.store.queue import jobs
from service.store.queue.lease_reaper import requeue_lost
from service.store.states import JobState, Lane
from sim.errors import Cancelled, HostError
from submissions.grading_request import GradingRequest
from submissions.submission import Submission


def test_a_lease_is_renewed_while_nothing_is_said(store: Store) -> None:
    job_id = accept_one(store).job_id
    claim = jobs.claim(store, "worker", 60)
    assert claim is not None

    def leased_until() -> datetime:
        with store.reading() as session:
            moment = session.get_one(Job, job_id).lease_until
        assert moment is not None
        return moment

    first = leased_until()
    with LeaseKeeper(lambda: jobs.heartbeat(store, claim, 60, 0.0), 0.3, 60) as keeper:
        until(lambda: leased_until() > first)
        keeper.check()
    last = leased_until()
    time.sleep(0.5)
    assert leased_until() == last


def test_a_job_that_is_silent_for_longer_than_its_lease_is_graded_at_its_first_attempt(
    store: Store, service_settings: Settings
) -> None:
    (flood,) = [each for each in FLOODS if each.name == "padded questions"]
    parts = Code("robot.py", flood.program), Code("responder.py", ECHO)
    request = GradingRequest(Submission("ada", *parts), echo(), "ada")
    job_id = accept(store, request, lane=Lane.BATCH, max_attempts=1).job_id
    ended, lost = Event(), []

    def reap() -> None:
        while not ended.wait(0.1):
            lost.append(requeue_lost(store, jobs.Retry(0.0)))

    reaper = Thread(target=reap)
    reaper.start()
    try:
        with TrialRunner() as runner:
            settings = replace(service_settings, lease_seconds=4.0)
            assert grade_next(store, settings, runner, "worker") is JobOutcome.GRADED
    finally:
        ended.set()
        reaper.join()
    assert sum(lost) == 0
    with store.reading() as session:
        assert session.get_one(Job, job_id).state is JobState.DONE


def test_whoever_has_lost_the_lease_is_told(store: Store) -> None:
    job_id = accept_one(store).job_id
    claim = jobs.claim(store, "worker", 60)
    assert claim is not None
    with LeaseKeeper(lambda: jobs.heartbeat(store, claim, 60, 0.0), 0.3, 60) as keeper:
        keeper.check()
        jobs.release_worker(store, "worker")

        def told() -> bool:
            try:
                keeper.check()
            except Cancelled:
                return True
            return False

        until(told)
    with store.reading() as session:
        assert session.get_one(Job, job_id).state is JobState.QUEUED


def test_what_hangs_is_not_held_for_ever() -> None:
    with LeaseKeeper(lambda: None, 0.3, 0.5) as keeper:
        until(lambda: "lease keeper" not in {each.name for each in threading.enumerate()})
        with pytest.raises(HostError, match="longer than"):
            keeper.check()


def test_a_renewal_that_fails_is_tried_again() -> None:
    faults = [OperationalError("UPDATE", {}, Exception("the server is away")), ValueError("surprise")]
    renewed = Event()

    def renew() -> None:
        if faults:
            raise faults.pop()
        renewed.set()

    with LeaseKeeper(renew, 0.1, 60) as keeper:
        assert renewed.wait(30)
        keeper.check()


def test_no_process_is_forked_in_the_middle_of_a_renewal() -> None:
    renewing, go_on = Event(), Event()
    ended: list[float] = []

    def renew() -> None:
        renewing.set()
        go_on.wait(30)
        ended.append(time.monotonic())

    with LeaseKeeper(renew, 0.1, 60):
        assert renewing.wait(30)
        Timer(0.5, go_on.set).start()
        pid = os.fork()
        if pid == 0:
            os._exit(0 if ended else 1)
        assert os.waitpid(pid, 0)[1] == 0
