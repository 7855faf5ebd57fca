"""Definition of an assignment: world, scenarios, criteria, marks, and the resulting trials.

The classes are plain data. ``reader.py`` reads them from a folder and reports every mistake with file and line.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from types import MappingProxyType
from typing import Literal

from responders.channel import Channel
from sim.random_streams import RandomStream
from sim.recording import Pose
from submissions.assignment.limits import DEFAULT_LIMITS, Limits
from submissions.assignment.scenario import Coordinates
from submissions.assignment.scenario import Scenario as Scenario
from submissions.assignment.scenario import Visibility as Visibility
from submissions.criteria import AnyCriterion
from submissions.seeds import PUBLIC_SECRET, SeedSource, SeedTable, build_seed_table


@dataclass(frozen=True, slots=True)
class WorldSpec:
    """The world of the robot."""

    background: str = "Empty_Map"
    image: bytes | None = None  # an instructor's own floor image, as the bytes of the file
    labels: bool = True
    obstacles: tuple[tuple[float, float, float, float], ...] = ()  # x, y, width, height
    robot: str = "Default_Robot"
    robots: Literal[1, 2] = 1
    solid: bool = False  # walls and obstacles stop the robot
    drive: Literal["course", "wheels"] = "course"  # motion of the robot: the course's equations, or rigid-body wheels
    # "course": wheel noise only at positive speeds, as in the original
    noise: Literal["course", "both directions"] = "course"
    tick: Literal["thirtieth", "browser"] = "thirtieth"  # tick length: 1/30 s, or 33 ms as in the original's browser
    sheet: int | None = 0  # seed of the digits on a digit sheet; None: the seed of each trial


@dataclass(frozen=True, slots=True)
class Parts:
    """Source of each part: ``student``, ``none``, or the name of a file beside the assignment."""

    program: str = "student"
    responder: str = "student"
    cell: str = "last"  # the robot program of a notebook that is marked: ``last``, ``tag:NAME`` or a number from 1
    second_program: str = "none"  # of the second robot, if there are two; ``same`` uses the first robot's program
    agents: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))  # agents by name


@dataclass(frozen=True, slots=True)
class Training:
    """Training of a model by the submission: train on the images of ``scenarios``, classify all others.

    ``function`` is the student's ``train(images, labels)``. ``image`` selects the part of each image that it receives.
    """

    scenarios: tuple[str, ...]
    function: str = "train"
    image: Literal["focus", "whole"] = "focus"


@dataclass(frozen=True, slots=True)
class Reruns:
    """What students learn from reruns of their trials with one ingredient exchanged.

    Without ``causes``, no trials are run again. With ``halves``, the reference's parts take the place of the student's,
    to show which part loses the marks; with ``statements``, single statements and texts of the reference do, to show
    the line. ``reveals`` is the number of causes in hidden trials that one student may see; staff see all.
    """

    causes: bool = True
    halves: bool = False
    statements: bool = False
    reveals: int = 0

    @property
    def uses_reference(self) -> bool:
        """Return whether anything of the reference takes the place of the student's."""
        return self.halves or self.statements


NO_RERUNS = Reruns()
#: The random stream of the second robot's start jitter.
_SECOND_START_JITTER = "second start jitter"


@dataclass(frozen=True, slots=True)
class Trial:
    """One run of an assignment. ``pose`` is the start pose, with offset and jitter applied."""

    scenario: Scenario
    index: int  # index within the scenario
    pose: Pose
    light_noise: float
    motor_noise: float
    seed: int
    place: int  # index of the scenario's pose
    channel: Channel
    sweep: Coordinates = ()
    second_pose: Pose | None = None  # start pose of the second robot

    def redraw_start(self, seed: int) -> Trial:
        """Return the trial with the jitter of its start poses drawn from another seed; the place stays."""
        second_pose = self.second_pose
        if second_pose is not None:
            second_pose = _apply_offsets(
                self.scenario, self.scenario.second_poses[self.place], seed, _SECOND_START_JITTER
            )
        pose = _compute_start_pose(self.scenario, self.place, dict(self.sweep), seed)
        return replace(self, pose=pose, second_pose=second_pose)


