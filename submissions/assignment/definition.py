"""An assignment: the world, the scenarios, what is marked and by how much; and the trials it asks for.

Plain data. Reading one from its folder, with every mistake named by file and line, is ``reader.py``.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from types import MappingProxyType
from typing import Literal

from responders.channel import Channel
from sim.chance import Stream
from sim.recording import Pose
from submissions.criteria import AnyCriterion
from submissions.seeds import PUBLIC, Secret, world_seed
from submissions.sweep import NO_SWEEP, Coordinates, Sweep

_USUAL_CHANNEL = Channel()

Visibility = Literal["visible", "hidden", "after_due_date", "after_published"]


@dataclass(frozen=True, slots=True)
class WorldSpec:
    """What the robot is put into."""

    background: str = "Empty_Map"
    image: bytes | None = None  # a floor image of the instructor's own, as the bytes of the file
    labels: bool = True
    obstacles: tuple[tuple[float, float, float, float], ...] = ()  # x, y, width, height
    robot: str = "Default_Robot"
    robots: Literal[1, 2] = 1
    solid: bool = False  # walls and obstacles stop the robot
    drive: Literal["course", "wheels"] = "course"  # who moves it: the course's equations, or rigid-body wheels
    noise: Literal["course", "both directions"] = "course"  # of the wheels: of positive speeds alone, or of all
    tick: Literal["thirtieth", "browser"] = "thirtieth"  # of a second, or 33 ms as in the original's browser
    sheet: int | None = 0  # the seed of the digits on a digit sheet; None: each trial's own seed


@dataclass(frozen=True, slots=True)
class Parts:
    """Who writes what: ``student``, ``none``, or the name of a file given beside the assignment."""

    program: str = "student"
    responder: str = "student"
    cell: str = "last"  # of a notebook: which robot program is marked; ``last``, ``tag:NAME`` or a number from 1
    second_program: str = "none"  # of the second robot, where there are two; ``same`` is the first one's
    agents: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))  # by name, those the responder asks


@dataclass(frozen=True, slots=True)
class Scenario:
    """Poses x swept levels x noise levels x seeds. A second robot starts from the second pose of the same number.

    ``choose = "random"`` draws one pose a trial, by the trial's seed; ``"shuffled"`` takes each once, in an order
    that the seed of the scenario decides. ``start_jitter`` moves every start by up to so many mm in x and y and
    degrees, drawn by the trial's seed.
    """

    id: str
    poses: tuple[Pose, ...]
    title: str = ""
    choose: Literal["each", "random", "shuffled"] = "each"
    trials: int = 1
    seconds: float = 60.0
    light_noise: tuple[float, ...] = (0.0,)
    motor_noise: tuple[float, ...] = (0.0,)
    channel: Channel = _USUAL_CHANNEL
    visibility: Visibility = "visible"
    start_jitter: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sweep: Sweep = NO_SWEEP
    second_poses: tuple[Pose, ...] = ()  # as many as poses, or none

    @property
    def trial_count(self) -> int:
        """Poses, swept levels, levels of noise and repetitions, multiplied."""
        poses = 1 if self.choose == "random" else len(self.poses)
        return poses * self.sweep.count * len(self.light_noise) * len(self.motor_noise) * self.trials

    def varies(self, condition: str) -> bool:
        """Whether its trials differ in a condition that can be swept; noise that is listed counts as well."""
        noises = {"light_noise": self.light_noise, "motor_noise": self.motor_noise}
        return len(getattr(self.sweep, condition) or noises.get(condition, ())) > 1


@dataclass(frozen=True, slots=True)
class Training:
    """The submission trains a model: on the images of ``scenarios``, to name those of all others.

    ``function`` is the student's ``train(images, labels)``; ``image`` says what of an image it is given.
    """

    scenarios: tuple[str, ...]
    function: str = "train"
    image: Literal["focus", "whole"] = "focus"


@dataclass(frozen=True, slots=True)
class Limits:
    """What a trial may use, for each child: CPU seconds, MB, bytes of output; and all trials of a submission together.

    ``all_cpu`` is, where none is given, enough for ten trials at their limits and a second for each.
    """

    program_cpu: float = 5.0
    responder_cpu: float = 10.0
    program_memory_mb: int = 128
    responder_memory_mb: int = 512
    output_bytes: int = 1_000_000
    all_cpu: float | None = None
    all_sleep: float = 20.0  # seconds of real time in which a process does nothing; half a second of each is free
    all_output_mb: int = 64  # of what is kept: texts, messages, images, calls

    def all_cpu_of(self, trials: int) -> float:
        """CPU seconds for ``trials`` trials together."""
        return self.all_cpu if self.all_cpu is not None else 10 * (self.program_cpu + self.responder_cpu) + trials


@dataclass(frozen=True, slots=True)
class Trial:
    """One run that an assignment asks for. ``pose`` is where the robot starts, offset and jitter included."""

    scenario: Scenario
    index: int  # counts within the scenario
    pose: Pose
    light_noise: float
    motor_noise: float
    seed: int
    place: int  # which of the scenario's poses it starts from
    channel: Channel
    sweep: Coordinates = ()
    second_pose: Pose | None = None  # of the second robot


@dataclass(frozen=True, slots=True)
class Assignment:
    """Frozen by its content: two assignments with the same ``version`` mark alike."""

    id: str
    title: str
    world: WorldSpec
    parts: Parts
    scenarios: tuple[Scenario, ...]
    criteria: tuple[AnyCriterion, ...]
    limits: Limits = Limits()
    section: str = ""  # where in the course's materials the task is set
    description: str = ""
    given: Mapping[str, bytes] = field(default_factory=dict)  # files copied into the responder's folder
    given_parts: Mapping[str, str] = field(default_factory=dict)  # name -> source of a given program or responder
    version: str = ""  # SHA-256 of the assignment's folder
    training: Training | None = None
    secret: str = ""  # keeps the seeds of hidden scenarios from being guessed

    @property
    def max_marks(self) -> Decimal:
        """The marks that all criteria together can give."""
        return sum((criterion.marks for criterion in self.criteria), Decimal(0))

    @property
    def trial_count(self) -> int:
        """How many trials there are, without making them."""
        return sum(scenario.trial_count for scenario in self.scenarios)

    def trials(self, secret: Secret = PUBLIC) -> Iterator[Trial]:
        """Every trial as the installation with this secret has it, in an order that never changes."""
        for scenario in self.scenarios:
            levels = list(
                itertools.product(
                    self._places(scenario, secret),
                    scenario.sweep.coordinates(),
                    scenario.light_noise,
                    scenario.motor_noise,
                )
            )
            repeated = (level for level in levels for _ in range(scenario.trials))
            for index, (fixed, sweep, light_noise, motor_noise) in enumerate(repeated):
                seed = self.seed(scenario, index, secret)
                place = Stream(seed, "start pose").integer(0) % len(scenario.poses) if fixed is None else fixed
                varied = dict(sweep)
                yield Trial(
                    scenario,
                    index,
                    _start(scenario, place, varied, seed),
                    varied.get("light_noise", light_noise),
                    varied.get("motor_noise", motor_noise),
                    seed,
                    place,
                    replace(
                        scenario.channel,
                        loss=varied.get("loss", scenario.channel.loss),
                        delay=varied.get("delay", scenario.channel.delay),
                    ),
                    sweep,
                    _moved(scenario, scenario.second_poses[place], seed, "second start jitter")
                    if scenario.second_poses
                    else None,
                )

    def _places(self, scenario: Scenario, secret: Secret) -> Sequence[int | None]:
        """Numbers of the poses, in the order in which they are run; None where the trial draws one itself."""
        places = range(len(scenario.poses))
        match scenario.choose:
            case "random":
                return (None,)
            case "shuffled":
                chance = Stream(self.seed(scenario, 0, secret), "order of poses")
                return sorted(places, key=chance.integer)
            case "each":
                return places

    def seed(self, scenario: Scenario, index: int, secret: Secret = PUBLIC) -> int:
        """Of the world of one trial, the same for every student."""
        own = "" if scenario.visibility == "visible" else self.secret
        return world_seed(secret, f"{self.id}\n{scenario.id}\n{index}\n{own}")


def _start(scenario: Scenario, place: int, varied: Mapping[str, float], seed: int) -> Pose:
    """The pose of that number, moved by the swept offsets and by the jitter of the trial."""
    offsets = [varied.get(name, 0.0) for name in ("offset_x", "offset_y", "heading")]
    return _moved(scenario, scenario.poses[place], seed, "start jitter", offsets)


def _moved(scenario: Scenario, pose: Pose, seed: int, chance: str, by: Sequence[float] = (0.0, 0.0, 0.0)) -> Pose:
    """The pose, moved by offsets and by the jitter that this stream of chance has for the trial."""
    offsets = list(by)
    if any(scenario.start_jitter):
        stream = Stream(seed, chance)
        for axis, most in enumerate(scenario.start_jitter):
            offsets[axis] += stream.between(-most, most, 0, axis)
    return Pose(pose.x + offsets[0], pose.y + offsets[1], pose.heading + offsets[2])
