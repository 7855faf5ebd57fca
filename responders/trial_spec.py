"""Trial specifications as plain values: parts of a submission, robot, floor, channel and seeds.

This module executes no code. ``trial.py`` turns a specification into a recording.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Literal

from responders.channel import Channel
from responders.required_libraries import may_need_libraries
from responders.sandbox.inside.libraries import LIBRARIES
from responders.sandbox.roles import ChildRole
from responders.sandbox.running_child import ChildLimits
from responders.source_file import SourceFile
from sim.floors import Floor
from sim.motion import COURSE_PHYSICS, Physics
from sim.random_streams import RandomStream
from sim.recording import TICK, Pose
from sim.robot import Robot
from sim.world import Noise

_LIBRARY_NAME = re.compile(rf"\b(?:{'|'.join(LIBRARIES)})\b")
_MAX_STATEMENTS = 100_000
Preamble = Literal["none", "imports", "preloaded"]


class ExecutedStatements:
    """The executed statements that a part's processes report: file (empty for the part itself), line, column."""

    def __init__(self) -> None:
        self.places: set[tuple[str, int, int]] = set()

    def add(self, frame: Mapping[str, Any]) -> None:
        """Add the statement of a ``ran`` frame."""
        if len(self.places) < _MAX_STATEMENTS:
            self.places.add((frame["file"] or "", frame["line"], frame["column"]))


@dataclass(frozen=True, slots=True)
class ProgramSpec:
    """A robot program and its resources. ``modules`` maps the names of importable modules to their source.

    ``executed_statements`` collects the executed statements, if given.
    """

    code: SourceFile
    preamble: Preamble
    limits: ChildLimits
    output_bytes: int
    modules: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    executed_statements: ExecutedStatements | None = None

    @property
    def role(self) -> ChildRole:
        """Return the role of the process. It has libraries loaded if an import line names one."""
        texts = (self.code.text, *self.modules.values())
        lines = (line for text in texts for line in text.splitlines() if "import" in line)
        return "robot with libraries" if any(map(_LIBRARY_NAME.search, lines)) else "robot"


@dataclass(frozen=True, slots=True)
class EarlierAnswer:
    """An answer from an earlier recording: its text, None for no answer, and the time slept before it."""

    text: str | None
    slept: int = 0  # units of simulated time


@dataclass(frozen=True, slots=True)
class ResponderSpec:
    """A responder: its code and the files in its folder. ``executed_statements`` as in ``ProgramSpec``.

    It receives every text, but its first answers are replaced by the ``earlier_answers``.
    """

    code: SourceFile
    files: Mapping[str, bytes]
    limits: ChildLimits
    output_bytes: int
    function: str | None = None  # name of the responder function; None lets the module choose
    executed_statements: ExecutedStatements | None = None
    earlier_answers: tuple[EarlierAnswer, ...] = ()

    @property
    def role(self) -> ChildRole:
        """Return the role of the process. It has libraries loaded unless the responder certainly needs none."""
        has_missing_packages = any(
            name.partition(".")[0] not in sys.stdlib_module_names for name in self.limits.excluded_modules
        )
        needs_libraries = has_missing_packages or may_need_libraries(self.code.text, self.files)
        return "responder with libraries" if needs_libraries else "responder"


@dataclass(frozen=True, slots=True)
class AgentSpec(ResponderSpec):
    """An agent that the responder and other agents can ask, written by the student or ``given``."""

    given: bool = False


@dataclass(frozen=True, slots=True)
class PartnerSpec:
    """The second robot of a trial: its program and start pose. The other settings are those of the first robot.

    A ``given`` program, from the assignment, may run until the time is up. It uses the world's seed, so that it behaves
    the same for every submission.
    """

    program: ProgramSpec
    pose: Pose
    pen_down: bool = False
    given: bool = False


@dataclass(frozen=True, slots=True)
class TrialSpec:
    """All inputs of a trial. If ``collaborative`` without a responder, ``pingpong`` answers the texts.

    With a ``partner`` there are two robots. Without a responder, they send their texts to each other.
    """

    program: ProgramSpec
    responder: ResponderSpec | None
    collaborative: bool
    floor: Floor
    robot: Robot
    pose: Pose
    noise: Noise
    channel: Channel
    seconds: float
    seed: int
    child_seed: int  # seed of the children; ``seed`` is the world's
    pen_down: bool = False
    physics: Physics = COURSE_PHYSICS
    tick: int = TICK  # duration of a tick, units of simulated time
    agents: Mapping[str, AgentSpec] = field(default_factory=lambda: MappingProxyType({}))  # by name
    partner: PartnerSpec | None = None
    number: int = 1  # the robot's number, as its program sees it
    records_lines: bool = True  # whether the recording has the lines of the program, for hints
    noise_seed: int | None = None  # seed of the noise; None: the world's
    motor_seed: int | None = None  # seed of the noise of the wheels; None: that of the other noise
    channel_seed: int | None = None  # seed of the channel; None: the world's
    never_lost: frozenset[int] = frozenset()  # numbers of texts that chance does not lose, nor their answers

    def build_partner_spec(self, partner: PartnerSpec) -> TrialSpec:
        """Return the trial as the second robot sees it, with its own seeds."""

        def derive_seed(seed: int | None) -> int | None:
            return None if seed is None else RandomStream(seed, "second robot").integer(0)

        return replace(
            self,
            program=partner.program,
            pose=partner.pose,
            pen_down=partner.pen_down,
            seed=RandomStream(self.seed, "second robot").integer(0),
            child_seed=RandomStream(self.seed if partner.given else self.child_seed, "second robot").integer(1),
            partner=None,
            number=2,
            noise_seed=derive_seed(self.noise_seed),
            motor_seed=derive_seed(self.motor_seed),
            channel_seed=derive_seed(self.channel_seed),
        )