@dataclass(frozen=True, slots=True)
class Assignment:
    """A frozen assignment. Assignments with the same ``version`` give the same marks."""

    id: str
    title: str
    world: WorldSpec
    parts: Parts
    scenarios: tuple[Scenario, ...]
    criteria: tuple[AnyCriterion, ...]
    limits: Limits = DEFAULT_LIMITS
    section: str = ""  # section of the course that sets the task
    description: str = ""
    given: Mapping[str, bytes] = field(default_factory=dict)  # files that are copied into the responder's folder
    given_parts: Mapping[str, str] = field(default_factory=dict)  # name -> source of a given program or responder
    version: str = ""  # SHA-256 of the assignment's folder
    training: Training | None = None
    secret: str = ""  # makes the seeds of hidden scenarios hard to guess
    reruns: Reruns = NO_RERUNS

    @property
    def max_marks(self) -> Decimal:
        """The sum of the marks of all criteria."""
        return sum((criterion.marks for criterion in self.criteria), Decimal(0))

    @property
    def trial_count(self) -> int:
        """The number of trials, computed without creating them."""
        return sum(scenario.trial_count for scenario in self.scenarios)

    @property
    def chance_criteria(self) -> tuple[AnyCriterion, ...]:
        """The criteria that are defined over a pool."""
        return tuple(criterion for criterion in self.criteria if self.find_pool(criterion) is not None)

    def find_pool(self, criterion: AnyCriterion) -> Scenario | None:
        """Return the scenario whose pool the criterion is defined over; None if there is none."""
        if not criterion.judges_runs:
            return None
        scenarios = (each for each in self.scenarios if not criterion.scenarios or each.id in criterion.scenarios)
        return next((each for each in scenarios if each.draw is not None), None)

    def trials(self, secret: SeedSource = PUBLIC_SECRET) -> Iterator[Trial]:
        """Return all trials for the installation with this secret, in a fixed order; those of a pool as drawn."""
        for scenario in self.scenarios:
            levels = list(
                itertools.product(
                    self._order_poses(scenario, secret),
                    scenario.sweep.coordinates(),
                    scenario.light_noise,
                    scenario.motor_noise,
                )
            )
            repeated_levels = [level for level in levels for _ in range(scenario.trials)]
            for index in self._order_trials(scenario, len(repeated_levels), secret):
                fixed_index, sweep, light_noise, motor_noise = repeated_levels[index]
                seed = self.seed(scenario, index, secret)
                pose_index = (
                    RandomStream(seed, "start pose").integer(0) % len(scenario.poses)
                    if fixed_index is None
                    else fixed_index
                )
                sweep_values = dict(sweep)
                yield Trial(
                    scenario,
                    index,
                    _compute_start_pose(scenario, pose_index, sweep_values, seed),
                    sweep_values.get("light_noise", light_noise),
                    sweep_values.get("motor_noise", motor_noise),
                    seed,
                    pose_index,
                    replace(
                        scenario.channel,
                        loss=sweep_values.get("loss", scenario.channel.loss),
                        delay=sweep_values.get("delay", scenario.channel.delay),
                    ),
                    sweep,
                    _apply_offsets(scenario, scenario.second_poses[pose_index], seed, _SECOND_START_JITTER)
                    if scenario.second_poses
                    else None,
                )

    def _order_trials(self, scenario: Scenario, count: int, secret: SeedSource) -> Sequence[int]:
        """Return the numbers of the scenario's trials in the order in which a grading runs them.

        The order of a pool depends on the secret and is the same for all students.
        """
        if scenario.draw is None:
            return range(count)
        chance = RandomStream(self.seed(scenario, 0, secret), "order of the pool")
        return sorted(range(count), key=chance.integer)

    def _order_poses(self, scenario: Scenario, secret: SeedSource) -> Sequence[int | None]:
        """Return the pose numbers in the order of the trials; None if each trial draws its own."""
        places = range(len(scenario.poses))
        match scenario.choose:
            case "random":
                return (None,)
            case "shuffled":
                chance = RandomStream(self.seed(scenario, 0, secret), "order of poses")
                return sorted(places, key=chance.integer)
            case "each":
                return places

    def seed(self, scenario: Scenario, index: int, secret: SeedSource = PUBLIC_SECRET) -> int:
        """Return the seed of a trial's world, the same for every student."""
        return secret.compute_seed(self._name_world(scenario, index))

    def build_seed_table(self, secret: SeedSource) -> SeedTable:
        """Return all seeds of a grading, with which another installation can repeat it."""
        names = (self._name_world(each, index) for each in self.scenarios for index in range(each.trial_count))
        return build_seed_table(secret, (self.id, *names))

    def _name_world(self, scenario: Scenario, index: int) -> str:
        assignment_secret = "" if scenario.visibility == "visible" else self.secret
        return f"{self.id}\n{scenario.id}\n{index}\n{assignment_secret}"


def _compute_start_pose(scenario: Scenario, pose_index: int, sweep_values: Mapping[str, float], seed: int) -> Pose:
    """Return the pose with this number, with the swept offsets and the trial's jitter applied."""
    offsets = [sweep_values.get(name, 0.0) for name in ("offset_x", "offset_y", "heading")]
    return _apply_offsets(scenario, scenario.poses[pose_index], seed, "start jitter", offsets)


def _apply_offsets(
    scenario: Scenario, pose: Pose, seed: int, chance: str, base_offsets: Sequence[float] = (0.0, 0.0, 0.0)
) -> Pose:
    """Return the pose with offsets and with the jitter drawn from this random stream."""
    offsets = list(base_offsets)
    if any(scenario.start_jitter):
        stream = RandomStream(seed, chance)
        for axis, maximum in enumerate(scenario.start_jitter):
            offsets[axis] += stream.between(-maximum, maximum, 0, axis)
    return Pose(pose.x + offsets[0], pose.y + offsets[1], pose.heading + offsets[2])
