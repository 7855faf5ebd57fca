"""An assignment: the world, the scenarios, what is marked and by how much; and the trials it asks for.

Plain data. Reading one from its folder, with every mistake named by file and line, is ``assignment_file.py``.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from typing import Literal

from sim.chance import Stream
from sim.recording import Pose
from submissions.criteria import Criterion

Visibility = Literal["visible", "hidden", "after_due_date", "after_published"]


@dataclass(frozen=True, slots=True)
class WorldSpec:
    """What the robot is put into."""

    background: str = "Empty_Map"
    picture: bytes | None = None  # a floor picture of the instructor's own, as the bytes of the file
    labels: bool = True
    obstacles: tuple[tuple[float, float, float, float], ...] = ()  # x, y, width, height
    robot: str = "Default_Robot"


@dataclass(frozen=True, slots=True)
class Parts:
    """Who writes what: ``student``, ``none``, or the name of a file given beside the assignment."""

    program: str = "student"
    responder: str = "student"


@dataclass(frozen=True, slots=True)
class ChannelSpec:
    """How messages travel: seconds, and chances between 0 and 1."""

    delay: float = 0.1
    jitter: float = 0.0
    loss: float = 0.0
    duplication: float = 0.0
    reordering: float = 0.0


@dataclass(frozen=True, slots=True)
class Scenario:
    """Poses x noise levels x seeds; ``choose = "random"`` draws one pose a trial, by the trial's seed."""

    id: str
    poses: tuple[Pose, ...]
    title: str = ""
    choose: Literal["each", "random"] = "each"
    trials: int = 1
    seconds: float = 60.0
    light_noise: tuple[float, ...] = (0.0,)
    motor_noise: tuple[float, ...] = (0.0,)
    channel: ChannelSpec = ChannelSpec()
    visibility: Visibility = "visible"


@dataclass(frozen=True, slots=True)
class Limits:
    """What a trial may use, for each child: CPU seconds, MB, bytes of output."""

    program_cpu: float = 5.0
    responder_cpu: float = 10.0
    program_memory_mb: int = 128
    responder_memory_mb: int = 512
    output_bytes: int = 1_000_000


@dataclass(frozen=True, slots=True)
class Trial:
    """One run that an assignment asks for."""

    scenario: Scenario
    index: int  # counts within the scenario
    pose: Pose
    light_noise: float
    motor_noise: float
    seed: int


@dataclass(frozen=True, slots=True)
class Assignment:
    """Frozen by its content: two assignments with the same ``version`` mark alike."""

    id: str
    title: str
    world: WorldSpec
    parts: Parts
    scenarios: tuple[Scenario, ...]
    criteria: tuple[Criterion, ...]
    limits: Limits = Limits()
    section: str = ""  # where in the course's materials the task is set
    description: str = ""
    given: Mapping[str, bytes] = field(default_factory=dict)  # files copied into the responder's folder
    given_parts: Mapping[str, str] = field(default_factory=dict)  # name -> source of a given program or responder
    version: str = ""  # SHA-256 of the assignment's folder
    secret: str = ""  # keeps the seeds of hidden scenarios from being guessed

    @property
    def max_marks(self) -> Decimal:
        return sum((criterion.marks for criterion in self.criteria), Decimal(0))

    def trials(self) -> Iterator[Trial]:
        """Every trial, in an order that never changes."""
        for scenario in self.scenarios:
            index = 0
            poses = scenario.poses if scenario.choose == "each" else (None,)
            for fixed in poses:
                for light_noise in scenario.light_noise:
                    for motor_noise in scenario.motor_noise:
                        for _ in range(scenario.trials):
                            seed = self.seed(scenario, index)
                            draw = Stream(seed, "start pose").integer(0) % len(scenario.poses)
                            pose = fixed or scenario.poses[draw]
                            yield Trial(scenario, index, pose, light_noise, motor_noise, seed)
                            index += 1

    def seed(self, scenario: Scenario, index: int) -> int:
        """63 bits, the same for every student."""
        secret = "" if scenario.visibility == "visible" else self.secret
        text = f"{self.id}\n{scenario.id}\n{index}\n{secret}"
        return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big") >> 1
