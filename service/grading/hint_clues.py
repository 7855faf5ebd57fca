"""What hints are looked for in: the texts of a submission line by line, and what its visible trials have shown.

Student code is split into tokens and searched here, and never parsed, so that no text costs more than its length.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass, replace
from functools import cached_property

from service.grading.grade import CriterionResult, TrialResult
from service.grading.hint_code import CodeStatements, read_code
from service.grading.run_plan import RunPlan
from sim.recorded import faults_of, stood_still
from sim.recording import Fault, Message, Recording
from submissions.criteria import Criterion
from submissions.raw_files import shown
from submissions.source_text import is_program_magic, magic_place
from submissions.submission import PART_FILES, SECOND_PROGRAM, Part, Submission

_MOST_LINES, _LONGEST_LINE = 5000, 300
_MOST_TEXTS, LONGEST_TEXT = 400, 300
_MOST_BESIDE = 20
_QUEUE = re.compile("pyState")


@dataclass(frozen=True)
class Listing:
    """One text of the student's: a file, or a cell of a notebook, which is nobody's part."""

    name: str
    part: Part | None
    lines: tuple[str, ...]

    @cached_property
    def code(self) -> CodeStatements:
        """Its statements; split into tokens when a hint first looks at them."""
        return read_code(self.lines)

    @cached_property
    def magic_place(self) -> int | None:
        """The index of its magic line."""
        return magic_place("\n".join(self.lines))

    @property
    def runs_robot(self) -> bool:
        """Whether it is a cell with a robot program."""
        return self.magic_place is not None and is_program_magic(self.lines[self.magic_place])

    def find(self, pattern: re.Pattern[str], start: int = 0) -> int | None:
        """The number, from 1, of the first line after ``start`` that has it."""
        return next((n for n, line in enumerate(self.lines[start:], start + 1) if pattern.search(line)), None)

    def at(self, line: int | None) -> str:
        """``line 3 of robot.py``, or its name where no line is known."""
        return self.name if line is None else f"line {line} of {self.name}"


@dataclass(frozen=True, slots=True)
class Clues:
    """``lost`` are the criteria that are shown and have not all their marks; ``missing`` is a part.

    ``messages`` are what the student is told of each lost criterion, by its id; ``results`` are the lost ones.
    ``limit`` is the simulated time of the shortest visible scenario, in seconds. ``task`` is the description.
    ``beside`` are the Python files beside the parts, agents among them. ``marked_cell`` is the one robot cell that is
    run by itself, ``ignored_magic`` why its magic line is ignored, ``idle_responder`` the first line of a Raw cell with
    a responder. ``assignment`` is the id.
    """

    listings: tuple[Listing, ...]
    recordings: tuple[Recording, ...]
    lost: tuple[Criterion, ...]
    files: tuple[str, ...]
    missing: Part | None
    preamble: str
    collaborative: bool
    results: tuple[CriterionResult, ...] = ()
    limit: float = 0.0
    task: str = ""
    beside: tuple[Listing, ...] = ()
    marked_cell: int | None = None
    ignored_magic: str = ""
    idle_responder: str = ""
    agents: frozenset[str] = frozenset()
    assignment: str = ""

    @property
    def cell_errors(self) -> tuple[Fault, ...]:
        """The cells of a notebook that failed, in the first trial that has some."""
        return next((each.cell_errors for each in self.recordings if each.cell_errors), ())

    @property
    def programs(self) -> Iterator[Listing]:
        """The texts that are robot programs: files, and cells that begin with a magic of the simulator."""
        return (each for each in self.listings if each.part == "program" or (each.part is None and each.runs_robot))

    @property
    def responders(self) -> Iterator[Listing]:
        """The texts that are no robot programs."""
        programs = {each.name for each in self.programs}
        return (each for each in self.of("responder") if each.name not in programs)

    @property
    def answering(self) -> Iterator[Listing]:
        """The texts that run with the responder: its own, and the agents'."""
        yield from self.responders
        yield from self.beside

    @property
    def texts(self) -> tuple[Listing, ...]:
        """All texts of the submission."""
        return (*self.listings, *self.beside)

    @property
    def wants_queue(self) -> bool:
        """Whether anything is asked of objects, or the program looks for some."""
        asked = any(
            getattr(each, "is_json", False) or getattr(each, "path", None) or getattr(each, "json_queue", False)
            for each in self.lost
        )
        return asked or any(listing.find(_QUEUE) for listing in self.of("program"))

    @property
    def stood_still(self) -> bool:
        """Whether no robot moved in any trial that is shown."""
        return bool(self.recordings) and all(map(stood_still, self.recordings))

    @property
    def seconds(self) -> float:
        """How long the longest trial that is shown lasted."""
        return max((each.end_t for each in self.recordings), default=0.0)

    @property
    def faults(self) -> Iterator[Fault]:
        """Of all trials that are looked at, the earliest of each first."""
        return (fault for recording in self.recordings for fault in faults_of(recording)[:3])

    @property
    def printed(self) -> tuple[str, ...]:
        """The different texts that programs printed."""
        return _different(line.text for recording in self.recordings for line in recording.printed)

    @property
    def spoken(self) -> tuple[str, ...]:
        """The different texts that robots said."""
        return _different(line.text for recording in self.recordings for line in recording.spoken)

    @property
    def messages(self) -> Iterator[Message]:
        """All texts that crossed the bridge."""
        return (message for recording in self.recordings for message in recording.messages)

    @property
    def sent(self) -> tuple[str, ...]:
        """The different texts that robots sent."""
        return self._messages("robot")

    @property
    def answers(self) -> tuple[str, ...]:
        """The different texts that the responder answered."""
        return self._messages("responder")

    def of(self, part: Part) -> Iterator[Listing]:
        """The texts that the part may be in."""
        return (each for each in self.listings if each.part in (part, None))

    def where(self, part: Part, pattern: re.Pattern[str]) -> str:
        """``line 3 of robot.py``: the first line that has it; the part's file where none has."""
        for listing in self.of(part):
            line = listing.find(pattern)
            if line is not None:
                return listing.at(line)
        return PART_FILES[part] if any(each.part == part for each in self.listings) else "the notebook"

    def _messages(self, sender: str) -> tuple[str, ...]:
        return _different(
            message.text for recording in self.recordings for message in recording.messages if message.sender == sender
        )


