"""The student's source as shown by a replay, and the line that wrote a text, if only one line can have written it.

A line is identified by the exact beginning of its ``print`` or ``say``. The source is never parsed or run.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from responders.source_file import SourceFile
from service.reports.display_text import to_display_text, to_one_line
from sim.recording import Fault
from submissions.submission import Notebook, Submission

_MAX_LINES, _MAX_LINE_LENGTH = 3000, 300
_OUTPUT_CALL = re.compile(r"\b(?:(print)|say|speak)\w*\s*\(\s*")
_LITERAL = re.compile(r"([fF]?)(['\"])(?!\2\2)([^'\"\\{}]*)(\2\s*\))?")
_IMAGE = "IMG_DATA"


@dataclass(frozen=True, slots=True)
class _OutputText:
    """The text that a line prints or speaks, or its beginning."""

    prints: bool
    begins: str
    is_all: bool


@dataclass(frozen=True, slots=True)
class ShownSource:
    """A file or a notebook cell. ``who`` is the process whose faults refer to it, ``cell`` its number in a notebook."""

    name: str
    who: str
    text: str = field(repr=False)
    cell: int | None = None

    def to_json(self) -> dict[str, object]:
        """Return the source as replay data, with long lines and files shortened."""
        lines = self.text.rstrip("\n").split("\n")
        shown_lines = [to_display_text(line[:_MAX_LINE_LENGTH], _MAX_LINE_LENGTH) for line in lines[:_MAX_LINES]]
        return {"name": to_one_line(self.name, 80), "lines": shown_lines, "more": len(lines) - len(shown_lines)}


@dataclass(frozen=True, slots=True)
class Place:
    """A line, counted from 1, of one of the sources, counted from 0."""

    source: int
    line: int


class Sources:
    """All sources of a submission, or of a run."""

    def __init__(self, sources: Sequence[ShownSource] = ()) -> None:
        self.shown = tuple(sources)
        #: The lines of each text, at most two: with two, the line is ambiguous.
        self._writers: dict[_OutputText, list[Place]] = {}
        for index, source in enumerate(self.shown):
            if source.who == "program":
                for line, writer in _iterate_output_texts(source.text):
                    places = self._writers.setdefault(writer, [])
                    if len(places) < 2:
                        places.append(Place(index, line))
        self._lengths = sorted({len(writer.begins) for writer in self._writers if not writer.is_all})

    def find_writing_line(self, text: str, *, is_spoken: bool = False) -> Place | None:
        """Return the only line of the robot program that can have printed, or spoken, the text; None if unknown.

        The text's beginnings are looked up one by one, so that long sources and many texts don't slow it down.
        """
        text = _IMAGE if text.startswith(f"{_IMAGE}::") else text
        possible_writers = [_OutputText(not is_spoken, text, True)]
        possible_writers += [
            _OutputText(not is_spoken, text[:length], False) for length in self._lengths if length <= len(text)
        ]
        places = [place for writer in possible_writers for place in self._writers.get(writer, ())]
        return places[0] if len(places) == 1 else None

    def find_fault_line(self, fault: Fault) -> Place | None:
        """Return the line that a fault names, if it is in the shown sources."""
        if fault.line is None or fault.file or fault.agent:
            return None
        for index, source in enumerate(self.shown):
            if source.cell == fault.cell if fault.cell is not None else source.who == fault.who:
                return Place(index, fault.line)
        return None


def collect_sources(submission: Submission | None) -> Sources:
    """Return the student's sources: both files, or every code cell."""
    if submission is None:
        return Sources()
    if submission.notebook is not None:
        return collect_cell_sources(submission.notebook)
    return collect_file_sources(submission.program, submission.responder)


def collect_file_sources(program: SourceFile | None, responder: SourceFile | None) -> Sources:
    """Return the sources of a robot program and its responder, if present."""
    files = (("program", program), ("responder", responder))
    return Sources([ShownSource(code.name, who, code.text) for who, code in files if code is not None])


def collect_cell_sources(notebook: Notebook) -> Sources:
    """Return every code cell that is not empty."""
    return Sources(
        [
            ShownSource(
                f"cell {cell.number}", "program" if _is_robot_cell(cell.source) else "", cell.source, cell.number
            )
            for cell in notebook.cells
            if cell.source.strip()
        ]
    )


def _is_robot_cell(cell: str) -> bool:
    return cell.lstrip().startswith("%%sim")


def _iterate_output_texts(text: str) -> Iterator[tuple[int, _OutputText]]:
    for number, line in enumerate(text.split("\n")[:_MAX_LINES], start=1):
        code = line[:_MAX_LINE_LENGTH].lstrip()
        if code.startswith(("#", "def ")):
            continue
        for call in _OUTPUT_CALL.finditer(code):
            literal = _LITERAL.match(code, call.end())
            begins = literal[3] if literal else ""
            yield number, _OutputText(call[1] is not None, begins, bool(literal and literal[4]))
