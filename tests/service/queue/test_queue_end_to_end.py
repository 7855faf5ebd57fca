"""Submissions through a real broker, worker and database: each is graded once, whatever is killed."""

from __future__ import annotations

import fcntl
import os
import signal
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from rich.console import Console
from sqlalchemy import func, select

import acting
from benchmarks.harness.postgresql_server import create_database
from benchmarks.harness.process_tree import find_children, find_descendants, read_command_line
from builders import comparable, grading_request, patient_echo, read_named_batch, settings_in
from processes import PATIENCE, until
from service.commands.batch.batch_waiter import BatchWaiter
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.queue.broker import EmbeddedBroker, is_broker_responding, prepare_socket_path
from service.queue.celery_app import make_celery
from service.queue.embedded_services import EmbeddedServices
from service.queue.notifier import Notifier
from service.reports.plots.grade_plots import list_plots
from service.settings import Settings
from service.store import artifacts
from service.store.batches import job_lines
from service.store.batches.intake import accept_batch
from service.store.batches.stored_requests import load_grading_request
from service.store.engine import Store, open_store
from service.store.grades import results
from service.store.installation import load_secret
from service.store.states import JobQueue, JobState, PlotState
from service.store.tables.grades import CriterionResultRow, TrialRow
from service.store.tables.submissions import Job
from submissions.assignment.examples import locate_examples
from submissions.grading_request import GradingRequest

#: Uses its whole limit of processor time, so that something can be killed while it runs.
SPIN = "print('begun')\nwhile True:\n    pass\n"


@dataclass(frozen=True)
class Service:
    """The running processes, and methods to use them."""

    settings: Settings
    store: Store
    services: EmbeddedServices

    def submit(self, grading_requests: list[GradingRequest]) -> str:
        accepted = accept_batch(self.store, "test", grading_requests, [], max_attempts=3)
        self.notifier.grade(JobQueue.BATCH, len(grading_requests))
        return accepted.id

    def wait(self, batch: str) -> list[Job]:
        begun = time.monotonic()

        def keep_up() -> None:
            assert time.monotonic() - begun < PATIENCE, "the batch does not end"
            self.services.ensure()

        waiting = BatchWaiter(
            acting.service_on(self.store), acting.machine(), self.notifier, batch, Console(quiet=True), keep_up
        )
        waiting.wait_for_marks()
        waiting.wait_for_plots()
        return self.jobs(batch)

    def jobs(self, batch: str) -> list[Job]:
        with self.store.reading() as session:
            return list(session.scalars(select(Job).where(Job.batch_id == batch).order_by(Job.queued_at, Job.id)))

    @property
    def notifier(self) -> Notifier:
        return Notifier(make_celery(self.services.settings), self.store, self.services.settings)

    def until_running(self, batch: str) -> Job:
        """Wait for a job of the batch that a worker is running, and return it."""
        return until(lambda: next((job for job in self.jobs(batch) if job.state is JobState.RUNNING), None))

    def assert_graded_once(self, batch: str) -> None:
        with self.store.reading() as session:
            for job in self.jobs(batch):
                assert (job.state, job.error, job.plots) == (JobState.DONE, None, PlotState.DONE)
                positions = session.scalars(select(TrialRow.position).where(TrialRow.job_id == job.id)).all()
                assert sorted(positions) == list(range(len(positions)))
                assert positions
                marked = select(func.count()).select_from(CriterionResultRow).where(CriterionResultRow.job_id == job.id)
                assert session.scalar(marked) == len(load_grading_request(session, job.id).assignment.criteria)


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    settings = settings_in(tmp_path_factory.mktemp("home"), concurrency=1, lease_seconds=6.0)
    with open_store(settings) as store, EmbeddedServices(settings, store) as services:
        yield Service(settings, store, services)


def _pool_children(worker: int) -> list[int]:
    return [pid for pid in find_children(worker) if "spawn_main" in read_command_line(pid)]


