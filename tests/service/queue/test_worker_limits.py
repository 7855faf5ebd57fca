"""A real worker: a hung pool child blocks its slot only for a while, and newer tables stop claims."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import hanging_worker
from builders import asked_already, grading_request, settings_in, upgraded_by_newer_release
from processes import until
from service.queue.broker import EmbeddedBroker
from service.queue.celery_app import make_celery
from service.queue.notifier import Notifier
from service.settings import Settings
from service.store.batches.intake import accept_batch
from service.store.engine import Store, open_store
from service.store.queue import workers
from service.store.states import JobQueue, JobState
from service.store.tables.submissions import Job

DRIVES_LONG = (
    "from ev3dev2.motor import MoveTank, OUTPUT_B, OUTPUT_C, SpeedPercent\n"
    "for _ in range(2000):\n"
    "    MoveTank(OUTPUT_B, OUTPUT_C).on_for_seconds(SpeedPercent(5), SpeedPercent(-5), 0.01)\n"
)


@contextmanager
def _worker(settings: Settings, *command: str) -> Iterator[Path]:
    """Run a worker in the background; yield its log."""
    log = settings.home / "worker.log"
    environment = {**os.environ, **settings.to_environment()}
    with (
        log.open("ab") as output,
        subprocess.Popen([sys.executable, *command], env=environment, stdout=output, stderr=output) as process,
    ):
        try:
            yield log
        finally:
            process.send_signal(signal.SIGTERM)


def _submit(store: Store, notifier: Notifier, student: str, program: str = "print('hello')\n") -> str:
    (job,) = accept_batch(store, "class", [grading_request(student, program)], [], max_attempts=2).jobs
    notifier.grade(JobQueue.BATCH)
    return job.job_id


def _job(store: Store, job_id: str) -> Job:
    with store.reading() as session:
        return session.get_one(Job, job_id)


@pytest.mark.long
def test_a_pool_child_that_hangs_is_ended_and_its_slot_comes_back(tmp_path: Path) -> None:
    home = asked_already(tmp_path / "home")
    worker_settings = settings_in(home, concurrency=1, lease_seconds=1.0, job_seconds=2.0, notify_seconds=0.5)
    with EmbeddedBroker(worker_settings) as broker, open_store(worker_settings) as store:
        notifier = Notifier(make_celery(broker.settings), store, broker.settings)
        hanging = _submit(store, notifier, hanging_worker.HANGS, "print('on')\n")
        with _worker(broker.settings, str(Path(hanging_worker.__file__))):
            until(lambda: _job(store, hanging).state is JobState.RUNNING)
            first = _job(store, hanging).process
            honest = _submit(store, notifier, "ada")
            until(lambda: _job(store, honest).state is JobState.DONE, "the slot does not come back")
            until(lambda: _job(store, hanging).state is JobState.DEAD)
        assert _job(store, hanging).attempt == 2
        assert _job(store, honest).process != first


@pytest.mark.long
def test_a_worker_begins_nothing_once_the_tables_are_too_new_for_it(tmp_path: Path) -> None:
    worker_settings = settings_in(asked_already(tmp_path / "home"), concurrency=1)
    with EmbeddedBroker(worker_settings) as broker, open_store(worker_settings) as store:
        notifier = Notifier(make_celery(broker.settings), store, broker.settings)
        running = _submit(store, notifier, "ada", DRIVES_LONG)
        with _worker(broker.settings, "-m", "service.queue.worker") as log:
            until(lambda: _job(store, running).state is JobState.RUNNING)
            upgraded_by_newer_release(store, "9998")
            waiting = _submit(store, notifier, "bob")

            def problem() -> str:
                with store.reading() as session:
                    return "".join(each.worker.problem for each in workers.load_workers(session))

            assert "newer release" in until(problem)
            until(lambda: _job(store, running).state is JobState.DONE)
            # From its next heartbeat on, it leaves its messages to other workers.
            until(lambda: "worker.takes_no_messages" in log.read_text())
            notifier.grade(JobQueue.BATCH)
            until(lambda: notifier.waiting() > 0)
            assert _job(store, waiting).state is JobState.QUEUED
        assert log.read_text().count("worker.must_be_restarted") == 1
