"""What hints are looked for in: the texts of a submission line by line, and what its visible trials have shown.

Student code is only searched here, never taken apart, so that no text of theirs costs more than its length.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from service.grading.grade import CriterionResult, TrialResult
from service.grading.run_plan import RunPlan
from sim.recorded import faults_of
from sim.recording import Fault, Recording
from submissions.assignment.second_robot import SECOND_PROGRAM, second_program_of
from submissions.criteria import Criterion
from submissions.submission import PART_FILES, Part, Submission

_MOST_LINES, _LONGEST_LINE = 5000, 300
_MOST_TEXTS, _LONGEST_TEXT = 400, 300


@dataclass(frozen=True, slots=True)
class Listing:
    """One text of the student's: a file, or a cell of a notebook, which is nobody's part."""

    name: str
    part: Part | None
    lines: tuple[str, ...]

    def find(self, pattern: re.Pattern[str], start: int = 0) -> int | None:
        """The number, from 1, of the first line after ``start`` that has it."""
        return next((n for n, line in enumerate(self.lines[start:], start + 1) if pattern.search(line)), None)

    def at(self, line: int | None) -> str:
        """``line 3 of robot.py``, or its name where no line is known."""
        return self.name if line is None else f"line {line} of {self.name}"


@dataclass(frozen=True, slots=True)
class Clues:
    """``lost`` are the criteria that are shown and have not all their marks; ``missing`` is a part."""

    listings: tuple[Listing, ...]
    recordings: tuple[Recording, ...]
    lost: tuple[Criterion, ...]
    files: tuple[str, ...]
    missing: Part | None
    preamble: str
    collaborative: bool

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
    return Clues(
        tuple(_listings(submission, plan.assignment.world.robots)),
        tuple(recordings),
        tuple(each for each in plan.assignment.criteria if each.id in lost),
        tuple(submission.files),
        plan.missing,
        plan.flags.preamble,
        plan.collaborative,
    )


def _listings(submission: Submission, robots: int) -> Iterator[Listing]:
    if submission.program is not None:
        yield _listing("robot.py", "program", submission.program.text)
    if submission.responder is not None:
        yield _listing("responder.py", "responder", submission.responder.text)
    second = second_program_of(submission) if robots == 2 else None
    if second is not None:
        yield _listing(SECOND_PROGRAM, "program", second.text)
    for cell in submission.notebook.cells if submission.notebook is not None else ():
        yield _listing(f"cell {cell.number}", None, cell.source)


def _listing(name: str, part: Part | None, text: str) -> Listing:
    lines = text.split("\n", _MOST_LINES)[:_MOST_LINES]
    return Listing(name, part, tuple(line[:_LONGEST_LINE].rstrip("\r") for line in lines))


def _different(texts: Iterator[str]) -> tuple[str, ...]:
    found: dict[str, None] = {}
    for text in texts:
        found[text[:_LONGEST_TEXT]] = None
        if len(found) == _MOST_TEXTS:
            break
    return tuple(found)
