"""Ten short submissions with reports from a cold start: service start, grading, plots, reports and shutdown.

For comparison, nbgrader grades ten trivial notebooks without simulation and reports. It is not part of this project:
install it in a separate virtual environment outside the checkout, and set ``NBGRADER`` to its command.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.commands import ROBOMARK
from benchmarks.measurement import RATIO, SECONDS, Measurement, build_user_environment, measure_wall_seconds, median
from submissions.assignment.examples import locate_examples
from submissions.assignment.folder import REFERENCE

_ASSIGNMENT = "echo-responder"
_SUBMISSIONS = 10
_MAX_REPETITIONS = 3
_WHAT = "ten short submissions, cold batch with reports, wall"
NBGRADER = os.environ.get("NBGRADER", "")


def measure(times: int) -> list[Measurement]:
    """Measure the wall time, and its ratio to nbgrader's if that is available."""
    count = min(times, _MAX_REPETITIONS)
    if not NBGRADER:
        # The first run compiles bytecode.
        _measure_cold_batch()
        seconds = median([_measure_cold_batch() for _ in range(count)])
        return [Measurement(_WHAT, seconds, SECONDS, details="against nbgrader: n/a, name its command in NBGRADER")]
    with tempfile.TemporaryDirectory() as folder:
        course = Path(folder)
        _create_course(course)
        _measure_cold_batch()
        robomark_seconds, nbgrader_seconds = zip(
            *((_measure_cold_batch(), _autograde(course)) for _ in range(count)), strict=True
        )
    return [
        Measurement(_WHAT, median(robomark_seconds), SECONDS),
        Measurement(
            f"{_WHAT} against nbgrader's ten notebooks",
            median(robomark_seconds) / median(nbgrader_seconds),
            RATIO,
            1 / 3,
            1 / 6,
            details=f"{median(robomark_seconds):.1f} s against {median(nbgrader_seconds):.1f} s",
        ),
    ]


def _measure_cold_batch() -> float:
    with tempfile.TemporaryDirectory() as folder:
        home, batch, reports = (Path(folder) / name for name in ("home", "batch", "reports"))
        for number in range(_SUBMISSIONS):
            submission = batch / f"student{number}"
            shutil.copytree(locate_examples(_ASSIGNMENT) / REFERENCE, submission)
            # Each text differs, because identical submissions are graded only once.
            (submission / "robot.py").write_text(f"# {number}\n" + (submission / "robot.py").read_text())
        command = [*ROBOMARK, "batch", "submit", str(batch), "-a", _ASSIGNMENT, "--output", str(reports)]
        environment = build_user_environment() | {"ROBOMARK_HOME": str(home)}
        return measure_wall_seconds(lambda: subprocess.run(command, env=environment, check=True, capture_output=True))


def _create_course(course: Path) -> None:
    """Create an nbgrader course with one assignment and ten submitted notebooks."""
    source = course / "source" / "ps1"
    source.mkdir(parents=True)
    (source / "p1.ipynb").write_text(json.dumps(_build_notebook()))
    _run_nbgrader(course, "generate_assignment", "ps1")
    for number in range(_SUBMISSIONS):
        shutil.copytree(course / "release" / "ps1", course / "submitted" / f"student{number}" / "ps1")


def _build_notebook() -> Mapping[str, Any]:
    solution = {"grade": False, "grade_id": "twice", "locked": False, "schema_version": 3, "solution": True}
    test = {"grade": True, "grade_id": "test", "locked": True, "points": 1, "schema_version": 3, "solution": False}
    texts = (("def twice(x):\n    return 2 * x", solution), ("assert twice(2) == 4", test))
    cells = [
        {
            "cell_type": "code",
            "execution_count": None,
            "id": told["grade_id"],
            "metadata": {"nbgrader": {"task": False, **told}},
            "outputs": [],
            "source": text,
        }
        for text, told in texts
    ]
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}


def _autograde(course: Path) -> float:
    shutil.rmtree(course / "autograded", ignore_errors=True)
    return measure_wall_seconds(lambda: _run_nbgrader(course, "autograde", "ps1", "--force"))


def _run_nbgrader(course: Path, *words: str) -> None:
    # nbgrader calls programs from its own environment.
    path = f"{Path(NBGRADER).parent}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PATH": path}
    result = subprocess.run(
        [NBGRADER, *words], cwd=course, env=environment, capture_output=True, text=True, check=False
    )
    if result.returncode:
        raise RuntimeError(f"nbgrader {' '.join(words)} ends with {result.returncode}: {result.stderr[-1000:]}")
