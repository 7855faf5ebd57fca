"""Mistakes in an assignment file with their lines, and the positions of keys and tables in the file.

The modules that read the tables find the mistakes.
"""

from __future__ import annotations

import contextlib
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import accumulate
from typing import Any, TypeVar, cast

from pydantic import BaseModel

from sim.errors import AssignmentError
from sim.readers.toml_text import read_toml
from submissions.assignment.table_problems import read_table

_MAX_PROBLEMS = 100
Path = tuple[str | int, ...]

_SPACE = " \t"
_BLANK = " \t\r\n"
T = TypeVar("T", bound=BaseModel)


def find_lines(text: str) -> Mapping[Path, int]:
    """Return line numbers, from 1, by path: ``("scenario", 0, "poses", 2)`` is the third pose of the first scenario."""
    scanner = _Scanner(text)
    with contextlib.suppress(IndexError):  # If the text ends too early, the lines found so far are returned.
        scanner.scan_document()
    return scanner.lines


def find_nearest_line(lines: Mapping[Path, int], path: Path) -> int:
    """Return the line of the path, or of its nearest parent with a known line."""
    while path and path not in lines:
        path = path[:-1]
    return lines.get(path, 1)


class _Scanner:
    def __init__(self, text: str) -> None:
        self._text = text + "\n"
        self._at = 0
        self._line_starts = [0, *accumulate(len(line) + 1 for line in self._text.split("\n"))]
        self.lines: dict[Path, int] = {}
        self._tables_in: dict[Path, int] = {}  # number of [[tables]] found in each array

    def scan_document(self) -> None:
        table: Path = ()
        while self._skip_blank():
            if self._text.startswith("[[", self._at):
                self._at += 2
                array_path = self._resolve(self._scan_key())
                number = self._tables_in.get(array_path, 0)
                self._tables_in[array_path] = number + 1
                self._record_line(array_path)
                table = (*array_path, number)
                self._record_line(table)
                self._skip_line()
            elif self._text[self._at] == "[":
                self._at += 1
                table = self._resolve(self._scan_key())
                self._record_line(table)
                self._skip_line()
            else:
                self._scan_pair(table)

    def _resolve(self, key: list[str]) -> Path:
        """Return the path of a header. Keys in an array of tables refer to its last table."""
        path: Path = ()
        for part in key[:-1]:
            path = (*path, part)
            if path in self._tables_in:
                path = (*path, self._tables_in[path] - 1)
        return (*path, key[-1])

    def _scan_pair(self, table: Path) -> None:
        start = self._at
        path: Path = (*table, *self._scan_key())
        for length in range(len(table) + 1, len(path) + 1):
            self._record_line(path[:length], start)
        self._skip(_SPACE)
        self._at += 1  # the equals sign
        self._scan_value(path)

    def _scan_key(self) -> list[str]:
        parts = []
        while True:
            self._skip(_SPACE)
            start = self._at
            if self._text[self._at] in "\"'":
                self._scan_string()
                parts.append(str(read_toml(f"key = {self._text[start : self._at]}")["key"]))
            else:
                while self._text[self._at] not in " \t.=]\n":
                    self._at += 1
                parts.append(self._text[start : self._at])
            self._skip(_SPACE)
            if self._text[self._at] != ".":
                return parts
            self._at += 1

    def _scan_value(self, path: Path) -> None:
        self._skip(_SPACE)
        character = self._text[self._at]
        if character in "\"'":
            self._scan_string()
        elif character == "[":
            self._at += 1
            number = 0
            while self._skip_blank() and self._text[self._at] != "]":
                self._record_line((*path, number))
                self._scan_value((*path, number))
                number += 1
                self._skip_comma()
            self._at += 1
        elif character == "{":
            self._at += 1
            while self._skip_blank() and self._text[self._at] != "}":
                self._scan_pair(path)
                self._skip_comma()
            self._at += 1
        else:
            while self._text[self._at] not in ",]}#\n":
                self._at += 1

    def _scan_string(self) -> None:
        quote = self._text[self._at]
        marks = quote * 3 if self._text.startswith(quote * 3, self._at) else quote
        self._at += len(marks)
        while not self._text.startswith(marks, self._at):
            self._at += 2 if quote == '"' and self._text[self._at] == "\\" else 1
            if self._at >= len(self._text):
                raise IndexError
        self._at += len(marks)
        while len(marks) == 3 and self._text[self._at] == quote:  # quotes may come directly before the closing ones
            self._at += 1

    def _skip_comma(self) -> None:
        self._skip_blank()
        if self._text[self._at] == ",":
            self._at += 1

    def _skip(self, characters: str) -> None:
        while self._text[self._at] in characters:
            self._at += 1

    def _skip_blank(self) -> bool:
        """Skip spaces, newlines and comments. Return whether text remains."""
        while self._at < len(self._text):
            if self._text[self._at] in _BLANK:
                self._at += 1
            elif self._text[self._at] == "#":
                self._skip_line()
            else:
                return True
        return False

    def _skip_line(self) -> None:
        self._at = self._text.index("\n", self._at)

    def _record_line(self, path: Path, offset: int | None = None) -> None:
        offset = self._at if offset is None else offset
        self.lines.setdefault(path, bisect_right(self._line_starts, offset))


