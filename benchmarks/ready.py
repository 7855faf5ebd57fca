"""CPU costs of a worker and all its processes up to its first claim, with and without the known answer.

A worker grades the known answer first if this build has not done so on this machine, otherwise soon after.
"""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

from benchmarks.graded_store import build_short_request
from benchmarks.harness.process_tree import find_descendants
from benchmarks.measurement import SECONDS, Measurement, median
from service.queue.broker import EmbeddedBroker
from service.queue.celery_app import make_celery
from service.queue.notifier import Notifier
from service.queue.supervised_processes import SupervisedWorker
from service.settings import load_settings
from service.store.batches import intake
from service.store.engine import Store, open_store
from service.store.states import JobQueue
from service.store.tables.submissions import Job

_PATIENCE = 120.0
_LOOK_SECONDS = 0.02
_TICKS = os.sysconf("SC_CLK_TCK")


def measure(times: int) -> list[Measurement]:
    """Measure two workers in turn, in a new home for each repetition."""
    asked_seconds, cached_seconds = zip(*(_measure_two_workers() for _ in range(times)), strict=True)
    title = "a worker's start until it claims, all its processes, CPU"
    return [
        Measurement(f"{title}, known answer cached", median(cached_seconds), SECONDS, 2),
        Measurement(f"{title}, asked for the known answer", median(asked_seconds), SECONDS, 5),
    ]


def _measure_two_workers() -> tuple[float, float]:
    with tempfile.TemporaryDirectory() as folder:
        settings = load_settings(home=Path(folder))
        with open_store(settings) as store, EmbeddedBroker(settings) as broker:
            notifier = Notifier(make_celery(broker.settings), store, broker.settings)
            return _measure_cpu_until_claim(store, notifier, "first"), _measure_cpu_until_claim(
                store, notifier, "second"
            )


def _measure_cpu_until_claim(store: Store, notifier: Notifier, student: str) -> float:
    job = intake.accept_submission(store, build_short_request(student), max_attempts=3).job_id
    notifier.grade(JobQueue.INTERACTIVE)
    worker = SupervisedWorker(notifier.settings, store, notifier.settings.home / "log" / "worker.log")
    deadline = time.monotonic() + _PATIENCE
    worker.ensure()
    try:
        while not _is_claimed(store, job):
            if time.monotonic() > deadline:
                raise RuntimeError("the worker claims nothing")
            time.sleep(_LOOK_SECONDS)
        assert worker.process.pid is not None
        return sum(map(_read_cpu_seconds, (worker.process.pid, *find_descendants(worker.process.pid))))
    finally:
        worker.stop(15)


def _is_claimed(store: Store, job: str) -> bool:
    with store.reading() as session:
        return session.get_one(Job, job).started_at is not None


def _read_cpu_seconds(pid: int) -> float:
    """Return the CPU seconds of the process and of its ended children."""
    try:
        stat_fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except (FileNotFoundError, ProcessLookupError):
        return 0.0
    return sum(map(int, stat_fields[11:15])) / _TICKS
