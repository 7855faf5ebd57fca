"""Claims by one worker with 10,000 and with 100 waiting jobs, on both databases: ``python -m benchmarks claims``.

The claims per second are real time and need an idle machine. The CPU time is that of the worker and of its connection
in the database server.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import text

from benchmarks import many_rows
from benchmarks.measurement import A_SECOND, MILLISECONDS, RATIO, Measurement
from benchmarks.rows import fill_databases, vacuum
from service.store.engine import Store
from service.store.queue import jobs

_FEW = 100
_WARM_UP, _CLAIMS = 10, 80
#: Budget for the CPU time with many waiting jobs, relative to few.
_MAX_RATIO = 1.5
_WORKER = "worker"


@dataclass(frozen=True, slots=True)
class _ClaimCosts:
    """The mean costs of a claim in seconds."""

    real: float
    cpu: float


def measure(_times: int) -> list[Measurement]:
    """Measure the claims on both databases, first with many waiting jobs."""
    measurements = []
    for database, store in fill_databases():
        many = _measure_claims(store)
        many_rows.cancel_waiting_jobs(store, _FEW)
        vacuum(store)
        few = _measure_claims(store)
        budget, beyond = (500, 2000) if database == "PostgreSQL" else (None, None)
        title = f"claims, {database}"
        measurements += [
            Measurement(f"{title}, 10,000 jobs waiting", 1 / many.real, A_SECOND, budget, beyond),
            Measurement(f"{title}, {_FEW} jobs waiting", 1 / few.real, A_SECOND),
            Measurement(f"{title}, 10,000 jobs waiting: CPU of one", 1000 * many.cpu, MILLISECONDS),
            Measurement(f"{title}: CPU with 10,000 waiting against {_FEW}", many.cpu / few.cpu, RATIO, _MAX_RATIO),
        ]
    return measurements


def _measure_claims(store: Store) -> _ClaimCosts:
    _claim(store, _WARM_UP)
    cpu, real = _read_cpu_seconds(store), time.perf_counter()
    _claim(store, _CLAIMS)
    return _ClaimCosts((time.perf_counter() - real) / _CLAIMS, (_read_cpu_seconds(store) - cpu) / _CLAIMS)


def _claim(store: Store, count: int) -> None:
    for _ in range(count):
        assert jobs.claim_job(store, _WORKER, 60) is not None


def _read_cpu_seconds(store: Store) -> float:
    """Return the CPU seconds of this process and, on PostgreSQL, of the server's process for its only connection."""
    if store.engine.dialect.name == "sqlite":
        return time.process_time()
    with store.reading() as session:
        pid = session.scalar(text("SELECT pg_backend_pid()"))
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return time.process_time() + (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
