"""A student's submission after reading: sources, model files, and the content of submission.toml.

``bundle.py`` reads archives and folders; ``service`` processes submissions.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Literal

from responders.source_file import SourceFile
from sim.errors import UsageError
from sim.readers.reader_errors import UnreadableDataError
from sim.readers.toml_text import read_toml
from submissions.raw_files import sanitise_name
from submissions.source_text import decode_source

Part = Literal["program", "responder"]
#: File name of each part.
PART_FILES: Mapping[Part, str] = MappingProxyType({"program": "robot.py", "responder": "responder.py"})
#: Part of each file name, in lower case.
PARTS_BY_FILE: Mapping[str, Part] = MappingProxyType(
    {"robot.py": "program", "program.py": "program", "responder.py": "responder"}
)
#: File name of the second robot's program, which is among the additional files.
SECOND_PROGRAM = "robot2.py"
META_FILE = "submission.toml"
_MAX_META_BYTES = 64 * 1024


@dataclass(frozen=True, slots=True)
class Cell:
    """A code cell of a notebook; ``number`` is the number that Jupyter shows after Restart & Run All."""

    number: int
    source: str
    tags: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Notebook:
    """A student's notebook: its submitted name and its code cells from the top.

    ``markdown_programs`` are the numbers, among all cells, of Markdown cells that begin a robot program; they are not
    run. ``raw_responders`` are the first lines of functions called responder in Raw cells.
    """

    name: str
    cells: tuple[Cell, ...]
    markdown_programs: tuple[int, ...] = field(default=(), compare=False)
    raw_responders: tuple[str, ...] = field(default=(), compare=False)


@dataclass(frozen=True)
class Submission:
    """One submission. ``files`` are the additional files by flat name; a notebook replaces both sources."""

    student: str
    program: SourceFile | None = None
    responder: SourceFile | None = None
    files: Mapping[str, bytes] = field(default_factory=lambda: MappingProxyType({}))
    assignment: str | None = None  # named in submission.toml or by the parent folder
    notes: tuple[str, ...] = ()  # files ignored, folders entered and names changed during reading
    notebook: Notebook | None = None
    run: str | None = None  # number or tag of the notebook run to be marked, if named

    @cached_property
    def python_files(self) -> Mapping[str, SourceFile]:
        """The readable Python files among ``files`` by name: modules, agents, the second robot's program."""
        sources: dict[str, SourceFile] = {}
        for name, data in self.files.items():
            if name.lower().endswith(".py"):
                with contextlib.suppress(UsageError):
                    sources[name] = _decode_file(name, data)
        return MappingProxyType(sources)

    def find_code(self, name: str) -> SourceFile | None:
        """Return the file with this name among ``files``, or None.

        Raises:
            UsageError: The file is not text.
        """
        if name not in self.files:
            return None
        return self.python_files.get(name) or _decode_file(name, self.files[name])

    def find_agent_code(self, agent: str) -> SourceFile | None:
        """Return the file of this agent, or None. The file of ``parser`` is ``parser.py``.

        Raises:
            UsageError: The file is not text.
        """
        return next((self.find_code(name) for name in self.files if find_agent(name, (agent,))), None)

    def with_source(self, file: str, text: str) -> Submission:
        """Return the submission with another text in one of its Python files: a part, or an additional file."""
        part = PARTS_BY_FILE.get(file.lower())
        if part == "program" and self.program is not None:
            return replace(self, program=SourceFile(self.program.name, text))
        if part == "responder" and self.responder is not None:
            return replace(self, responder=SourceFile(self.responder.name, text))
        return replace(self, files={**self.files, file: text.encode("utf-8", "surrogatepass")})

    def read_texts(self, names: Iterable[str]) -> tuple[str, ...]:
        """Return the texts of the files with these names, as an assignment asks for them; empty for missing files."""
        parts = {PART_FILES["program"]: self.program, PART_FILES["responder"]: self.responder}
        sources = (parts.get(name) or self.python_files.get(name) for name in names)
        return tuple("" if source is None else source.text for source in sources)

    def files_without(self, agents: Iterable[str]) -> Mapping[str, bytes]:
        """Return the files without those of these agents, which other processes must not read."""
        agents = tuple(agents)
        return {name: data for name, data in self.files.items() if not find_agent(name, agents)}

    @property
    def sha256(self) -> str:
        """SHA-256 of the content, independent of the student and of the packing."""
        digest = hashlib.sha256()
        for piece in self.iterate_hash_data():
            digest.update(piece)
        return digest.hexdigest()

    def iterate_hash_data(self) -> Iterator[bytes]:
        """Yield the hashed data: records of fields, each preceded by its length.

        Different submissions therefore give different data. Names are included, because programs and reports can depend
        on them.
        """
        yield b"robomark submission 2\n"
        for record in self._iterate_records():
            yield b"%d fields\n" % len(record)
            for part in record:
                data = part if isinstance(part, bytes) else part.encode("utf-8", "surrogatepass")
                yield b"%d bytes\n" % len(data)
                yield data

    def _iterate_records(self) -> Iterator[tuple[str | bytes, ...]]:
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


def find_agent(file: str, agents: Iterable[str]) -> str | None:
    """Return the agent whose program is in this file, or None."""
    return next((name for name in agents if file.lower() == f"{name}.py"), None)


def _decode_file(name: str, data: bytes) -> SourceFile:
    return SourceFile(name, decode_source(data, sanitise_name(name)).text)


def read_meta(data: bytes, source_name: str) -> dict[str, object]:
    """Parse submission.toml; an empty file gives no entries.

    Raises:
        UsageError: The file cannot be read. The message has ``source_name``.
    """
    if not data:
        return {}
    if len(data) > _MAX_META_BYTES:
        raise UsageError("%(where)s: %(file)s is too large, expected a few lines.", where=source_name, file=META_FILE)
    return parse_meta(data, source_name)


def parse_meta(data: bytes, source_name: str) -> dict[str, object]:
    """Parse submission.toml without a limit on its size, for stored files with many notes."""
    try:
        return read_toml(data.decode("utf-8-sig"))
    except ValueError as error:
        problem = error.message if isinstance(error, UnreadableDataError) else str(error)[:200]
        raise UsageError(
            '%(where)s: %(file)s cannot be read (%(problem)s), expected lines like assignment = "echo-responder".',
            where=source_name,
            file=META_FILE,
            problem=problem,
        ) from None


def get_meta_text(meta: Mapping[str, object], key: str, source_name: str) -> str | None:
    """Return a text of the file, or None if it is missing.

    Raises:
        UsageError: The value is not a text.
    """
    value = meta.get(key)
    if value is not None and (not isinstance(value, str) or not value.strip()):
        raise UsageError(
            '%(where)s: %(key)s in %(file)s is not a text, expected %(key)s = "..." there.',
            where=source_name,
            key=key,
            file=META_FILE,
        )
    return value


def get_meta_run(meta: Mapping[str, object], source_name: str) -> str | None:
    """Return the run of a notebook that is to be marked: a number, or the tag of a cell."""
    value = meta.get("run")
    if isinstance(value, int) and not isinstance(value, bool):
        return str(value)
    return get_meta_text(meta, "run", source_name)
