"""Fault injection for a real service, and the evaluation of the results.

Workers, broker and database are separate processes. Workers are restarted as on another machine, without information
about earlier ones, so that only leases and fences protect the jobs.
"""

from __future__ import annotations

import os
import random
import resource
import shutil
import signal
import sqlite3
import subprocess
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path

from sqlalchemy import func, select
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session

from benchmarks.harness.postgresql_server import PostgresqlServer
from benchmarks.harness.process_tree import find_children, find_descendants, read_command_line
from responders.source_file import SourceFile
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.queue.broker import EmbeddedBroker
from service.queue.celery_app import make_celery
from service.queue.live_workers import WORKER_VARIABLE, create_worker_name
from service.queue.notifier import Notifier
from service.queue.processes import end_processes, start_process
from service.settings import Settings
from service.store.batches.intake import accept_batch
from service.store.batches.stored_requests import load_grading_request
from service.store.engine import Store
from service.store.states import UNFINISHED, JobQueue, JobState
from service.store.tables.grades import CriterionResultRow, TrialRow
from service.store.tables.installation import Heartbeat
from service.store.tables.submissions import Job
from sim.errors import HostError
from sim.processes import build_python_command
from submissions.assignment.reader import find_assignment
from submissions.grading_request import GradingRequest
from submissions.submission import Submission

#: Number of different behaviours. Each submission has one of them, with its own text because copies are not graded
#: again.
_VARIANTS = 12
_MOMENTS = (
    "due_at",
    "lease_until",
    "heartbeat_at",
    "queued_at",
    "notified_at",
    "started_at",
    "graded_at",
    "finished_at",
)
#: Import path with a module that gives Python a wrong clock.
_WRONG_CLOCK = Path(__file__).parent / "wrong_clock"
_STEP = timedelta(hours=1)


def _build_program(variant: int, number: int) -> str:
    # Every fourth one computes for a while, to allow a fault meanwhile.
    work = "sum(range(40_000_000))\n" if variant % 4 == 0 else ""
    return (
        f"# submission {number}\n"
        "from ev3dev2.motor import MoveTank, SpeedPercent, OUTPUT_B, OUTPUT_C\n"
        "tank = MoveTank(OUTPUT_B, OUTPUT_C)\n"
        f"tank.on_for_rotations(SpeedPercent({20 + variant}), SpeedPercent(20), 0.5)\n"
        f"{work}print('PY::variant {variant}')\n"
        f"tank.on_for_rotations(SpeedPercent(20), SpeedPercent({20 + variant}), 0.5)\n"
    )


def build_requests(count: int) -> list[GradingRequest]:
    """Return short submissions by many students, each with a different text."""
    return [
        _build_request(f"student-{number:04}", _build_program(number % _VARIANTS, number)) for number in range(count)
    ]


def _build_request(student: str, program: str) -> GradingRequest:
    responder = SourceFile("responder.py", "def responder(msg):\n    return msg\n")
    submission = Submission(student, SourceFile("robot.py", program), responder)
    return GradingRequest(submission, find_assignment("echo-responder"), f"{student}.zip")


def compute_expected_hashes() -> list[tuple[str, ...]]:
    """Return the hash chains of the trials of each variant, from a run without a queue."""
    with TrialRunner() as runner:
        grades = [grade(each.submission, each.assignment, runner=runner) for each in build_requests(_VARIANTS)]
    return [tuple(trial.recording.sha256 for trial in each.trials) for each in grades]


@dataclass(frozen=True, slots=True)
class CampaignResults:
    """The results of a campaign."""

    states: Mapping[JobState, int]
    errors: Sequence[str]  # of jobs without a grade
    duplicated: int  # jobs with a wrong number of rows of marks or trials
    differing: int  # jobs with other hashes than the undisturbed run
    most_attempts: int
    seconds: float
    injected: Mapping[str, int]

    def sentence(self) -> str:
        """Return the results as a sentence."""
        states = ", ".join(f"{count} {state.value}" for state, count in self.states.items())
        injected = ", ".join(f"{count} x {name}" for name, count in self.injected.items())
        return (
            f"{states}; {self.duplicated} doubled, {self.differing} with other hashes; most attempts for one "
            f"{self.most_attempts}; {self.seconds:.0f} s; {injected}"
        )