def _spinning(count: int) -> list[GradingRequest]:
    return [grading_request(f"spinner-{number}", SPIN) for number in range(count)]


@pytest.mark.long
def test_examples_are_graded_once_each_and_as_without_a_queue(service: Service, runner: TrialRunner) -> None:
    checked = read_named_batch(locate_examples("echo-responder"), "echo-responder")
    assert checked.refusals == ()
    batch = service.submit(list(checked.grading_requests))
    graded = service.wait(batch)
    service.assert_graded_once(batch)
    assert {job.attempt for job in graded} == {1}
    with service.store.reading() as session:
        for job in graded:
            taken_in = load_grading_request(session, job.id)
            direct = grade(taken_in.submission, taken_in.assignment, secret=load_secret(service.store), runner=runner)
            assert comparable(results.load_grade(session, job.id)) == comparable(direct)
            assert (job.marks, job.verdict) == (direct.marks, direct.verdict.value)
            plots = artifacts.load_files(session, job.id, prefix="plot-")
            assert len(plots) == len(list_plots(direct))
            assert all(plot.data.startswith(b"\x89PNG") for plot in plots.values())


@pytest.mark.long
def test_a_job_that_no_attempt_could_grade_is_dead_at_once_and_says_why(service: Service) -> None:
    lacking = grading_request("lacking")
    broken = GradingRequest(replace(lacking.submission, program=None, responder=None), lacking.assignment, "lacking")
    batch = service.submit([broken, grading_request("whole")])
    by_student = {line.student: line for line in _lines(service, batch)}
    assert by_student["whole"].state is JobState.DONE
    assert by_student["lacking"].state is JobState.DEAD
    assert "no robot program" in (by_student["lacking"].error or "")


def _lines(service: Service, batch: str) -> list[job_lines.JobLine]:
    service.wait(batch)
    with service.store.reading() as session:
        return job_lines.load_job_lines(session, batch)


@pytest.mark.long
def test_a_killed_worker_loses_nothing(service: Service) -> None:
    batch = service.submit(_spinning(2))
    running = service.until_running(batch)
    assert service.services.worker_pid is not None
    os.kill(service.services.worker_pid, signal.SIGKILL)
    graded = service.wait(batch)
    service.assert_graded_once(batch)
    # The worker is known to have ended, so its job was requeued without counting an attempt.
    assert {job.id: job.attempt for job in graded}[running.id] == 1


@pytest.mark.long
def test_a_killed_pool_child_loses_nothing(service: Service) -> None:
    batch = service.submit(_spinning(1))
    service.until_running(batch)
    assert service.services.worker_pid is not None
    for child in _pool_children(service.services.worker_pid):
        os.kill(child, signal.SIGKILL)
    graded = service.wait(batch)
    service.assert_graded_once(batch)
    # The loss was detected only by the expired lease, so it counts as an attempt.
    assert [job.attempt for job in graded] == [2]


@pytest.mark.long
def test_a_killed_broker_loses_nothing(service: Service) -> None:
    batch = service.submit(_spinning(1) + [grading_request(f"quick-{number}") for number in range(4)])
    service.until_running(batch)
    (broker,) = [pid for pid in find_descendants(os.getpid()) if "valkey-server" in read_command_line(pid)]
    os.kill(broker, signal.SIGKILL)
    service.wait(batch)
    service.assert_graded_once(batch)


@pytest.mark.long
def test_a_batch_on_postgresql(tmp_path: Path, postgresql: str) -> None:
    settings = settings_in(tmp_path, database_url=create_database(postgresql))
    with open_store(settings) as store, EmbeddedServices(settings, store) as services:
        service = Service(settings, store, services)
        batch = service.submit(
            [*read_named_batch(locate_examples("json-queue"), "json-queue").grading_requests, *_spinning(1)]
        )
        service.until_running(batch)
        assert services.worker_pid is not None
        os.kill(services.worker_pid, signal.SIGKILL)
        service.wait(batch)
        service.assert_graded_once(batch)


