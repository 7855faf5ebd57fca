"""Luck: streams of real trials drawn again one at a time, and the figures from them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from chance import chance_assignment, chance_submission
from service.grading.grader import grade
from service.grading.reruns.engine import RerunEngine
from service.grading.reruns.exchanges import OtherDraw, OtherStart, draw_other_seed
from service.grading.reruns.luck import (
    STREAMS,
    GradedSubmission,
    LuckOptions,
    choose_spread,
    list_streams,
    measure_luck,
)
from service.grading.run_plan import plan_run
from service.grading.trial_runner import TrialRunner
from sim.recording import Recording
from submissions.seeds import PUBLIC_SECRET


@pytest.fixture(scope="module")
def graded(runner: TrialRunner) -> tuple[GradedSubmission, GradedSubmission]:
    """Return a submission whose marks depend on the light noise, and one whose marks do not."""
    assignment = chance_assignment()
    guessing, constant = (
        GradedSubmission(grade(each, assignment, runner=runner), each, assignment, PUBLIC_SECRET)
        for each in (chance_submission("ada", guesses=True), chance_submission("bob", guesses=False))
    )
    return guessing, constant


def differences(one: Recording, other: Recording) -> set[str]:
    """Return the streams whose effects differ; the light sensors also see another floor from another start."""
    names = set()
    if one.start != other.start:
        names.add("start pose")
    if not np.array_equal(one.ticks.left_position, other.ticks.left_position):
        names.add("motor noise")
    if not np.array_equal(one.ticks.left_sums, other.ticks.left_sums):
        names.add("light noise")
    if [each.delivered is None for each in one.messages] != [each.delivered is None for each in other.messages]:
        names.add("messages")
    return names


def test_one_stream_is_drawn_again_and_the_others_stay(
    runner: TrialRunner, graded: tuple[GradedSubmission, GradedSubmission]
) -> None:
    _, constant = graded
    engine = RerunEngine(runner, plan_run(constant.submission, constant.assignment), constant.grade)
    assert list_streams(engine) == STREAMS
    original = engine.results[0].recording
    for stream in ("light noise", "motor noise", "messages"):
        assert differences(original, engine.rerun((0,), (OtherDraw(stream, 1),)).recordings[0]) == {stream}
    trial = engine.trials[0]
    moved = trial.redraw_start(draw_other_seed(trial.seed, "start pose", 1))
    start = OtherStart(1, {trial.seed: (moved.pose, None)})
    assert differences(original, engine.rerun((0,), (start,)).recordings[0]) == {"start pose"}
    assert abs(moved.pose.x - trial.scenario.poses[0].x) <= 5
    assert trial.redraw_start(trial.seed) == trial


def test_the_stream_that_decides_explains_the_whole_spread(
    runner: TrialRunner, graded: tuple[GradedSubmission, GradedSubmission]
) -> None:
    assignment = chance_assignment()
    loaders = [lambda each=each: each for each in (*graded, None)]
    report = measure_luck(assignment, loaders, runner, LuckOptions(draws=2))
    assert (report.submissions, report.draws, report.planned_draws, report.unrepeatable) == (2, 4, 4, 1)
    assert report.streams == STREAMS
    says, ends = report.criteria
    assert {each.stream: each.share for each in says.streams} == {
        "start pose": 0,
        "light noise": 1,
        "motor noise": 0,
        "messages": 0,
    }
    assert 0 < says.deviation <= 4
    assert [each.share for each in ends.streams] == [None] * 4
    assert report.total is not None
    assert report.total.deviation == pytest.approx(says.deviation)
    alone = measure_luck(assignment, loaders[:1], runner, LuckOptions(draws=2))
    # The mean of this variance and that of the constant submission, which is 0.
    assert alone.criteria[0].deviation == pytest.approx(says.deviation * math.sqrt(2))


def test_without_cpu_time_nothing_is_claimed(
    runner: TrialRunner, graded: tuple[GradedSubmission, GradedSubmission]
) -> None:
    loaders = [lambda each=each: each for each in graded]
    report = measure_luck(chance_assignment(), loaders, runner, LuckOptions(draws=2, cpu_seconds=1e-6))
    assert (report.submissions, report.draws, report.planned_draws) == (0, 0, 4)
    assert report.criteria == ()
    assert report.total is None


def test_trials_without_chance_have_no_streams(runner: TrialRunner) -> None:
    assignment = chance_assignment()
    (scenario,) = assignment.scenarios
    quiet = replace(
        scenario,
        light_noise=(0.0,),
        motor_noise=(0.0,),
        start_jitter=(0.0, 0.0, 0.0),
        channel=replace(scenario.channel, loss=0.0),
    )
    assignment = replace(assignment, scenarios=(quiet,))
    submission = chance_submission("ada", guesses=True)
    case = GradedSubmission(grade(submission, assignment, runner=runner), submission, assignment, PUBLIC_SECRET)
    report = measure_luck(assignment, [lambda: case], runner, LuckOptions(draws=1))
    assert (report.streams, report.criteria, report.total) == ((), (), None)


@pytest.mark.parametrize(("count", "chosen"), [(1, "d"), (2, "ag"), (3, "adg"), (7, "abcdefg"), (9, "abcdefg")])
def test_the_chosen_submissions_are_spread(count: int, chosen: str) -> None:
    assert "".join(choose_spread("abcdefg", count)) == chosen