class FaultInjector:
    """A broker, workers and a database, and the faults for them. ``ensure`` restarts processes that have ended."""

    def __init__(
        self,
        settings: Settings,
        store: Store,
        server: PostgresqlServer | None,
        workers: int,
        seed: int,
        disk: Path | None,
    ) -> None:
        self._broker = EmbeddedBroker(settings)
        self._home = settings.home
        self.settings = self._broker.settings
        self.store = store
        self._server = server
        self._disk = disk
        self._workers: list[subprocess.Popen[bytes] | None] = [None] * workers
        self._frozen: list[tuple[float, list[int]]] = []
        self._chance = random.Random(seed)
        self.done: Counter[str] = Counter()

    def ensure(self) -> None:
        """Restart processes that have ended, and resume those that were frozen long enough."""
        with suppress(HostError):
            self._broker.ensure()
        if self._server is not None:
            self._server.ensure()
        for position, worker in enumerate(self._workers):
            if worker is None or worker.poll() is not None:
                self._workers[position] = self._start_worker(position)
        still_frozen = []
        for resume_at, pids in self._frozen:
            if time.monotonic() >= resume_at:
                _send_signal(pids, signal.SIGCONT)
            else:
                still_frozen.append((resume_at, pids))
        self._frozen = still_frozen

    def stop(self) -> None:
        """Stop all processes."""
        for _, pids in self._frozen:
            _send_signal(pids, signal.SIGCONT)
        end_processes([worker for worker in self._workers if worker is not None], 0)
        self._broker.stop()

    def list_faults(self) -> Mapping[str, Callable[[], None]]:
        """Return the faults for this service by name."""
        common: dict[str, Callable[[], None]] = {
            "worker killed": self._kill_worker,
            "pool child killed": self._kill_pool_child,
            "worker frozen past its lease": self._freeze_worker,
            "broker killed": self._kill_broker,
            "broker killed, its file lost": self._lose_broker,
            "clock set forward": lambda: self._step_clock(_STEP),
            "clock set back": lambda: self._step_clock(-_STEP),
        }
        if self._server is None:
            database_faults = {"database locked": self._lock_database}
        else:
            database_faults = {"database ended": self._end_database, "database killed": self._kill_database}
        disk_faults = (
            {"disk full": self._fill_disk} if self._disk is not None else {"no file may grow": self._forbid_growth}
        )
        return common | database_faults | disk_faults

    def inject_fault(self, name: str) -> None:
        """Inject the fault with this name."""
        self.list_faults()[name]()
        self.done[name] += 1

    def _start_worker(self, position: int) -> subprocess.Popen[bytes]:
        environment = {**self.settings.to_environment(), WORKER_VARIABLE: create_worker_name()}
        if position == 0 and self._server is not None:
            # With many machines, one of them has a wrong clock.
            environment["PYTHONPATH"] = str(_WRONG_CLOCK)
        log = self._home / "log" / f"worker-{position}.log"
        return start_process(build_python_command("-m", "service.queue.worker"), environment, log, signal.SIGKILL)

    def _choose_worker(self) -> int | None:
        running = [worker.pid for worker in self._workers if worker is not None and worker.poll() is None]
        busy = [pid for pid in running if _find_pool_children(pid)]
        return self._chance.choice(busy) if busy else None

    def _kill_worker(self) -> None:
        _send_signal([self._choose_worker()], signal.SIGKILL)

    def _kill_pool_child(self) -> None:
        worker = self._choose_worker()
        if worker is not None:
            _send_signal([self._chance.choice(_find_pool_children(worker))], signal.SIGKILL)

    def _freeze_worker(self) -> None:
        worker = self._choose_worker()
        if worker is not None:
            pids = [worker, *find_descendants(worker)]
            _send_signal(pids, signal.SIGSTOP)
            self._frozen.append((time.monotonic() + 1.5 * self.settings.lease_seconds, pids))

    def _kill_broker(self) -> None:
        _send_signal([self._broker.pid], signal.SIGKILL)

    def _lose_broker(self) -> None:
        self._kill_broker()
        time.sleep(0.2)
        for path in (self._home / "broker").rglob("*.*"):
            if path.is_file():
                path.unlink()

    def _end_database(self) -> None:
        assert self._server is not None
        self._server.end(self._chance.choice([signal.SIGINT, signal.SIGQUIT]))

    def _kill_database(self) -> None:
        assert self._server is not None
        self._server.end(signal.SIGKILL)

    def _lock_database(self) -> None:
        with closing(sqlite3.connect(self._home / "robomark.db", isolation_level=None, timeout=30)) as connection:
            connection.execute("BEGIN IMMEDIATE")
            time.sleep(self.settings.lease_seconds)
            connection.execute("ROLLBACK")

    def _step_clock(self, step: timedelta) -> None:
        """Set the clock forward by making all stored times older, in one transaction."""

        def change(session: Session) -> None:
            for job in session.scalars(select(Job).with_for_update()):
                for name in _MOMENTS:
                    moment: datetime | None = getattr(job, name)
                    if moment is not None:
                        setattr(job, name, moment - step)
                if job.plots_due_at is not None:
                    job.plots_due_at -= step
            for heartbeat in session.scalars(select(Heartbeat).with_for_update()):
                heartbeat.seen_at -= step

        with suppress(DBAPIError), self.store.transaction() as session:
            change(session)

    def _fill_disk(self) -> None:
        assert self._disk is not None
        ballast = self._disk / "ballast"
        with suppress(OSError), ballast.open("wb", buffering=0) as file:
            while True:
                file.write(b"\0" * 65536)
        time.sleep(self.settings.lease_seconds)
        ballast.unlink()

    def _forbid_growth(self) -> None:
        """Limit file sizes of the workers for a while. Used where no small disk can be mounted."""
        pids = [
            pid for worker in self._workers if worker is not None for pid in (worker.pid, *find_descendants(worker.pid))
        ]
        python = [pid for pid in pids if "python" in read_command_line(pid)]
        for pid in python:
            _limit_files(pid, 4096)
        time.sleep(self.settings.lease_seconds)
        for pid in python:
            _limit_files(pid, resource.RLIM_INFINITY)


