"""The metrics of the service for Prometheus. Each request reads them from the database.

Values that only increase are counters: they are sums over rows that are never deleted.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from service.operations import system
from service.operations.context import Service
from service.operations.system import ServiceMetrics, compute_quantile
from service.operations.types import JobQueue, JobState, PlotState
from service.version import GRADER_VERSION

_QUANTILES = (0.5, 0.95, 0.99)
_UNFINISHED = (JobState.QUEUED, JobState.RUNNING)
_ENDED = (JobState.DONE, JobState.DEAD, JobState.CANCELLED)


def render_metrics(service: Service) -> bytes:
    """Return all metrics in Prometheus's text format."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(_MetricsCollector(service))
    return generate_latest(registry)


class _MetricsCollector(Collector):
    def __init__(self, service: Service) -> None:
        self._service = service

    def collect(self) -> Iterable[Metric]:
        metrics = system.collect_metrics(self._service)
        yield from _collect_queue_metrics(metrics)
        yield from _collect_outcome_metrics(metrics)
        yield from _collect_worker_metrics(metrics)
        yield from _collect_phase_times(metrics)

    def describe(self) -> Iterable[Metric]:
        """Return no descriptions, so that the collector can be created without the database."""
        return ()


def _collect_queue_metrics(metrics: ServiceMetrics) -> Iterator[Metric]:
    open_jobs = GaugeMetricFamily("robomark_jobs_open", "Jobs that have not ended.", labels=["lane", "state"])
    for lane in JobQueue:
        for state in _UNFINISHED:
            open_jobs.add_metric([lane.value, state.value], metrics.queue.jobs.get((lane, state), 0))
    yield open_jobs
    depth = GaugeMetricFamily("robomark_queue_depth", "Jobs that a worker could begin now.", labels=["lane"])
    oldest_seconds = GaugeMetricFamily(
        "robomark_queue_oldest_seconds",
        "How long the oldest job that a worker could begin has waited.",
        labels=["lane"],
    )
    for lane in JobQueue:
        depth.add_metric([lane.value], metrics.queue.claimable.get(lane, 0))
        oldest_seconds.add_metric([lane.value], metrics.queue.oldest_seconds.get(lane, 0.0))
    yield depth
    yield oldest_seconds
    plots = GaugeMetricFamily("robomark_plots", "Grades by the state of their plots.", labels=["state"])
    for plot_state in (PlotState.DUE, PlotState.DONE, PlotState.FAILED):
        plots.add_metric([plot_state.value], metrics.plots.get(plot_state, 0))
    yield plots
    yield GaugeMetricFamily("robomark_batches_paused", "Batches that are held back.", metrics.paused_batches)


def _collect_outcome_metrics(metrics: ServiceMetrics) -> Iterator[Metric]:
    ended_jobs = CounterMetricFamily("robomark_jobs_ended", "Jobs that have ended.", labels=["lane", "state"])
    for lane in JobQueue:
        for state in _ENDED:
            ended_jobs.add_metric([lane.value, state.value], metrics.queue.jobs.get((lane, state), 0))
    yield ended_jobs
    verdicts = CounterMetricFamily("robomark_verdicts", "Grades by verdict.", labels=["verdict"])
    for verdict, count in sorted(metrics.verdicts.items()):
        verdicts.add_metric([verdict], count)
    yield verdicts
    yield CounterMetricFamily(
        "robomark_host_faults", "Attempts that failed through no fault of the student's.", metrics.host_faults
    )
    yield CounterMetricFamily(
        "robomark_criteria_unjudged", "Criteria that could not be judged within their bounds.", metrics.unjudged
    )
    yield CounterMetricFamily(
        "robomark_surprises", "Trials in which our own code stumbled over what a child sent.", metrics.surprises
    )


def _collect_worker_metrics(metrics: ServiceMetrics) -> Iterator[Metric]:
    live_workers = [seen for seen in metrics.queue.workers if seen.lately]
    yield GaugeMetricFamily("robomark_workers", "Workers heard of in the last 30 s.", len(live_workers))
    yield GaugeMetricFamily(
        "robomark_workers_quarantined", "Workers that got a known answer wrong.", metrics.quarantined
    )
    silent_seconds = GaugeMetricFamily(
        "robomark_worker_silent_seconds", "Since the worker was last heard of.", labels=["worker", "host", "version"]
    )
    slots = GaugeMetricFamily("robomark_worker_slots", "Gradings at a time.", labels=["worker", "host"])
    for line in metrics.queue.workers:
        worker = line.worker
        silent_seconds.add_metric(
            [worker.name, worker.host, worker.grader_version], metrics.queue.silent_seconds[worker.name]
        )
        slots.add_metric([worker.name, worker.host], worker.concurrency)
    yield silent_seconds
    yield slots
    build_info = GaugeMetricFamily("robomark_build", "What answers here; always 1.", labels=["grader_version"])
    build_info.add_metric([GRADER_VERSION], 1)
    yield build_info


def _collect_phase_times(metrics: ServiceMetrics) -> Iterator[Metric]:
    times = GaugeMetricFamily(
        "robomark_phase_seconds",
        "How long each phase took in the jobs that ended within the last hour.",
        labels=["phase", "quantile"],
    )
    counts = GaugeMetricFamily("robomark_phase_jobs", "Over how many jobs.", labels=["phase"])
    for phase, values in metrics.times.items():
        counts.add_metric([phase], len(values))
        for share in _QUANTILES:
            if values:
                times.add_metric([phase, str(share)], compute_quantile(values, share))
    yield times
    yield counts