def clues_of(
    submission: Submission, plan: RunPlan, trials: Sequence[TrialResult], results: Sequence[CriterionResult]
) -> Clues:
    """Only what the student may see before anything is published."""
    lost = {each.id for each in results if each.visibility == "visible" and each.marks < each.max_marks}
    visible = (trial.recording for trial in trials if trial.visibility == "visible")
    recordings = [each for first in visible for each in (first, first.partner) if each is not None]
    seen = {index for index, trial in enumerate(trials) if trial.visibility == "visible"}
    return Clues(
        tuple(_listings(submission, plan.assignment.world.robots)),
        tuple(recordings),
        tuple(each for each in plan.assignment.criteria if each.id in lost),
        tuple(submission.files),
        plan.missing,
        plan.flags.preamble,
        plan.collaborative,
        tuple(_as_shown(each, seen) for each in results if each.id in lost),
        min((each.seconds for each in plan.assignment.scenarios if each.visibility == "visible"), default=0.0),
        plan.assignment.description,
        tuple(_beside(submission)),
        getattr(plan.trial, "cell", None),
        plan.ignored_magic,
        submission.notebook.raw_responders[0] if submission.notebook and submission.notebook.raw_responders else "",
        frozenset(plan.agents),
        plan.assignment.id,
    )


def _as_shown(result: CriterionResult, seen: Set[int]) -> CriterionResult:
    """The result without all that hidden trials have told."""
    evidence = tuple(each for each in result.evidence if each.trial in seen)
    if len(evidence) == len(result.evidence):
        return result
    told = " ".join(each.message for each in evidence if not each.passed)
    accuracy = result.shown.accuracy if result.shown is not None else None
    return replace(result, evidence=evidence, message=told, accuracy=accuracy, predictions=(), curves=(), shown=None)


def _listings(submission: Submission, robots: int) -> Iterator[Listing]:
    if submission.program is not None:
        yield _listing("robot.py", "program", submission.program.text)
    if submission.responder is not None:
        yield _listing("responder.py", "responder", submission.responder.text)
    second = submission.code(SECOND_PROGRAM) if robots == 2 else None
    if second is not None:
        yield _listing(SECOND_PROGRAM, "program", second.text)
    for cell in submission.notebook.cells if submission.notebook is not None else ():
        yield _listing(f"cell {cell.number}", None, cell.source)


def _beside(submission: Submission) -> Iterator[Listing]:
    for name in [each for each in sorted(submission.files) if each.endswith(".py")][:_MOST_BESIDE]:
        if name in submission.python_files:
            yield _listing(name, None, submission.python_files[name].text)


def _listing(name: str, part: Part | None, text: str) -> Listing:
    lines = tuple(line[:_LONGEST_LINE].rstrip("\r") for line in text.split("\n", _MOST_LINES)[:_MOST_LINES])
    return Listing(name, part, lines)


def _different(texts: Iterator[str]) -> tuple[str, ...]:
    found: dict[str, None] = {}
    for text in texts:
        found[text[:LONGEST_TEXT]] = None
        if len(found) == _MOST_TEXTS:
            break
    return tuple(found)


def listing_of(fault: Fault, clues: Clues) -> Listing | None:
    """The text that a fault is in; None where that is no text of the student's."""
    name = name_of(fault)
    return next((each for each in clues.texts if each.name == name), None)


def place_of(fault: Fault, clues: Clues) -> str:
    """``line 3 of robot.py``, where a fault is; empty where that is no text of the student's."""
    name = name_of(fault)
    listing = listing_of(fault, clues) or Listing(shown(name), None, ())
    return listing.at(fault.line) if listing.lines or name in clues.files else ""


def name_of(fault: Fault) -> str:
    """What the text that a fault is in is called."""
    if fault.file:
        return fault.file
    if fault.cell is not None:
        return f"cell {fault.cell}"
    parts = {"program": "robot.py", "responder": "responder.py", "second program": SECOND_PROGRAM}
    return f"{fault.agent}.py" if fault.agent else parts.get(fault.who, "")
