"""What a trial depends on, as plain values: the parts of a submission, the robot on its floor, channel and seeds.

Nothing here runs; ``trial.py`` makes a recording of it.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Literal

from responders.channel import Channel
from responders.code import Code
from responders.libraries_needed import may_need_libraries
from responders.sandbox.inside.libraries import LIBRARIES
from responders.sandbox.running_child import ChildLimits
from responders.sandbox.zygote import Role
from sim.chance import Stream
from sim.floors import Floor
from sim.motion import COURSE_PHYSICS, Physics
from sim.recording import TICK, Pose
from sim.robot import Robot
from sim.world import Noise

_A_LIBRARY = re.compile(rf"\b(?:{'|'.join(LIBRARIES)})\b")
_MOST_STATEMENTS = 100_000
Preamble = Literal["none", "imports", "preloaded"]


class RanStatements:
    """Which statements of a part its processes say that they have run: file (empty: the part itself), line, column."""

    def __init__(self) -> None:
        self.places: set[tuple[str, int, int]] = set()

    def add(self, frame: Mapping[str, Any]) -> None:
        """Take note of a ``ran`` frame."""
        if len(self.places) < _MOST_STATEMENTS:
            self.places.add((frame["file"] or "", frame["line"], frame["column"]))


@dataclass(frozen=True, slots=True)
class ProgramSpec:
    """A robot program and what it may use; ``modules`` are texts that it can import, by their names.

    Which of its statements are run is noted in ``ran``, if there is one.
    """

    code: Code
    preamble: Preamble
    limits: ChildLimits
    output_bytes: int
    modules: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    ran: RanStatements | None = None

    @property
    def role(self) -> Role:
        """Its process has the libraries loaded where one is named on a line with an import."""
        texts = (self.code.text, *self.modules.values())
        lines = (line for text in texts for line in text.splitlines() if "import" in line)
        return "robot with libraries" if any(map(_A_LIBRARY.search, lines)) else "robot"


@dataclass(frozen=True, slots=True)
class ResponderSpec:
    """What answers the robot: code and the files in its folder; ``ran`` as in a ``ProgramSpec``."""

    code: Code
    files: Mapping[str, bytes]
    limits: ChildLimits
    output_bytes: int
    function: str | None = None  # the name of the responder; by the module's own choice if not given
    ran: RanStatements | None = None

    @property
    def role(self) -> Role:
        """Its process has the libraries loaded unless it surely needs none."""
        withheld = any(name.partition(".")[0] not in sys.stdlib_module_names for name in self.limits.without)
        needed = withheld or may_need_libraries(self.code.text, self.files)
        return "responder with libraries" if needed else "responder"


@dataclass(frozen=True, slots=True)
class AgentSpec(ResponderSpec):
    """What the responder and the other agents ask: an agent of the student's, or one that is ``given``."""

    given: bool = False


@dataclass(frozen=True, slots=True)
class PartnerSpec:
    """The second robot of a trial: its program, and where it starts. All else is as the first one has it.

    A program that the assignment has ``given`` may run until the time is up, and its chance is the world's: the same
    for every submission.
    """

    program: ProgramSpec
    pose: Pose
    pen_down: bool = False
    given: bool = False


@dataclass(frozen=True, slots=True)
class TrialSpec:
    """Everything a trial depends on. With ``collaborative`` and no responder, texts are answered ``pingpong``.

    With a ``partner`` there are two robots, and without a responder each has the other to talk to.
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
    child_seed: int  # of the chance that the children see; the world's is ``seed``
    pen_down: bool = False
    physics: Physics = COURSE_PHYSICS
    tick: int = TICK  # how long one lasts, units of simulated time
    agents: Mapping[str, AgentSpec] = field(default_factory=lambda: MappingProxyType({}))  # by name
    partner: PartnerSpec | None = None
    number: int = 1  # of the robot: what its program is told that it is

    def of_partner(self, partner: PartnerSpec) -> TrialSpec:
        """The same trial as the second robot has it, with chance of its own."""
        return replace(
            self,
            program=partner.program,
            pose=partner.pose,
            pen_down=partner.pen_down,
            seed=Stream(self.seed, "second robot").integer(0),
            child_seed=Stream(self.seed if partner.given else self.child_seed, "second robot").integer(1),
            partner=None,
            number=2,
        )
