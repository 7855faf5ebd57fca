"""CPU costs of plots compared with marking, and the size and time of a report with a replay."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeVar

from benchmarks.measurement import (
    MEGABYTES,
    RATIO,
    SECONDS,
    Measurement,
    measure_cpu_seconds,
    measure_wall_seconds,
    median,
)
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.plotting import draw_plots
from service.reports.html import render_report_page
from service.reports.view import build_student_view
from submissions.assignment.examples import locate_examples
from submissions.assignment.folder import REFERENCE
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission
from submissions.grading_request import GradingRequest

#: The assignments, with descriptions. The last one drives for 60 s, and its report is measured too.
_FOLLOWER = "single-sensor-edge-follower"
_ASSIGNMENTS = ("echo-responder", "shape-recognition", _FOLLOWER)
Made = TypeVar("Made")


def measure(times: int) -> list[Measurement]:
    """Measure the reference submissions, after a warm-up."""
    with TrialRunner() as runner:
        rows = [_compare_with_marking(name, runner, times) for name in _ASSIGNMENTS]
        return [*rows, *_measure_report(_build_request(_FOLLOWER), runner, times)]


def _build_request(name: str) -> GradingRequest:
    assignment = find_assignment(name)
    submission = read_submission(locate_examples(name) / REFERENCE, required_parts=assignment.parts)
    return GradingRequest(submission, assignment, name)


def _compare_with_marking(name: str, runner: TrialRunner, times: int) -> Measurement:
    request = _build_request(name)
    student_grade = _grade_request(request, runner)
    plots = draw_plots(student_grade, request.assignment, request.submission)
    marking_seconds = [_measure_marking(request, runner) for _ in range(times)]
    drawing_seconds = [
        measure_cpu_seconds(partial(draw_plots, student_grade, request.assignment, request.submission))
        for _ in range(times)
    ]
    return Measurement(
        f"plots of {name}, CPU against marking it",
        median(drawing_seconds) / median(marking_seconds),
        RATIO,
        1,
        0.3,
        f"{median(drawing_seconds):.2f} s against {median(marking_seconds):.2f} s; {len(plots)} plots, "
        f"{len(student_grade.trials)} trials",
    )


def _grade_request(request: GradingRequest, runner: TrialRunner) -> Grade:
    return grade(request.submission, request.assignment, runner=runner)


def _measure_marking(request: GradingRequest, runner: TrialRunner) -> float:
    """Return the CPU seconds of the worker and of the students' processes."""
    children_before = runner.children_cpu_seconds
    worker_seconds = measure_cpu_seconds(lambda: _grade_request(request, runner))
    return worker_seconds + runner.children_cpu_seconds - children_before


def _measure_report(request: GradingRequest, runner: TrialRunner, times: int) -> list[Measurement]:
    student_grade = _grade_request(request, runner)
    plots = draw_plots(student_grade, request.assignment, request.submission)
    page = partial(render_report_page, build_student_view(student_grade), plots, request.submission)
    size = len(_warm_up(page).encode())
    seconds = median([measure_wall_seconds(page) for _ in range(times)])
    trials = f"{len(student_grade.trials)} trials of at most 60 s"
    return [
        Measurement("report with a replay of 60 s", size / 1e6, MEGABYTES, 1, 0.4, trials),
        Measurement("the same, until it is ready", seconds, SECONDS, 1),
    ]


def _warm_up(build: Callable[[], Made]) -> Made:
    build()
    return build()
