"""The rate of a batch and the latency of a single submission, with two workers against PostgreSQL.

Real time, so a busy machine shows: run it alone. ``python -m benchmarks queue`` runs it by itself.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from responders.code import Code
from submissions.grading_request import GradingRequest

# The server is the one of the tests.
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "helpers"))

from benchmarks.measurement import Measurement
from postgresql_server import PostgresqlServer
from service.queue.celery_app import make_celery
from service.queue.notifier import Notifier
from service.queue.supervisor import Supervisor
from service.report_files import write_reports
from service.settings import load_settings
from service.store import batches, intake
from service.store.engine import Store, open_store
from service.store.metrics import quantile
from service.store.models import Job
from service.store.states import JobState, Lane
from submissions.assignment.reader import find_assignment
from submissions.submission import Submission

_BATCH = 200
_DEEP = 1000
_SINGLE = 40
_PATIENCE = 900.0
_RESPONDER = "def responder(msg):\n    return msg\n"
_PROGRAM = """\
from ev3dev2.motor import MoveTank, SpeedPercent, OUTPUT_B, OUTPUT_C
tank = MoveTank(OUTPUT_B, OUTPUT_C)
for turn in range(3):
    tank.on_for_rotations(SpeedPercent(30), SpeedPercent(20), 0.5)
    print("PY::hello")
"""


@dataclass(frozen=True, slots=True)
class _Bench:
    """The service under test, and who submits."""

    store: Store
    notifier: Notifier
    folder: Path

    def batch(self, name: str, count: int) -> str:
        """Queue that many submissions, none of them a copy of another."""
        accepted = intake.accept_batch(
            self.store, name, [_request(f"{name}-{number}") for number in range(count)], [], max_attempts=3
        )
        self.notifier.grade(Lane.BATCH, count)
        return accepted.id

    def ended(self, batch: str) -> int:
        with self.store.reading() as session:
            return batches.progress(session, batch).ended

    def single(self, student: str) -> float:
        """Seconds from a submission to its report on the disk, with marks and without plots."""
        begun = time.perf_counter()
        job = intake.accept(self.store, _request(student), max_attempts=3).job_id
        self.notifier.grade(Lane.INTERACTIVE)
        self.until(lambda: self._graded(job))
        with self.store.reading() as session:
            line = batches.job_line(session, job)
        write_reports(self.store, [line], self.folder)
        return time.perf_counter() - begun

    def until(self, look: Callable[[], bool], pause: float = 0.02) -> None:
        begun = time.monotonic()
        while not look():
            if time.monotonic() - begun > _PATIENCE:
                raise RuntimeError("the service does not come to an end")
            time.sleep(pause)

    def _graded(self, job: str) -> bool:
        with self.store.reading() as session:
            return session.get_one(Job, job).state is JobState.DONE


def measure() -> list[Measurement]:
    """The rate first, then single submissions with nothing else to do, then with a long batch before them."""
    server = PostgresqlServer()
    url = server.url.replace("postgresql://", "postgresql+psycopg://", 1)
    try:
        with tempfile.TemporaryDirectory() as folder:
            settings = load_settings(home=Path(folder), database_url=url, concurrency=1)
            with open_store(settings) as store:
                service = Supervisor(settings, store, workers=2, listening=None)
                with service:
                    notifier = Notifier(make_celery(service.settings), store, service.settings)
                    bench = _Bench(store, notifier, Path(folder))
                    service.ensure()
                    bench.until(lambda: service.ready)
                    return _measure(bench)
    finally:
        server.close()


def _measure(bench: _Bench) -> list[Measurement]:
    warm = bench.batch("warm", 4)
    bench.until(lambda: bench.ended(warm) == 4)
    begun = time.perf_counter()
    batch = bench.batch("batch", _BATCH)
    bench.until(lambda: bench.ended(batch) == _BATCH)
    rate = 60 * _BATCH / (time.perf_counter() - begun)
    bench.until(lambda: _plots_drawn(bench))
    idle = sorted(bench.single(f"idle-{number}") for number in range(_SINGLE))
    deep = bench.batch("deep", _DEEP)
    loaded = sorted(bench.single(f"loaded-{number}") for number in range(_SINGLE))
    left = _DEEP - bench.ended(deep)
    return [
        Measurement(
            f"batch of {_BATCH} short submissions, 2 workers, PostgreSQL, to marks",
            f"{rate:.0f} a minute",
            "300 a minute",
            "600 a minute",
        ),
        Measurement("submission to report, nothing else to do: p50, p95, p99", _seconds(idle), "1 s"),
        Measurement(
            f"submission to report, {_DEEP} of a batch waiting ({left} still at the end)", _seconds(loaded), "-"
        ),
    ]


def _plots_drawn(bench: _Bench) -> bool:
    from service.store import plots

    return plots.due(bench.store) == 0


def _seconds(values: Sequence[float]) -> str:
    return ", ".join(f"{quantile(values, share):.2f}" for share in (0.5, 0.95, 0.99)) + " s"


def _request(student: str) -> GradingRequest:
    # A text of its own, or it would be a copy of the one before, which is not run again.
    program = Code("robot.py", f"# {student}\n{_PROGRAM}")
    submission = Submission(student, program, Code("responder.py", _RESPONDER))
    return GradingRequest(submission, find_assignment("echo-responder"), f"{student}.zip")