@dataclass(frozen=True, slots=True)
class Campaign:
    """A campaign: a number of submissions, with faults at intervals until all have ended."""

    grading_requests: int
    #: Minimum and maximum seconds between faults. Each kind occurs once before any repeats.
    pause: tuple[float, float]
    seed: int = 1
    patience_seconds: float = 300.0
    tell: Callable[[str], None] = field(default=lambda _: None)

    def run(self, injector: FaultInjector, expected_hashes: Sequence[tuple[str, ...]]) -> CampaignResults:
        """Submit, inject faults until all jobs have ended, and return the results."""
        chance = random.Random(self.seed)
        names = list(injector.list_faults())
        batch = accept_batch(injector.store, "chaos", build_requests(self.grading_requests), [], max_attempts=20).id
        injector.ensure()
        Notifier(make_celery(injector.settings), injector.store, injector.settings).grade(
            JobQueue.BATCH, self.grading_requests
        )
        start = time.monotonic()
        next_at = start
        pending_faults: list[str] = []
        while (remaining := _count_unfinished_jobs(injector.store, batch)) != 0:
            injector.ensure()
            moment = time.monotonic()
            assert moment - start < self.patience_seconds, f"{remaining} have not ended after {moment - start:.0f} s"
            if moment >= next_at and remaining is not None and _has_begun(injector.store, batch):
                pending_faults = pending_faults or chance.sample(names, len(names))
                name = pending_faults.pop()
                self.tell(f"{moment - start:4.0f} s, {remaining:4} left: {name}")
                injector.inject_fault(name)
                next_at = time.monotonic() + chance.uniform(*self.pause)
            time.sleep(0.1)
        return _collect_results(injector, batch, expected_hashes, time.monotonic() - start)


