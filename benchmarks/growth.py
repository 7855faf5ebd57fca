"""Growth of CPU costs with students, submissions, attempts, trials, messages and simulated seconds.

Each cost is measured at four sizes. The result is the slope of its logarithm over the logarithm of the size: the
exponent, 1 for linear growth. A fixed part of a cost makes it smaller.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.graded_store import build_short_request
from benchmarks.measurement import EXPONENT, Measurement, measure_cpu_seconds
from responders.source_file import SourceFile
from service.grading.class_statistics import PASS_SHARE
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.plotting import draw_plots
from service.reports.html import render_report_page
from service.reports.view import build_student_view
from service.settings import load_settings
from service.store.batches import batch_table, class_overview, intake
from service.store.courses.hidden_names import NO_HIDDEN_NAMES
from service.store.engine import Store, open_store
from service.store.grades import results
from service.store.queue import jobs
from submissions.assignment.examples import locate_examples
from submissions.assignment.folder import REFERENCE
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission
from submissions.grading_request import GradingRequest

#: Budget of each exponent.
_MAX_EXPONENT = 1.1
_STEP, _STEPS = 4, 4
_TALKER = "import time\nfor number in range({}):\n    print('PY::' + str(number))\n    time.sleep(0.005)\n"


def measure(times: int) -> list[Measurement]:
    """Measure the growth of everything from the files to the report, each with the cost of the largest size."""
    with TrialRunner() as runner:
        grade_fully = partial(_measure_grading, runner)
        costs: Mapping[str, tuple[int, Callable[[int], float]]] = {
            "a class by its students": (4, partial(_measure_class, _prepare_grade(runner))),
            "a batch by its submissions": (4, _measure_batch),
            "a student by attempts": (4, _measure_attempts),
            "a grade by its trials": (1, lambda count: grade_fully(_build_request("echo-responder", trials=count))),
            "a grade by its messages": (50, lambda count: grade_fully(_build_talk(count))),
            "a grade by simulated seconds": (8, lambda count: grade_fully(_build_drive(count))),
        }
        return [
            _measure_exponent(f"growth: {title}", smallest, cost, times) for title, (smallest, cost) in costs.items()
        ]


def _measure_exponent(title: str, smallest: int, cost: Callable[[int], float], times: int) -> Measurement:
    sizes = [smallest * _STEP**step for step in range(_STEPS)]
    cost(smallest)
    # The minimum of each, because other load only adds to it.
    seconds = [min(cost(size) for _ in range(min(times, 3))) for size in sizes]
    exponent = fit_exponent(sizes, seconds)
    last_exponent = math.log(seconds[-1] / seconds[-2]) / math.log(_STEP)
    details = f"{sizes[0]} to {sizes[-1]}; last step {last_exponent:.2f}, {1000 * seconds[-1] / sizes[-1]:.2f} ms each"
    return Measurement(title, exponent, EXPONENT, _MAX_EXPONENT, details=details)


def fit_exponent(sizes: list[int], costs: list[float]) -> float:
    """Return the slope of the straight line through the logarithms."""
    return float(np.polyfit(np.log(sizes), np.log(costs), 1)[0])


def _build_request(name: str, program: str | None = None, **changes: Any) -> GradingRequest:
    """Return the reference submission to an assignment, with another program and one pose of a changed scenario."""
    assignment = find_assignment(name)
    submission = read_submission(locate_examples(name) / REFERENCE, required_parts=assignment.parts)
    if program is not None:
        submission = replace(submission, program=SourceFile("robot.py", program))
    scenario = replace(assignment.scenarios[0], poses=assignment.scenarios[0].poses[:1], **changes)
    limits = replace(assignment.limits, program_cpu=60, responder_cpu=60)
    return GradingRequest(submission, replace(assignment, scenarios=(scenario,), limits=limits), name)


def _build_talk(count: int) -> GradingRequest:
    return _build_request("echo-responder", _TALKER.format(count), seconds=600)


def _build_drive(seconds: int) -> GradingRequest:
    return _build_request("single-sensor-edge-follower", seconds=seconds)


def _measure_grading(runner: TrialRunner, request: GradingRequest) -> float:
    """Return the CPU seconds for marks, stored form, plots and report, with those of the students' processes."""

    def grade_and_report() -> None:
        student_grade = grade(request.submission, request.assignment, runner=runner)
        results.prepare_grade(student_grade)
        plots = draw_plots(student_grade, request.assignment, request.submission)
        render_report_page(build_student_view(student_grade), plots, request.submission)

    children_before = runner.children_cpu_seconds
    worker_seconds = measure_cpu_seconds(grade_and_report)
    return worker_seconds + runner.children_cpu_seconds - children_before


def _prepare_grade(runner: TrialRunner) -> results.PreparedGrade:
    request = build_short_request("ada")
    return results.prepare_grade(grade(request.submission, request.assignment, runner=runner))


def _with_empty_store(measure_store: Callable[[Store], float]) -> float:
    with tempfile.TemporaryDirectory() as home, open_store(load_settings(home=Path(home))) as store:
        return measure_store(store)


def _build_class(count: int) -> list[GradingRequest]:
    return [build_short_request(f"student {number}") for number in range(count)]


def _rename(request: GradingRequest, student: str) -> GradingRequest:
    return replace(request, submission=replace(request.submission, student=student))


def _measure_batch(count: int) -> float:
    """Return the CPU seconds for taking in a batch."""
    requests = _build_class(count)
    return _with_empty_store(
        lambda store: measure_cpu_seconds(
            lambda: intake.accept_batch(store, "batch", requests, [], max_attempts=3),
        )
    )


def _measure_class(prepared_grade: results.PreparedGrade, count: int) -> float:
    """Return the CPU seconds for the table and the overview of a batch whose students have all the same grade."""

    def show(store: Store, batch_id: str) -> None:
        with store.reading() as session:
            lines = tuple(batch_table.load_table_lines(session, batch_id, (), NO_HIDDEN_NAMES))
            (overview,) = class_overview.compute_overviews(session, 1, lines, PASS_SHARE, NO_HIDDEN_NAMES)
            assert overview.statistics.n == count

    def measure_store(store: Store) -> float:
        batch = intake.accept_batch(store, "batch", _build_class(count), [], max_attempts=3)
        while (claim := jobs.claim_job(store, "worker", 60)) is not None:
            jobs.finish_job(store, claim, prepared_grade, datetime.now(UTC))
        show(store, batch.id)
        return min(measure_cpu_seconds(lambda: show(store, batch.id)) for _ in range(3))

    return _with_empty_store(measure_store)


def _measure_attempts(count: int) -> float:
    """Return the CPU seconds for taking in the attempts of one student one by one."""
    requests = [_rename(request, "ada") for request in _build_class(count)]

    def submit(store: Store) -> None:
        for request in requests:
            intake.accept_submission(store, request, max_attempts=3)

    return _with_empty_store(lambda store: measure_cpu_seconds(lambda: submit(store)))
