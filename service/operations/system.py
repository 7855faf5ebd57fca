"""System status for operators: queues, workers, checks and failed jobs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from service.operations.context import Actor, Service
from service.operations.lookup import check_operator
from service.store.queue import dead_letters, test_runs, workers
from service.store.queue.dead_letters import DeadLetter
from service.store.queue.metrics import ServiceMetrics as ServiceMetrics
from service.store.queue.metrics import collect_service_metrics
from service.store.queue.metrics import compute_quantile as compute_quantile
from service.store.queue.test_runs import QueuedTestRuns
from service.store.queue.workers import QuarantinedWorker, WorkerLine
from service.store.states import JobState
from service.version import GRADER_VERSION

if TYPE_CHECKING:
    from service.doctor import Finding


@dataclass(frozen=True, slots=True)
class SystemView:
    """Status of the whole service at one moment."""

    version: str
    findings: tuple[Finding, ...]
    metrics: ServiceMetrics
    quarantined: Mapping[str, QuarantinedWorker]  # by worker
    failed: tuple[DeadLetter, ...]  # the newest
    failed_count: int
    test_runs: QueuedTestRuns


def show(service: Service, actor: Actor) -> SystemView:
    """Return the status of the service. Raises NotFound unless the actor is an operator."""
    from service.doctor import examine_service

    check_operator(actor)
    findings = examine_service(service.settings, service.store)
    with service.store.reading() as session:
        metrics = collect_service_metrics(session)
        return SystemView(
            GRADER_VERSION,
            tuple(findings),
            metrics,
            {each.worker: each for each in workers.list_quarantined_workers(session)},
            tuple(dead_letters.list_dead_letters(session)),
            metrics.queue.count(JobState.DEAD),
            test_runs.measure_queue(session),
        )


def collect_metrics(service: Service) -> ServiceMetrics:
    """Return the metrics of the whole service, which are public because they name no person."""
    with service.store.reading() as session:
        return collect_service_metrics(session)


def list_workers(service: Service, actor: Actor) -> list[tuple[WorkerLine, QuarantinedWorker | None]]:
    """Return the known workers by name, each with its quarantine if it is in one. Raises NotFound."""
    check_operator(actor)
    with service.store.reading() as session:
        quarantines_by_name = {each.worker: each for each in workers.list_quarantined_workers(session)}
        return [(seen, quarantines_by_name.get(seen.worker.name)) for seen in workers.load_workers(session)]


def list_failed(service: Service, actor: Actor) -> list[DeadLetter]:
    """Return the newest failed jobs of all courses. Raises NotFound."""
    check_operator(actor)
    with service.store.reading() as session:
        return dead_letters.list_dead_letters(session)
