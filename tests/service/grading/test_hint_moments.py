"""Hints from the moment at which a criterion failed: places beside the floor are no error."""

from __future__ import annotations

import pytest

from running import run_program
from service.grading import hint_failure_lines
from service.grading.trial_runner import TrialRunner
from sim.recording import Pose
from submissions.criteria.stopping import StopOn


@pytest.mark.parametrize(
    ("place", "known"), [((300.0, 500.0), True), ((-40.0, 500.0), False), ((300.0, 9000.0), False)]
)
def test_a_required_place_may_lie_beside_the_floor(
    place: tuple[float, float], known: bool, runner: TrialRunner
) -> None:
    recording = run_program(runner, "tank_drive.on_for_seconds(10, 10, 0.1)", Pose(300, 500, 0))
    criterion = StopOn.model_construct(near=place)
    assert bool(hint_failure_lines._describe_required_reading(criterion, recording)) is known
