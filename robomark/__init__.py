"""Grade and run robot programs from Python: load an assignment and a submission, grade, render a report.

Every name in ``__all__`` is stable within a minor release. Everything else in the distribution may change.
"""

from __future__ import annotations

from robomark.grading import Grader, grade, load_assignment, load_submission
from robomark.reports import render_report
from robomark.runs import read_replay, run_program
from service.grading.grade import CriterionResult, Grade, TrialResult
from service.version import GRADER_VERSION
from sim.errors import HostError, RobomarkError, UsageError
from sim.recording import Recording, Verdict
from submissions.assignment.definition import Assignment
from submissions.submission import Submission

__version__ = GRADER_VERSION

__all__ = [
    "Assignment",
    "CriterionResult",
    "Grade",
    "Grader",
    "HostError",
    "Recording",
    "RobomarkError",
    "Submission",
    "TrialResult",
    "UsageError",
    "Verdict",
    "__version__",
    "grade",
    "load_assignment",
    "load_submission",
    "read_replay",
    "render_report",
    "run_program",
]
