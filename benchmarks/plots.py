"""CPU costs of plots compared with marking, and the size and time of a report with a replay."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeVar

from benchmarks.measurement import MEGABYTES, RATIO, SECONDS, Measurement, cpu_seconds, median, wall_seconds
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.plotting import draw
from service.reports.html import report
from service.reports.view import student_view
from submissions.assignment.examples import examples
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
        rows = [_against_marking(name, runner, times) for name in _ASSIGNMENTS]
        return [*rows, *_of_report(_asked(_FOLLOWER), runner, times)]


def _asked(name: str) -> GradingRequest:
    assignment = find_assignment(name)
    submission = read_submission(examples(name) / REFERENCE, asked=assignment.parts)
    return GradingRequest(submission, assignment, name)


def _against_marking(name: str, runner: TrialRunner, times: int) -> Measurement:
    asked = _asked(name)
    graded = _marked(asked, runner)
    plots = draw(graded, asked.assignment, asked.submission)
    marking = [_marking_seconds(asked, runner) for _ in range(times)]
    drawing = [cpu_seconds(partial(draw, graded, asked.assignment, asked.submission)) for _ in range(times)]
    return Measurement(
        f"plots of {name}, CPU against marking it",
        median(drawing) / median(marking),
        RATIO,
        1,
        0.3,
        f"{median(drawing):.2f} s against {median(marking):.2f} s; {len(plots)} plots, {len(graded.trials)} trials",
    )


def _marked(asked: GradingRequest, runner: TrialRunner) -> Grade:
    return grade(asked.submission, asked.assignment, runner=runner)


def _marking_seconds(asked: GradingRequest, runner: TrialRunner) -> float:
    """Return the CPU seconds of the worker and of the students' processes."""
    before = runner.children_cpu_seconds
    own = cpu_seconds(lambda: _marked(asked, runner))
    return own + runner.children_cpu_seconds - before


def _of_report(asked: GradingRequest, runner: TrialRunner, times: int) -> list[Measurement]:
    graded = _marked(asked, runner)
    drawn = draw(graded, asked.assignment, asked.submission)
    page = partial(report, student_view(graded), drawn, asked.submission)
    size = len(_warm(page).encode())
    seconds = median([wall_seconds(page) for _ in range(times)])
    trials = f"{len(graded.trials)} trials of at most 60 s"
    return [
        Measurement("report with a replay of 60 s", size / 1e6, MEGABYTES, 1, 0.4, trials),
        Measurement("the same, until it is ready", seconds, SECONDS, 1),
    ]


def _warm(made: Callable[[], Made]) -> Made:
    made()
    return made()