@pytest.mark.long
def test_a_worker_frozen_past_its_lease_changes_nothing_when_it_thaws(tmp_path: Path) -> None:
    settings = settings_in(tmp_path, concurrency=2, lease_seconds=6.0)
    with open_store(settings) as store, EmbeddedServices(settings, store) as services:
        service = Service(settings, store, services)
        batch = service.submit([grading_request("warm-1"), grading_request("warm-2")])
        service.wait(batch)
        batch = service.submit([grading_request("spinner", SPIN, patient_echo())])
        job = service.until_running(batch)
        pool_child = job.process
        assert pool_child is not None
        # A job runs for a while before the student's program does.
        until(lambda: _has_student(pool_child))
        os.kill(pool_child, signal.SIGSTOP)
        until(lambda: next((each for each in service.jobs(batch) if each.attempt == 2), None))
        os.kill(pool_child, signal.SIGCONT)
        service.wait(batch)
        service.assert_graded_once(batch)
        assert [each.id for each in service.jobs(batch)] == [job.id]


def _has_student(pool_child: int) -> bool:
    """Return whether this pool child runs a student: the doorkeeper's zygote has a child, in bubblewrap or not."""
    below = [(pid, read_command_line(pid)) for pid in find_descendants(pool_child)]
    doorkeepers = [pid for pid, command in below if "inside.zygote" in command and "bwrap" not in command]
    return any(find_children(zygote) for doorkeeper in doorkeepers for zygote in find_children(doorkeeper))


@pytest.mark.long
def test_a_cancelled_job_stops(service: Service) -> None:
    batch = service.submit(_spinning(1))
    job = service.until_running(batch)
    assert acting.cancel(service.store, batch).running == 1
    after = service.submit([grading_request("after")])
    service.wait(after)
    assert [each.state for each in service.jobs(batch)] == [JobState.CANCELLED]
    with service.store.reading() as session:
        assert session.scalar(select(func.count()).select_from(TrialRow).where(TrialRow.job_id == job.id)) == 0


def test_a_home_with_a_long_path_has_its_socket_elsewhere(tmp_path: Path) -> None:
    settings = settings_in(tmp_path / ("deep" * 30))
    path = prepare_socket_path(settings)
    assert len(os.fsencode(path)) < 108
    assert path.parent.stat().st_mode & 0o077 == 0
    with EmbeddedBroker(settings), EmbeddedBroker(settings):
        assert is_broker_responding(settings)
    assert not is_broker_responding(settings)
    path.parent.rmdir() if not any(path.parent.iterdir()) else None


def test_a_broker_whose_file_is_rubbish_begins_afresh(tmp_path: Path) -> None:
    settings = settings_in(tmp_path)
    with EmbeddedBroker(settings):
        pass
    for path in (settings.home / "broker" / "appendonlydir").iterdir():
        path.write_bytes(b"rubbish" * 100)
    with EmbeddedBroker(settings):
        assert is_broker_responding(settings)
    assert (settings.home / "broker.unreadable").is_dir()


def test_a_broker_holds_the_lock_of_its_home_as_long_as_it_lives(tmp_path: Path) -> None:
    settings = settings_in(tmp_path)
    with EmbeddedBroker(settings) as broker:
        assert broker.pid is not None
        with (settings.home / "run" / "broker.lock").open() as lock:
            with pytest.raises(BlockingIOError):
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            os.kill(broker.pid, signal.SIGKILL)
            fcntl.flock(lock, fcntl.LOCK_EX)

        def again() -> bool:
            # A process that has released its lock may still be ending.
            broker.ensure()
            return is_broker_responding(settings)

        assert until(again)


@pytest.mark.long
def test_a_broker_that_was_found_running_is_left_running(tmp_path: Path) -> None:
    settings = settings_in(tmp_path)
    with EmbeddedBroker(settings):
        with EmbeddedBroker(settings):
            pass
        assert is_broker_responding(settings)