@contextmanager
def small_disk(folder: Path, megabytes: int) -> Iterator[Path | None]:
    """Yield a small file system at ``folder``, or None if it can't be mounted. The folder is removed at the end."""
    folder.mkdir(exist_ok=True)
    mount = ["mount", "-t", "tmpfs", "-o", f"size={megabytes}m,mode=755", "robomark", str(folder)]
    is_mounted = subprocess.run(mount, capture_output=True, check=False).returncode == 0
    try:
        yield folder if is_mounted else None
    finally:
        if is_mounted:
            subprocess.run(["umount", "--lazy", str(folder)], capture_output=True, check=False)
        shutil.rmtree(folder, ignore_errors=True)


def _collect_results(
    injector: FaultInjector, batch: str, expected_hashes: Sequence[tuple[str, ...]], seconds: float
) -> CampaignResults:
    with injector.store.reading() as session:
        jobs = session.scalars(select(Job).where(Job.batch_id == batch).order_by(Job.queued_at, Job.id)).all()
        duplicate_count = different_count = 0
        criteria = len(load_grading_request(session, jobs[0].id).assignment.criteria)
        for job in jobs:
            if job.state is not JobState.DONE:
                continue
            variant = int(load_grading_request(session, job.id).submission.student.partition("-")[2]) % len(
                expected_hashes
            )
            trials = session.scalars(
                select(TrialRow).where(TrialRow.job_id == job.id).order_by(TrialRow.position)
            ).all()
            result_count = (
                select(func.count()).select_from(CriterionResultRow).where(CriterionResultRow.job_id == job.id)
            )
            duplicate_count += (len(trials), session.scalar(result_count)) != (len(expected_hashes[variant]), criteria)
            different_count += tuple(trial.sha256 for trial in trials) != expected_hashes[variant]
        return CampaignResults(
            states=Counter(job.state for job in jobs),
            errors=[job.error or "" for job in jobs if job.state is not JobState.DONE],
            duplicated=duplicate_count,
            differing=different_count,
            most_attempts=max(job.attempt for job in jobs),
            seconds=seconds,
            injected=dict(injector.done),
        )


def _count_unfinished_jobs(store: Store, batch: str) -> int | None:
    """Return the number of unfinished jobs, or None while the database is unavailable."""
    query = select(func.count()).select_from(Job).where(Job.batch_id == batch, Job.state.in_(UNFINISHED))
    try:
        with store.reading() as session:
            return session.scalar(query)
    except DBAPIError:
        return None


def _has_begun(store: Store, batch: str) -> bool:
    """Return whether workers have started on the batch, so that faults have an effect."""
    query = select(func.count()).select_from(Job).where(Job.batch_id == batch, Job.state == JobState.RUNNING)
    with suppress(DBAPIError), store.reading() as session:
        return bool(session.scalar(query))
    return False


def _find_pool_children(worker: int) -> list[int]:
    return [pid for pid in find_children(worker) if "spawn_main" in read_command_line(pid)]


def _send_signal(pids: Sequence[int | None], number: signal.Signals) -> None:
    for pid in pids:
        if pid is not None:
            with suppress(ProcessLookupError):
                os.kill(pid, number)


def _limit_files(pid: int, size: int) -> None:
    with suppress(ProcessLookupError, PermissionError):
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
