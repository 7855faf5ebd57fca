"""What one student submitted, after reading: sources, model files, and what submission.toml says of them.

Reading archives and folders is ``bundle.py``, deciding what to do with a submission is the service's.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Literal

from responders.code import Code
from sim.errors import UsageError
from sim.readers.toml_text import read_toml
from sim.readers.unreadable import Unreadable
from submissions.raw_files import shown
from submissions.source_text import decode_source

Part = Literal["program", "responder"]
#: What the file of each part is called.
PART_FILES: Mapping[Part, str] = MappingProxyType({"program": "robot.py", "responder": "responder.py"})
#: The file with the second robot's program; it lies among the files beside the parts.
SECOND_PROGRAM = "robot2.py"
META = "submission.toml"
_MOST_META_BYTES = 64 * 1024


@dataclass(frozen=True, slots=True)
class Cell:
    """A code cell of a notebook; ``number`` is what Jupyter shows beside it after Restart & Run All."""

    number: int
    source: str
    tags: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Notebook:
    """A notebook of the student's: the name it was submitted under, and its code cells from the top.

    ``markdown_programs`` are the Markdown cells, counted among all cells, that begin a robot program; none is run.
    ``raw_responders`` are the first lines of functions called responder that are in Raw cells.
    """

    name: str
    cells: tuple[Cell, ...]
    markdown_programs: tuple[int, ...] = field(default=(), compare=False)
    raw_responders: tuple[str, ...] = field(default=(), compare=False)


@dataclass(frozen=True)
class Submission:
    """One submission. ``files`` are what lies beside the sources, by flat name; a notebook stands for both sources."""

    student: str
    program: Code | None = None
    responder: Code | None = None
    files: Mapping[str, bytes] = field(default_factory=lambda: MappingProxyType({}))
    assignment: str | None = None  # named by the submission's submission.toml or its parent folder
    notes: tuple[str, ...] = ()  # what was ignored, stepped into or renamed while reading
    notebook: Notebook | None = None
    run: str | None = None  # of the notebook: the number or the tag of the one to be marked, where anybody says so

    @cached_property
    def python_files(self) -> Mapping[str, Code]:
        """The Python files among ``files`` that can be read, by name: modules, agents, the second robot's program."""
        found: dict[str, Code] = {}
        for name, data in self.files.items():
            if name.lower().endswith(".py"):
                with contextlib.suppress(UsageError):
                    found[name] = _decoded(name, data)
        return MappingProxyType(found)

    def code(self, name: str) -> Code | None:
        """The file of this name among ``files``. Raises UsageError if it is no text."""
        if name not in self.files:
            return None
        return self.python_files.get(name) or _decoded(name, self.files[name])

    def agent(self, agent: str) -> Code | None:
        """The file of this agent: ``parser.py`` is that of ``parser``. Raises UsageError if it is no text."""
        return next((self.code(name) for name in self.files if agent_of(name, (agent,))), None)

    def files_without(self, agents: Iterable[str]) -> Mapping[str, bytes]:
        """The files but for those of these agents, which no other process can read."""
        agents = tuple(agents)
        return {name: data for name, data in self.files.items() if not agent_of(name, agents)}

    @property
    def sha256(self) -> str:
        """Hash of what was submitted, whoever submitted it and however it was packed."""
        digest = hashlib.sha256()
        for piece in self.hashed():
            digest.update(piece)
        return digest.hexdigest()

    def hashed(self) -> Iterator[bytes]:
        """What the hash is over: records of fields, each told how long it is before it comes.

        No two submissions have the same bytes so. Names count, for a program and its report can tell them.
        """
        yield b"robomark submission 2\n"
        for record in self._records():
            yield b"%d fields\n" % len(record)
            for part in record:
                data = part if isinstance(part, bytes) else part.encode("utf-8", "surrogatepass")
                yield b"%d bytes\n" % len(data)
                yield data

    def _records(self) -> Iterator[tuple[str | bytes, ...]]:
        for part, source in (("program", self.program), ("responder", self.responder)):
            if source is not None:
                yield part, source.name, source.text
        if self.notebook is not None:
            yield "notebook", self.notebook.name
            for cell in self.notebook.cells:
                yield "cell", str(cell.number), cell.source, *cell.tags
            if self.run is not None:
                yield "run", self.run
        for name in sorted(self.files):
            yield "file", name, self.files[name]


def agent_of(file: str, agents: Iterable[str]) -> str | None:
    """The one of these agents that a file has the program of."""
    return next((name for name in agents if file.lower() == f"{name}.py"), None)


def _decoded(name: str, data: bytes) -> Code:
    return Code(name, decode_source(data, shown(name)).text)


def read_meta(data: bytes, where: str) -> dict[str, object]:
    """What the file says; nothing where there is none. Raises UsageError, naming ``where``, for what cannot be read."""
    if not data:
        return {}
    if len(data) > _MOST_META_BYTES:
        raise UsageError("%(where)s: %(file)s is too large, expected a few lines.", where=where, file=META)
    return parse_meta(data, where)


def parse_meta(data: bytes, where: str) -> dict[str, object]:
    """The same without a limit of size, for files written here: notes on many files are more than a few lines."""
    try:
        return read_toml(data.decode("utf-8-sig"))
    except ValueError as error:
        problem = error.said if isinstance(error, Unreadable) else str(error)[:200]
        raise UsageError(
            '%(where)s: %(file)s cannot be read (%(problem)s), expected lines like assignment = "echo-responder".',
            where=where,
            file=META,
            problem=problem,
        ) from None


def text_of(meta: Mapping[str, object], key: str, where: str) -> str | None:
    """A text of it, None where it says none. Raises UsageError for anything else."""
    value = meta.get(key)
    if value is not None and (not isinstance(value, str) or not value.strip()):
        raise UsageError(
            '%(where)s: %(key)s in %(file)s is not a text, expected %(key)s = "..." there.',
            where=where,
            key=key,
            file=META,
        )
    return value


def run_of(meta: Mapping[str, object], where: str) -> str | None:
    """Which run of a notebook is to be marked: a number, or the tag of a cell."""
    value = meta.get("run")
    if isinstance(value, int) and not isinstance(value, bool):
        return str(value)
    return text_of(meta, "run", where)
