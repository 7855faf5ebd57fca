"""A lease is renewed as long as work under it continues, even without progress reports, and no longer."""

from __future__ import annotations

import os
import threading
import time
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from threading import Event, Thread, Timer

import pytest
from sqlalchemy import text
from sqlalchemy.exc import OperationalError

import report_builders
from builders import accept_one, echo, opened, settings_in
from floods import ECHO, FLOODS
from processes import until
from responders.source_file import SourceFile
from service.grading.grade import Grade
from service.grading.trial_runner import TrialRunner
from service.queue import grading_job
from service.queue.grading_job import GradingOutcome, grade_next_job
from service.queue.lease_keeper import LeaseKeeper
from service.settings import Settings
from service.store.batches.intake import accept_submission
from service.store.engine import IMPATIENT_SECONDS, SQLITE_BUSY_SECONDS, Store
from service.store.queue import jobs
from service.store.queue.lease_reaper import requeue_lost_jobs
from service.store.states import JobQueue, JobState
from service.store.tables.submissions import Job
from sim.errors import Cancelled, HostError
from submissions.grading_request import GradingRequest
from submissions.submission import Submission


def test_a_lease_is_renewed_while_nothing_is_said(store: Store) -> None:
    job_id = accept_one(store).job_id
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None

    def leased_until() -> datetime:
        with store.reading() as session:
            moment = session.get_one(Job, job_id).lease_until
        assert moment is not None
        return moment

    first = leased_until()
    with LeaseKeeper(lambda: jobs.renew_lease(store, claim, 60, 0.0), 0.3, 60) as keeper:
        until(lambda: leased_until() > first)
        keeper.check()
    last = leased_until()
    time.sleep(0.5)
    assert leased_until() == last


@pytest.mark.long
def test_a_job_that_is_silent_for_longer_than_its_lease_is_graded_at_its_first_attempt(
    store: Store, service_settings: Settings
) -> None:
    (flood,) = [each for each in FLOODS if each.name == "padded questions"]
    parts = SourceFile("robot.py", flood.program), SourceFile("responder.py", ECHO)
    request = GradingRequest(Submission("ada", *parts), echo(), "ada")
    job_id = accept_submission(store, request, lane=JobQueue.BATCH, max_attempts=1).job_id
    ended, lost = Event(), []

    def reap() -> None:
        while not ended.wait(0.1):
            lost.append(requeue_lost_jobs(store, jobs.RetryPolicy(0.0)))

    reaper = Thread(target=reap)
    reaper.start()
    try:
        with TrialRunner() as runner:
            settings = replace(service_settings, lease_seconds=4.0)
            assert grade_next_job(store, settings, runner, "worker") is GradingOutcome.GRADED
    finally:
        ended.set()
        reaper.join()
    assert sum(lost) == 0
    with store.reading() as session:
        assert session.get_one(Job, job_id).state is JobState.DONE


def test_whoever_has_lost_the_lease_is_told(store: Store) -> None:
    job_id = accept_one(store).job_id
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    with LeaseKeeper(lambda: jobs.renew_lease(store, claim, 60, 0.0), 0.3, 60) as keeper:
        keeper.check()
        jobs.release_worker(store, "worker")

        def is_cancelled() -> bool:
            try:
                keeper.check()
            except Cancelled:
                return True
            return False

        until(is_cancelled)
    with store.reading() as session:
        assert session.get_one(Job, job_id).state is JobState.QUEUED


def test_what_hangs_is_not_held_for_ever() -> None:
    with LeaseKeeper(lambda: None, 0.3, 0.5) as keeper:
        until(lambda: "lease keeper" not in {each.name for each in threading.enumerate()})
        with pytest.raises(HostError, match="longer than"):
            keeper.check()


def test_marks_that_took_too_long_are_not_stored(
    store: Store, service_settings: Settings, runner: TrialRunner, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The exception for an expired job may look like an error in a criterion, which would then get no marks."""
    job_id = accept_one(store).job_id
    graded = report_builders.faulty_grade()

    def grade(*_: object, **__: object) -> Grade:
        time.sleep(1.5)
        return graded

    monkeypatch.setattr(grading_job, "grade", grade)
    settings = replace(service_settings, job_seconds=1.0)
    assert grade_next_job(store, settings, runner, "worker") is GradingOutcome.HOST_FAULT
    with store.reading() as session:
        assert "longer than" in (session.get_one(Job, job_id).error or "")


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


def test_a_locked_database_holds_up_no_fork(tmp_path: Path) -> None:
    """A renewal waits for SQLite's write lock, and all forks of the process wait for the renewal."""
    with opened(settings_in(tmp_path)) as store:
        accept_one(store)
        claim = jobs.claim_job(store, "worker", 60)
        assert claim is not None
        impatient, renewing = store.with_short_wait(), Event()

        def renew() -> None:
            renewing.set()
            jobs.renew_lease(impatient, claim, 60, 0.0)

        with store.transaction() as session, LeaseKeeper(renew, 0.3, 60) as keeper:
            # The database is locked from here on.
            session.connection()
            for _ in range(3):
                renewing.clear()
                assert renewing.wait(30)
                pid = os.fork()
                if pid == 0:
                    os._exit(0)
                assert os.waitpid(pid, 0)[1] == 0
            keeper.check()


def test_the_lease_of_a_job_is_renewed_by_a_store_in_a_hurry(
    tmp_path: Path, runner: TrialRunner, monkeypatch: pytest.MonkeyPatch
) -> None:
    renewed: list[int] = []

    def heartbeat(store: Store, *_: object) -> None:
        with store.transaction() as session:
            renewed.append(int(session.scalar(text("PRAGMA busy_timeout")) or 0))

    def grade(*_: object, **__: object) -> Grade:
        until(lambda: renewed)
        return report_builders.faulty_grade()

    monkeypatch.setattr(jobs, "renew_lease", heartbeat)
    monkeypatch.setattr(grading_job, "grade", grade)
    settings = settings_in(tmp_path, lease_seconds=1.0)
    with opened(settings) as store:
        accept_one(store)
        assert grade_next_job(store, settings, runner, "worker") is GradingOutcome.GRADED
    assert set(renewed) == {IMPATIENT_SECONDS * 1000}


def test_a_store_in_a_hurry_waits_only_so_long_for_sqlite(tmp_path: Path) -> None:
    with opened(settings_in(tmp_path)) as store:
        for each, seconds in ((store, SQLITE_BUSY_SECONDS), (store.with_short_wait(), IMPATIENT_SECONDS), (store, 30)):
            with each.transaction() as session:
                assert session.scalar(text("PRAGMA busy_timeout")) == seconds * 1000


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
