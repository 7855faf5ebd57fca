"""Reader of assignment folders: ``assignment.toml`` and its files to an ``Assignment``.

All mistakes are reported together, each with file, line and expected form. Files in the folder are not executed.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType

from sim.errors import UsageError
from sim.readers.reader_errors import UnreadableDataError
from sim.readers.toml_text import TOMLDecodeError, read_toml
from submissions.assignment.assignment_parts import build_assignment
from submissions.assignment.definition import Assignment
from submissions.assignment.folder import FILE_NAME, list_catalogue_ids, locate_assignment_folder
from submissions.assignment.problems import AssignmentProblems, Problems, find_lines
from submissions.suggestions import suggest_name

#: Files in an assignment's folder that do not affect marks.
NON_GRADING_FILES = ("starter", "examples", "expected.toml", "survivors.toml")
_MAX_FOLDER_BYTES = 128 * 1024 * 1024
_MAX_TOML_BYTES = 1024 * 1024
_SYNTAX = re.compile(r"^(?P<what>.*?) \(at (?:line (?P<line>\d+), column (?P<column>\d+)|end of document)\)$")
#: Plain explanations of common mistakes, by the start of the message from ``tomllib``.
_PLAINER = MappingProxyType(
    {
        "invalid value": ": texts need quotes, numbers do not",
        "cannot overwrite": "; this key is given twice in its table",
        "cannot declare": "; this table exists already",
        "illegal character": "; is a closing quote missing?",
        "unclosed array": "; is a comma or a ] missing?",
        "expected newline": "; is there a quote or a comma too many?",
    }
)


def find_assignment(name_or_path: str | os.PathLike[str]) -> Assignment:
    """Read the assignment with this id in the catalogue, or in this folder.

    Raises:
        UsageError: Neither exists.
        AssignmentProblems: The assignment cannot be used.
    """
    return read_assignment(locate_assignment_folder(name_or_path))


def find_in_catalogue(name: str) -> Assignment:
    """Read the catalogue assignment with this id, named by a submission. Paths are never accepted.

    Raises:
        UsageError: The catalogue has no such assignment.
    """
    ids = list_catalogue_ids()
    if name not in ids:
        hint = suggest_name(name, ids) or "; robomark assignments list shows the catalogue"
        raise UsageError(f"There is no assignment {name!r} in the catalogue, expected one of its ids{hint}.")
    return find_assignment(name)


def read_assignment(folder: Path) -> Assignment:
    """Read the assignment in ``folder``.

    Raises:
        AssignmentProblems: The assignment cannot be used. The error lists all mistakes.
    """
    folder = Path(os.path.abspath(folder))  # noqa: PTH100 - resolve() would change the name that is shown
    source_name = f"{folder.name}/{FILE_NAME}"
    if not folder.is_dir():
        raise AssignmentProblems((f"{folder}: does not exist, expected a folder with {FILE_NAME} in it",))
    if not (folder / FILE_NAME).is_file():
        raise AssignmentProblems((f"{folder}: has no {FILE_NAME} in it, expected one",))
    files = _read_folder_files(folder)
    text, document = parse_toml(files[FILE_NAME], source_name)
    problems = Problems(source_name, find_lines(text))
    assignment = build_assignment(document, files, problems)
    if assignment is None or problems.found:
        raise AssignmentProblems(problems.sorted())
    return assignment


def parse_toml(data: bytes, source_name: str) -> tuple[str, dict[str, object]]:
    """Return the text of a TOML file and its content.

    Raises:
        AssignmentProblems: The file cannot be parsed. The message has ``source_name`` and the line.
    """
    if len(data) > _MAX_TOML_BYTES:
        raise AssignmentProblems((f"{source_name}:1: the file is too large, expected at most 1 MB",))
    try:
        text = data.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise AssignmentProblems(
            (f"{source_name}:{line}: the text is not UTF-8, expected a file saved as UTF-8",)
        ) from None
    try:
        return text, read_toml(text)
    except TOMLDecodeError as error:
        raise AssignmentProblems((_describe_syntax_error(str(error), source_name, text),)) from None
    except UnreadableDataError as error:
        raise AssignmentProblems((f"{source_name}:1: {error}, expected ordinary TOML",)) from None


def _describe_syntax_error(message: str, source_name: str, text: str) -> str:
    match = _SYNTAX.match(message)
    problem = match["what"] if match else message
    if match and match["line"]:
        line, column = int(match["line"]), f" (column {match['column']})"
    else:
        line, column = text.count("\n") + 1, " (at the end)"
    hint = next((words for begin, words in _PLAINER.items() if problem.lower().startswith(begin)), "")
    return f"{source_name}:{line}: {problem[:1].lower()}{problem[1:]}{column}, expected TOML{hint}"


def _read_folder_files(folder: Path) -> Mapping[str, bytes]:
    """Return the files that decide the marks, by path in the folder."""
    files: dict[str, bytes] = {}
    size = 0
    for parts, path in walk_files(folder):
        if parts[0] in NON_GRADING_FILES:
            continue
        size += path.stat().st_size
        if size > _MAX_FOLDER_BYTES:
            max_megabytes = _MAX_FOLDER_BYTES // (1024 * 1024)
            raise AssignmentProblems((f"{folder}: is too large, expected at most {max_megabytes} MB of files",))
        try:
            files["/".join(parts)] = path.read_bytes()
        except OSError as error:
            raise AssignmentProblems(
                (f"{path}: cannot be read ({error.strerror}), expected a readable file",)
            ) from None
    return MappingProxyType(files)


def walk_files(folder: Path) -> Iterator[tuple[tuple[str, ...], Path]]:
    """Yield the parts of the name and the path of each file in an assignment's folder, sorted.

    Dot files and Python's caches are omitted.

    Raises:
        AssignmentProblems: A link leads out of the folder. Its author could read files of whoever uses the assignment.
    """
    root = folder.resolve()
    for path in sorted(folder.rglob("*")):
        parts = path.relative_to(folder).parts
        if any(part.startswith(".") or part == "__pycache__" for part in parts):
            continue
        if path.is_symlink() and not path.resolve().is_relative_to(root):
            raise AssignmentProblems((f"{path}: is a link that leads out of the folder, expected the file itself",))
        if path.is_file():
            yield parts, path
