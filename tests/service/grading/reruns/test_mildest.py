"""The mildest conditions with which a trial fails."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal
from types import SimpleNamespace
from typing import Any, cast

import pytest

from judging import recorded
from service.grading.reruns.engine import Rerun, RerunOutcome
from service.grading.reruns.exchanges import Exchange, WithoutChannelEffect, WithoutLightNoise, WithoutMessageLoss
from service.grading.reruns.mildest import Conditions, ScaledConditions, find_mildest_failure, remove_conditions
from sim.recording import Pose

pytestmark = pytest.mark.fast

HARD = Conditions(16.0, 20.0, 0.4, Pose(500, 800, 350))
EASY = replace(HARD, light_noise=0.0)


class Engine:
    """An engine whose trial fails from some light noise on, and that counts its runs."""

    def __init__(self, fails_from: float) -> None:
        self.fails_from = fails_from
        self.runs = 0
        channel = SimpleNamespace(loss=HARD.loss)
        trial = SimpleNamespace(light_noise=16.0, motor_noise=20.0, channel=channel, pose=HARD.pose)
        self.trials = {3: trial}

    def rerun(self, trials: Sequence[int], exchanges: Sequence[Exchange]) -> Rerun:
        self.runs += 1
        (exchange,) = exchanges
        assert isinstance(exchange, ScaledConditions)
        failed = frozenset(trials) if exchange.conditions.light_noise >= self.fails_from else frozenset()
        outcome = RerunOutcome(Decimal(0), Decimal(4), frozenset(trials) - failed, failed, frozenset(trials), False)
        return Rerun(tuple(exchanges), {3: recorded()}, {3: recorded()}, {"c": outcome})


@pytest.mark.parametrize(("fails_from", "levels"), [(0.5, [0, 1]), (9.5, [9, 10]), (10, [9, 10]), (16, [15, 16])])
def test_the_boundary_is_found_within_six_runs(fails_from: float, levels: list[float]) -> None:
    engine = Engine(fails_from)
    reruns = find_mildest_failure(cast(Any, engine), "c", 3, EASY)
    assert reruns is not None
    assert [cast(ScaledConditions, each.exchanges[0]).conditions.light_noise for each in reruns] == levels
    assert [each.passes("c") for each in reruns] == [True, False]
    assert engine.runs <= 6


@pytest.mark.parametrize(("fails_from", "easy", "runs"), [(0, EASY, 2), (17, EASY, 2), (1, HARD, 0)])
def test_without_a_boundary_there_is_none(fails_from: float, easy: Conditions, runs: int) -> None:
    engine = Engine(fails_from)
    assert find_mildest_failure(cast(Any, engine), "c", 3, easy) is None
    assert engine.runs == runs


def test_heading_takes_the_shorter_turn_and_both_ends_are_exact() -> None:
    easy = Conditions(0.1, 0.2, 0.3, Pose(0.1, 0.7, 10))
    assert easy.interpolate(HARD, 0) == easy
    assert easy.interpolate(HARD, 1) == HARD
    assert easy.interpolate(HARD, 0.5).pose.heading == 0


def test_only_removed_noises_and_losses_are_scaled() -> None:
    assert remove_conditions(HARD, (WithoutLightNoise(),)) == EASY
    assert remove_conditions(HARD, (WithoutMessageLoss(),)) == replace(HARD, loss=0.0)
    assert remove_conditions(HARD, (WithoutLightNoise(), WithoutChannelEffect("jitter"))) is None
