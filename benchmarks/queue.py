"""Throughput of a batch and latency of single submissions, with one and two workers and PostgreSQL.

It measures real time, so run it on an idle machine: ``python -m benchmarks queue``.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from benchmarks.graded_store import build_short_request
from benchmarks.harness.postgresql_server import PostgresqlServer, create_database
from benchmarks.measurement import A_MINUTE, COUNT, GAIN, SECONDS, Measurement
from service.queue.celery_app import make_celery
from service.queue.notifier import Notifier
from service.queue.supervisor import Supervisor
from service.report_files import write_report
from service.settings import load_settings
from service.store.batches import batches, intake, job_lines
from service.store.engine import Store, open_store
from service.store.grades import plots, results
from service.store.queue.metrics import compute_quantile
from service.store.states import JobQueue, JobState
from service.store.tables.submissions import Job

_BATCH = 200
_DEEP = 500
_SINGLE = 20
_PATIENCE = 900.0


@dataclass(frozen=True, slots=True)
class _Bench:
    """The service under test, and the students who submit."""

    store: Store
    notifier: Notifier
    folder: Path

    def batch(self, name: str, count: int) -> str:
        """Queue this number of submissions, each with a different text."""
        batch = intake.accept_batch(
            self.store, name, [build_short_request(f"{name}-{number}") for number in range(count)], [], max_attempts=3
        )
        self.notifier.grade(JobQueue.BATCH, count)
        return batch.id

    def count_ended_jobs(self, batch: str) -> int:
        with self.store.reading() as session:
            return batches.load_progress(session, batch).ended

    def measure_single(self, student: str) -> float:
        """Return the seconds from a submission to its report on disk, with marks and without plots."""
        start = time.perf_counter()
        job = intake.accept_submission(self.store, build_short_request(student), max_attempts=3).job_id
        self.notifier.grade(JobQueue.INTERACTIVE)
        self.wait_until(lambda: self._graded(job))
        with self.store.reading() as session:
            line, student_grade = job_lines.load_job_line(session, job), results.load_grade(session, job)
        write_report(self.store, line, student_grade, self.folder, student)
        return time.perf_counter() - start

    def wait_until(self, is_done: Callable[[], bool], pause: float = 0.02) -> None:
        start = time.monotonic()
        while not is_done():
            if time.monotonic() - start > _PATIENCE:
                raise RuntimeError("the service does not come to an end")
            time.sleep(pause)

    def _graded(self, job: str) -> bool:
        with self.store.reading() as session:
            return session.get_one(Job, job).state is JobState.DONE


def measure(_times: int) -> list[Measurement]:
    """Measure throughput with one and two workers, then single submissions alone and behind a batch."""
    with PostgresqlServer() as server:
        with _service(server, workers=1) as bench:
            single_rate = _measure_rate(bench)
        with _service(server, workers=2) as bench:
            return _measure(bench, single_rate)


@contextmanager
def _service(server: PostgresqlServer, workers: int) -> Iterator[_Bench]:
    """Yield a service on an empty database, when its workers are ready."""
    with tempfile.TemporaryDirectory() as folder:
        settings = load_settings(home=Path(folder), database_url=create_database(server.url), concurrency=1)
        with open_store(settings) as store, Supervisor(settings, store, workers=workers, web_socket=None) as service:
            bench = _Bench(store, Notifier(make_celery(service.settings), store, service.settings), Path(folder))
            service.ensure()
            bench.wait_until(lambda: service.is_ready)
            yield bench


def _measure_rate(bench: _Bench) -> float:
    """Return the submissions per minute, up to their marks, after a warm-up."""
    warm_up_batch = bench.batch("warm", 8)
    bench.wait_until(lambda: bench.count_ended_jobs(warm_up_batch) == 8)
    bench.wait_until(lambda: _has_drawn_plots(bench))
    start = time.perf_counter()
    batch = bench.batch("batch", _BATCH)
    bench.wait_until(lambda: bench.count_ended_jobs(batch) == _BATCH)
    return 60 * _BATCH / (time.perf_counter() - start)


def _measure(bench: _Bench, single_rate: float) -> list[Measurement]:
    start = time.perf_counter()
    rate = _measure_rate(bench)
    bench.wait_until(lambda: _has_drawn_plots(bench))
    plots_rate = 60 * _BATCH / (time.perf_counter() - start)
    idle_seconds = sorted(bench.measure_single(f"idle-{number}") for number in range(_SINGLE))
    deep_batch = bench.batch("deep", _DEEP)
    loaded_seconds = sorted(bench.measure_single(f"loaded-{number}") for number in range(_SINGLE))
    remaining = _DEEP - bench.count_ended_jobs(deep_batch)
    batch = f"batch of {_BATCH} short submissions, PostgreSQL"
    return [
        Measurement(f"{batch}, 2 workers, to marks", rate, A_MINUTE, 300, 600),
        Measurement(f"{batch}, 2 workers, to marks and plots", plots_rate, A_MINUTE, 300, 600),
        Measurement(f"{batch}: 2 workers against 1, on {os.cpu_count()} cores", rate / single_rate, GAIN),
        _build_latency_row("submission to report, nothing else to do", idle_seconds, 1),
        _build_latency_row(f"submission to report, {_DEEP} of a batch waiting", loaded_seconds),
        Measurement("of these still waiting at the end", remaining, COUNT),
    ]


def _has_drawn_plots(bench: _Bench) -> bool:
    return plots.count_due_plots(bench.store) == 0


def _build_latency_row(title: str, seconds: Sequence[float], budget: float | None = None) -> Measurement:
    details = ", ".join(
        f"p{share:.0%}".rstrip("%") + f" {compute_quantile(seconds, share):.2f} s" for share in (0.95, 0.99)
    )
    return Measurement(title, compute_quantile(seconds, 0.5), SECONDS, budget, details=details)
