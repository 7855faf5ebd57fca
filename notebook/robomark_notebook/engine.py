"""The interface of an engine: what a notebook asks Robomark for, and what it gets back.

``local_engine.py`` asks a ``robomark`` command on this machine, ``server_engine.py`` the API of a server.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

#: The state of the simulator's page between magics: floor, robot, pose, noise. Only an engine reads or changes it.
Page = Mapping[str, Any]


class EngineError(Exception):
    """A mistake by the caller, or an engine that cannot be reached. The message is for the student."""


@dataclass(frozen=True, slots=True)
class MagicCall:
    """A call of a ``sim_magic`` magic: its cell (counted from 1), name and flags. A cell magic has a robot program."""

    cell: int
    name: str
    arguments: str
    body: str | None


@dataclass(frozen=True, slots=True)
class Question:
    """A text from the robot to the responder, with what the robot has logged since the last one.

    ``t`` is in seconds of simulated time. ``data`` holds (name, value, time); ``images`` hold texts as the course's kit
    stores them: side, RGBA numbers, tick.
    """

    number: int
    t: float
    text: str
    data: tuple[tuple[str, float, float], ...] = ()
    images: tuple[str, ...] = ()


#: Returns the responder's answer to a question, or None for no answer.
Answerer = Callable[[Question], str | None]


@dataclass(frozen=True, slots=True)
class RunFault:
    """An error of a run: whose it is, where, what, and what may help."""

    who: str
    place: str
    message: str
    hint: str


@dataclass(frozen=True, slots=True)
class RobotRun:
    """The result of one run of the robot. ``sha256`` is the recording's hash, as ``robomark run`` prints it.

    ``lines`` are (seconds, text) of what was printed, said and sent. ``data`` is everything logged, ``images`` as in a
    question. ``replay`` is the document that the replay component plays.
    """

    sha256: str
    verdict: str
    seconds: float
    happened: str
    lines: tuple[tuple[float, str], ...]
    faults: tuple[RunFault, ...]
    data: tuple[tuple[str, float, float], ...]
    images: tuple[str, ...]
    replay: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class MagicResult:
    """The result of a magic: the new page, notes about its flags, and the run that it started, if any."""

    page: Page
    notes: tuple[str, ...]
    run: RobotRun | None


@dataclass(frozen=True, slots=True)
class CheckedCriterion:
    """One criterion of a check: its title, what was found, and the marks. ``moment`` is a place in the replay."""

    title: str
    found: str
    marks: str
    out_of: str
    passed: bool
    moment: tuple[int, float] | None = None  # trial (from 0), seconds


@dataclass(frozen=True, slots=True)
class Check:
    """The report of a notebook against the visible scenarios of an assignment, or of a submission."""

    title: str
    happened: str
    marks: str
    out_of: str
    criteria: tuple[CheckedCriterion, ...]
    next_steps: tuple[str, ...]
    notes: tuple[str, ...]
    replay: Mapping[str, Any] | None


@dataclass(frozen=True, slots=True)
class Submitted:
    """A submission on a server: its receipt, its place in the queue, and its report when there is one."""

    receipt: str
    before: int | None
    check: Check | None
    url: str


class Engine(Protocol):
    """Runs robots and checks notebooks. Every method may raise ``EngineError``."""

    #: The seed of everything random in the runs, a whole number from 0; 0 at first.
    seed: int

    def call_magic(self, call: MagicCall, page: Page | None, answer: Answerer) -> MagicResult:
        """Apply a magic's flags to the page (None: a new page), and run the robot if it starts one."""

    def check(self, assignment: str, name: str, notebook: bytes, files: Mapping[str, bytes]) -> Check:
        """Grade a notebook, with the files beside it, in the visible scenarios of an assignment."""

    def submit(self, assignment: str, name: str, notebook: bytes, files: Mapping[str, bytes]) -> Submitted:
        """Submit a notebook to the course. Only a server takes submissions."""

    def follow(self, submitted: Submitted) -> Submitted:
        """Return the newer state of a submission."""

    def close(self) -> None:
        """End the engine and every run."""