class AssignmentProblems(AssignmentError):
    """All mistakes in an assignment; ``problems`` has one ``file:line: sentence`` for each."""

    def __init__(self, problems: tuple[str, ...]) -> None:
        super().__init__("\n".join(problems))
        self.problems = problems

    def __reduce__(self) -> tuple[type[AssignmentProblems], tuple[tuple[str, ...]]]:
        return type(self), (self.problems,)


@dataclass(slots=True)
class Problems:
    """Collected mistakes. ``where`` is the displayed file name, ``lines`` the line of each key."""

    where: str
    lines: Mapping[Path, int]
    found: list[tuple[int, str]] = field(default_factory=list)

    def add(self, path: Path, sentence: str) -> None:
        """Add a mistake at the line of this key.

        Raises:
            AssignmentProblems: The number of mistakes exceeds its limit. A file can have one in every key.
        """
        self.found.append((find_nearest_line(self.lines, path), sentence))
        if len(self.found) > _MAX_PROBLEMS:
            raise AssignmentProblems((*self.sorted(), f"{self.where}:1: may have more mistakes; checking stopped here"))

    def sorted(self) -> tuple[str, ...]:
        """Return ``file:line: sentence`` for each mistake, sorted by line."""
        return tuple(f"{self.where}:{line}: {sentence}" for line, sentence in sorted(dict.fromkeys(self.found)))


def check_table(schema: type[T], table: object, table_path: Path, problems: Problems) -> T | None:
    """Validate a table with the schema. Add mistakes to ``problems`` and return None if there are any."""
    result = read_table(schema, table)
    if isinstance(result, schema):
        return result
    for problem in cast(list[Any], result):
        problems.add((*table_path, *problem.path), problem.sentence)
    return None


def read_tables(document: Mapping[str, object], key: str, problems: Problems) -> list[dict[str, Any]]:
    """Return the tables of a list that must not be empty."""
    value = document.get(key)
    if value is None or value == []:
        problems.add((), f"there is no [[{key}]], expected at least one")
    elif not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        problems.add((key,), f"{key} is not a list of tables, expected [[{key}]] before each")
    return filter_tables(value)


def filter_tables(value: object) -> list[dict[str, Any]]:
    """Return the tables in a value of any type."""
    return [item for item in value if isinstance(item, dict)] if isinstance(value, list) else []


def filter_texts(value: object) -> list[str]:
    """Return the texts in a value of any type."""
    return [item for item in value if isinstance(item, str)] if isinstance(value, list) else []


def check_unique_id(
    raw: Mapping[str, object], id_counts: dict[str, int], table_path: Path, kind: str, problems: Problems
) -> None:
    """Report an id that an earlier table of this kind already has."""
    name = raw.get("id")
    if not isinstance(name, str):
        return
    if name in id_counts:
        problems.add((*table_path, "id"), f'id "{name[:60]}" is the id of an earlier {kind}, expected one of its own')
    id_counts[name] = id_counts.get(name, 0) + 1
