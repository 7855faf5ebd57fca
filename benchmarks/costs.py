"""Breakdown of CPU costs: one trial, one submission and one batch. Run it with ``python -m benchmarks costs``."""

from __future__ import annotations

import cProfile
import os
import pstats
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TypeVar

from rich.console import Console
from rich.table import Table

from benchmarks.calibration import measure_loop
from benchmarks.graded_store import build_short_request
from benchmarks.measurement import median
from benchmarks.simulator import FOLLOWER, build_spec
from service.grading.grade import Grade
from service.grading.grader import GradingProgress, grade
from service.grading.trial_runner import TrialRunner
from service.plotting import draw_plots
from service.reports.html import render_report_page
from service.reports.view import build_student_view
from service.settings import load_settings
from service.store.batches import intake
from service.store.engine import Store, open_store
from service.store.grades import results
from service.store.queue import jobs
from submissions.grading_request import GradingRequest

_ROOT = Path(__file__).parents[1]
_TIMES = 7
_ROOMS = 8
TAKEN_IN, CLAIMED, STORED, DRAWN = "taking it in", "claiming it", "storing the grade", "drawing its plots"
_GRADING = ("trials, in the worker", "judging", "program and responder, their processes")
#: Costs per worker, not per submission.
STARTS = ("start of the clean processes with their imports, once",)
Made = TypeVar("Made")


@dataclass(slots=True)
class Costs:
    """CPU seconds of each part of grading one short submission, one value per repetition."""

    parts: dict[str, list[float]] = field(default_factory=dict)

    def take(self, part: str, seconds: float) -> None:
        self.parts.setdefault(part, []).append(seconds)

    def measure_part(self, part: str, work: Callable[[], Made]) -> Made:
        start = time.process_time()
        result = work()
        self.take(part, time.process_time() - start)
        return result

    def sum_medians(self, *parts: str) -> float:
        """Return the sum of the parts' medians."""
        return sum(median(self.parts[part]) for part in parts)

    @property
    def grading(self) -> float:
        """The CPU seconds that a worker uses for one submission before it stores the marks."""
        return self.sum_medians(*_GRADING, "packing the recordings")


def main(_arguments: list[str]) -> int:
    """Print the three tables."""
    print(f"a loop of ten million additions: {measure_loop(5):.2f} s")
    _show("One trial, a line follower of 60 s", measure_trial())
    costs = measure_submission()
    warm_costs = {part: costs.sum_medians(part) for part in costs.parts if part not in STARTS}
    _show("One short submission, warm, from its files to a report", warm_costs)
    start_costs = {part: costs.sum_medians(part) for part in STARTS}
    _show("Ten of them, cold", start_costs | {part: 10 * seconds for part, seconds in warm_costs.items()})
    return 0


def measure_trial() -> Mapping[str, float]:
    """Return the CPU seconds of each of our modules in the worker, including library calls."""
    spec = build_spec(FOLLOWER)
    with TrialRunner() as runner:
        runner.run(spec)
        worker_seconds, children_seconds = [], []
        for _ in range(_TIMES):
            children_before, start = runner.children_cpu_seconds, time.process_time()
            runner.run(spec)
            worker_seconds.append(time.process_time() - start)
            children_seconds.append(runner.children_cpu_seconds - children_before)
        profile = cProfile.Profile(time.process_time)
        profile.runcall(runner.run, spec)
    shares = _sum_by_module(profile)
    worker = median(worker_seconds)
    # Profiling slows everything, so only the shares are used.
    rows = {f"worker: {name}": worker * share for name, share in shares[:_ROOMS]}
    remainder = sum(share for _, share in shares[_ROOMS:])
    return rows | {
        "worker: all other modules": worker * remainder,
        "program and responder, two children": median(children_seconds),
    }


def _sum_by_module(profile: cProfile.Profile) -> list[tuple[str, float]]:
    """Return each of our modules with its share, the largest first. Built-in functions count for their caller."""
    seconds: Counter[str] = Counter()
    for (file, _, _), (_, _, own_seconds, _, callers) in pstats.Stats(profile).stats.items():  # type: ignore[attr-defined]
        name = _find_module(file)
        if name is not None or not callers:
            seconds[name or "Python itself"] += own_seconds
            continue
        for (caller, _, _), (_, _, share, _) in callers.items():
            seconds[_find_module(caller) or "Python itself"] += share
    total = sum(seconds.values())
    return [(name, value / total) for name, value in seconds.most_common()]


def _find_module(file: str) -> str | None:
    path = Path(file)
    return str(path.relative_to(_ROOT)) if path.is_relative_to(_ROOT) and ".venv" not in path.parts else None


def measure_submission() -> Costs:
    """Return the costs of each part of grading a short submission, on SQLite, without a queue."""
    costs = Costs()
    with (
        tempfile.TemporaryDirectory() as home,
        open_store(load_settings(home=Path(home))) as store,
        TrialRunner() as runner,
    ):
        # The first run is a warm-up.
        _measure_one(store, runner, "nobody", Costs())
        for number in range(_TIMES):
            _measure_one(store, runner, f"student {number}", costs)
    costs.take(STARTS[0], _measure_cold_grading() - costs.sum_medians(*_GRADING))
    return costs


def _measure_one(store: Store, runner: TrialRunner, student: str, costs: Costs) -> None:
    request = build_short_request(student)
    costs.measure_part(TAKEN_IN, lambda: intake.accept_submission(store, request, max_attempts=3))
    claim = costs.measure_part(CLAIMED, lambda: jobs.claim_job(store, "worker", 60))
    assert claim is not None
    student_grade = _grade_in_parts(request, runner, costs)
    prepared = costs.measure_part("packing the recordings", lambda: results.prepare_grade(student_grade))
    costs.measure_part(STORED, lambda: jobs.finish_job(store, claim, prepared, datetime.now(UTC)))
    plots = costs.measure_part(DRAWN, lambda: draw_plots(student_grade, request.assignment, request.submission))
    costs.measure_part(
        "the report", lambda: render_report_page(build_student_view(student_grade), plots, request.submission)
    )


def _grade_in_parts(request: GradingRequest, runner: TrialRunner, costs: Costs) -> Grade:
    """Return the grade. Trials and judging are separated at the end of the last trial."""
    moments: list[float] = []

    def observe(_progress: GradingProgress) -> None:
        moments.append(time.process_time())

    children_before, start = runner.children_cpu_seconds, time.process_time()
    student_grade = grade(request.submission, request.assignment, observe=observe, runner=runner)
    end = time.process_time()
    trials, judging, children = _GRADING
    costs.take(trials, moments[-1] - start)
    costs.take(judging, end - moments[-1])
    costs.take(children, runner.children_cpu_seconds - children_before)
    return student_grade


def _measure_cold_grading() -> float:
    """Return the CPU seconds of a grading that starts its own processes, including those processes."""
    times_before = os.times()
    request = build_short_request("cold")
    grade(request.submission, request.assignment)
    times_after = os.times()
    return sum(times_after[:4]) - sum(times_before[:4])


def _show(title: str, parts: Mapping[str, float]) -> None:
    total = sum(parts.values())
    table = Table(title=f"{title}: {total:.3f} s", box=None, title_justify="left")
    table.add_column("part")
    for heading in ("CPU", "share"):
        table.add_column(heading, justify="right")
    for part, seconds in sorted(parts.items(), key=lambda item: -item[1]):
        table.add_row(part, f"{1000 * seconds:.1f} ms", f"{seconds / total:.0%}")
    Console(width=120).print(table)
