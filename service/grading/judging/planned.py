"""Which of a scenario's poses each trial started from, by the assignment's own plan.

The plan is asked, not the recording: a pose that noise or a program moves is still the one it started from.
"""

from __future__ import annotations

from collections.abc import Mapping

from submissions.assignment import Assignment


def pose_numbers(assignment: Assignment) -> Mapping[tuple[str, int], int]:
    """The index of each trial's start pose in its scenario, by the scenario's id and the trial's index."""
    return {(planned.scenario.id, planned.index): planned.place for planned in assignment.trials()}
