"""The mildest failing scenario: the smallest step from easy conditions to those of a trial at which it still fails."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from responders.trial_spec import TrialSpec
from service.grading.reruns.engine import Rerun, RerunEngine
from service.grading.reruns.exchanges import Exchange, WithoutLightNoise, WithoutMessageLoss, WithoutMotorNoise
from sim.recording import Pose
from submissions.assignment.definition import Trial

#: The search tries sixteenths of the way, so that it needs at most six runs.
STEPS = 16


@dataclass(frozen=True, slots=True)
class Conditions:
    """The conditions of a trial that can be harder or easier; noise as in ``Noise``, ``loss`` from 0 to 1."""

    light_noise: float
    motor_noise: float
    loss: float
    pose: Pose

    def interpolate(self, other: Conditions, fraction: float) -> Conditions:
        """Return the conditions at ``fraction`` of the way to ``other``; the heading takes the shorter turn."""

        def blend(start: float, end: float) -> float:
            # Without rounding errors at the end of the way.
            return end if fraction == 1 else start + (end - start) * fraction

        turn = (other.pose.heading - self.pose.heading + 180) % 360 - 180
        heading = other.pose.heading if fraction == 1 else self.pose.heading + turn * fraction
        return Conditions(
            blend(self.light_noise, other.light_noise),
            blend(self.motor_noise, other.motor_noise),
            blend(self.loss, other.loss),
            Pose(blend(self.pose.x, other.pose.x), blend(self.pose.y, other.pose.y), heading),
        )


@dataclass(frozen=True, slots=True)
class ScaledConditions:
    """Noise, message loss and start pose at ``fraction`` of the way from the ``easy`` to the ``hard`` conditions."""

    fraction: float
    easy: Conditions
    hard: Conditions
    key: str = field(init=False)

    def __post_init__(self) -> None:
        """Derive the key."""
        object.__setattr__(self, "key", f"{self.fraction:g} of the way from {self.easy} to {self.hard}")

    @property
    def conditions(self) -> Conditions:
        """The conditions of the rerun."""
        return self.easy.interpolate(self.hard, self.fraction)

    def apply(self, spec: TrialSpec) -> TrialSpec:
        """Return the trial with the ingredient replaced."""
        conditions = self.conditions
        return replace(
            spec,
            noise=replace(spec.noise, light=conditions.light_noise, motor=conditions.motor_noise),
            channel=replace(spec.channel, loss=conditions.loss),
            pose=conditions.pose,
        )


def get_conditions(trial: Trial) -> Conditions:
    """Return the conditions of a trial."""
    return Conditions(trial.light_noise, trial.motor_noise, trial.channel.loss, trial.pose)


def remove_conditions(conditions: Conditions, exchanges: Sequence[Exchange]) -> Conditions | None:
    """Return the conditions without the noises and losses that ``exchanges`` remove; None if they exchange more."""
    for exchange in exchanges:
        match exchange:
            case WithoutLightNoise():
                conditions = replace(conditions, light_noise=0.0)
            case WithoutMotorNoise():
                conditions = replace(conditions, motor_noise=0.0)
            case WithoutMessageLoss(numbers=None):
                conditions = replace(conditions, loss=0.0)
            case _:
                return None
    return conditions


def find_mildest_failure(
    engine: RerunEngine, criterion: str, trial: int, easy: Conditions
) -> tuple[Rerun, Rerun] | None:
    """Return the last rerun that passes on the way from ``easy`` to the trial's conditions, and the next, which fails.

    Returns None if the trial passes with its own conditions or does not pass with the easy ones. If it passes and fails
    in turn on the way, the result is one of these changes. Raises BudgetSpent.
    """
    hard = get_conditions(engine.trials[trial])
    if easy == hard:
        return None

    def rerun(step: int) -> Rerun:
        return engine.rerun((trial,), (ScaledConditions(step / STEPS, easy, hard),))

    passing, failing = rerun(0), rerun(STEPS)
    if not passing.passes(criterion) or not failing.loses(criterion):
        return None
    low, high = 0, STEPS
    while high - low > 1:
        middle = (low + high) // 2
        result = rerun(middle)
        if result.passes(criterion):
            low, passing = middle, result
        elif result.loses(criterion):
            high, failing = middle, result
        else:
            return None  # the criterion does not judge this rerun
    return passing, failing
