"""All trials of a pool, as an appeal runs them in one worker.

It measures real time, so run it on an idle machine: ``python -m benchmarks appeal``.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from benchmarks.harness.noisy_follower import POOL, PROGRAM, build_request, write_assignment
from benchmarks.measurement import SECONDS, Measurement, measure_wall_seconds
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner


def measure(_times: int) -> list[Measurement]:
    """Measure one grading of all trials, with its CPU time in all processes."""
    with tempfile.TemporaryDirectory() as folder, TrialRunner() as runner:
        request = build_request(write_assignment(Path(folder) / "noisy-follower"), "ada", PROGRAM)
        cpu_before = time.process_time() + runner.children_cpu_seconds
        seconds = measure_wall_seconds(lambda: grade(request.submission, request.assignment, runner=runner))
        cpu_seconds = time.process_time() + runner.children_cpu_seconds - cpu_before
    title = f"appeal: all {POOL} trials of a noisy line follower"
    return [Measurement(title, seconds, SECONDS, 30, details=f"CPU {cpu_seconds:.1f} s")]
