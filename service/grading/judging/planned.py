"""Which of a scenario's poses a trial started from, by the assignment's own plan.

The plan is asked, not the recording: a pose that noise or a program moves is still the one it started from.
"""

from __future__ import annotations

from service.grading.grade import TrialResult
from submissions.assignment import Assignment


def pose_number(assignment: Assignment, trial: TrialResult) -> int:
    """The index of the trial's start pose in its scenario."""
    planned = next(
        planned
        for planned in assignment.trials()
        if planned.scenario.id == trial.scenario and planned.index == trial.index
    )
    return planned.place
