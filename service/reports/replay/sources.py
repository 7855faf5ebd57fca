"""The student's source as a replay shows it, and the line that a text came from, where only one can have written it.

A line is known by what its ``print`` or ``say`` begins with, letter for letter; the source is never parsed or run.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from responders.code import Code
from service.reports.readable import one_line, readable
from sim.recording import Fault
from submissions.submission import Notebook, Submission

_MOST_LINES, _LONGEST_LINE = 3000, 300
_WRITES = re.compile(r"\b(?:(print)|say|speak)\w*\s*\(\s*")
_LITERAL = re.compile(r"([fF]?)(['\"])(?!\2\2)([^'\"\\{}]*)(\2\s*\))?")
_IMAGE = "IMG_DATA"


@dataclass(frozen=True, slots=True)
class _Writer:
    """What a line prints or speaks: a text that begins so, or that is so in all."""

    prints: bool
    begins: str
    is_all: bool


@dataclass(frozen=True, slots=True)
class ShownSource:
    """A file or a notebook's cell; ``who`` is whose faults are in its lines, ``cell`` its number in a notebook."""

    name: str
    who: str
    text: str = field(repr=False)
    cell: int | None = None

    def told(self) -> dict[str, object]:
        """As the data has it: a line is never longer than a screen is patient."""
        lines = self.text.rstrip("\n").split("\n")
        shown = [readable(line[:_LONGEST_LINE], _LONGEST_LINE) for line in lines[:_MOST_LINES]]
        return {"name": one_line(self.name, 80), "lines": shown, "more": len(lines) - len(shown)}


@dataclass(frozen=True, slots=True)
class Place:
    """A line, counted from 1, of one of the sources, counted from 0."""

    source: int
    line: int


class Sources:
    """All sources of a submission, or of a run."""

    def __init__(self, shown: Sequence[ShownSource] = ()) -> None:
        self.shown = tuple(shown)
        #: A line for each, and two at most: where there are two it is not known which.
        self._writers: dict[_Writer, list[Place]] = {}
        for index, source in enumerate(self.shown):
            if source.who == "program":
                for line, writer in _writers(source.text):
                    places = self._writers.setdefault(writer, [])
                    if len(places) < 2:
                        places.append(Place(index, line))
        self._lengths = sorted({len(writer.begins) for writer in self._writers if not writer.is_all})

    def wrote(self, text: str, *, spoken: bool = False) -> Place | None:
        """The only line of the robot program that can have printed, or spoken, the text; None if it is not known.

        Its beginnings are looked up one by one, so that neither long sources nor many texts make this slow.
        """
        text = _IMAGE if text.startswith(f"{_IMAGE}::") else text
        possible = [_Writer(not spoken, text, True)]
        possible += [_Writer(not spoken, text[:length], False) for length in self._lengths if length <= len(text)]
        found = [place for writer in possible for place in self._writers.get(writer, ())]
        return found[0] if len(found) == 1 else None

    def of_fault(self, fault: Fault) -> Place | None:
        """The line that a fault names, if it is in what is shown."""
        if fault.line is None or fault.file or fault.agent:
            return None
        for index, source in enumerate(self.shown):
            if source.cell == fault.cell if fault.cell is not None else source.who == fault.who:
                return Place(index, fault.line)
        return None


def sources_of(submission: Submission | None) -> Sources:
    """What the student wrote: both files, or every code cell."""
    if submission is None:
        return Sources()
    if submission.notebook is not None:
        return sources_of_cells(submission.notebook)
    return sources_of_files(submission.program, submission.responder)


def sources_of_files(program: Code | None, responder: Code | None) -> Sources:
    """A robot program and what answers it, as far as they are there."""
    files = (("program", program), ("responder", responder))
    return Sources([ShownSource(code.name, who, code.text) for who, code in files if code is not None])


def sources_of_cells(notebook: Notebook) -> Sources:
    """Every code cell that has something in it."""
    return Sources(
        [
            ShownSource(f"cell {cell.number}", "program" if _is_program(cell.source) else "", cell.source, cell.number)
            for cell in notebook.cells
            if cell.source.strip()
        ]
    )


def _is_program(cell: str) -> bool:
    return cell.lstrip().startswith("%%sim")


def _writers(text: str) -> Iterator[tuple[int, _Writer]]:
    for number, line in enumerate(text.split("\n")[:_MOST_LINES], start=1):
        code = line[:_LONGEST_LINE].lstrip()
        if code.startswith(("#", "def ")):
            continue
        for call in _WRITES.finditer(code):
            literal = _LITERAL.match(code, call.end())
            begins = literal[3] if literal else ""
            yield number, _Writer(call[1] is not None, begins, bool(literal and literal[4]))
