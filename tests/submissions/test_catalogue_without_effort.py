"""The catalogue gives little for submissions without effort, and nothing for a program that cannot run."""

from __future__ import annotations

import pytest

from responders.source_file import SourceFile
from service.grading.grader import grade
from service.grading.no_effort import grade_without_effort
from service.grading.trial_runner import TrialRunner
from submissions.assignment.reader import find_assignment
from submissions.submission import Submission

#: Some for each way to keep the marks low: needs, a place of reports, more calls or runs, a smaller starter.
_SAMPLE = (
    "trace-a-square",
    "follow-the-leader",
    "track-width",
    "working-days",
    "image-parser",
    "robot-counts",
    "three-greys",
)


@pytest.mark.long
@pytest.mark.parametrize("name", _SAMPLE)
def test_no_effort_earns_at_most_a_fifth(name: str, runner: TrialRunner) -> None:
    results = grade_without_effort(name, find_assignment(name), runner=runner)
    assert len(results) == 6
    assert {result.name: result.marks for result in results if result.share > 0.2} == {}


@pytest.mark.parametrize("name", ["trace-a-square", "stay-inside", "own-magic-cell"])
def test_a_program_with_a_syntax_error_earns_nothing(name: str, runner: TrialRunner) -> None:
    broken = Submission("ada", SourceFile("robot.py", "def (:\n"))
    assert grade(broken, find_assignment(name), runner=runner).marks == 0
