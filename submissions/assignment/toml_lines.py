"""On which line of a TOML text each key and each list entry stands.

It only finds places: whether the text is TOML, and what it says, is ``tomllib``'s business, which has read
it before.
"""

from __future__ import annotations

import contextlib
from bisect import bisect_right
from collections.abc import Mapping
from itertools import accumulate

from sim.readers.toml_text import read_toml

Path = tuple[str | int, ...]

_SPACE = " \t"
_BLANK = " \t\r\n"


def find_lines(text: str) -> Mapping[Path, int]:
    """Line numbers, from 1, by path: ``("scenario", 0, "poses", 2)`` is the third pose of the first scenario."""
    scanner = _Scanner(text)
    with contextlib.suppress(IndexError):  # a text that ends too early: the lines found so far have to do
        scanner.document()
    return scanner.lines


def line_of(lines: Mapping[Path, int], path: Path) -> int:
    """The line of the path, else of the nearest thing around it that has one."""
    while path and path not in lines:
        path = path[:-1]
    return lines.get(path, 1)


class _Scanner:
    def __init__(self, text: str) -> None:
        self._text = text + "\n"
        self._at = 0
        self._line_starts = [0, *accumulate(len(line) + 1 for line in self._text.split("\n"))]
        self.lines: dict[Path, int] = {}
        self._tables_in: dict[Path, int] = {}  # how many [[tables]] each array has so far

    def document(self) -> None:
        table: Path = ()
        while self._skip_blank():
            if self._text.startswith("[[", self._at):
                self._at += 2
                place = self._resolve(self._key())
                number = self._tables_in.get(place, 0)
                self._tables_in[place] = number + 1
                self._note(place)
                table = (*place, number)
                self._note(table)
                self._to_end_of_line()
            elif self._text[self._at] == "[":
                self._at += 1
                table = self._resolve(self._key())
                self._note(table)
                self._to_end_of_line()
            else:
                self._pair(table)

    def _resolve(self, key: list[str]) -> Path:
        """A header's path: what lies in an array of tables lies in the last of them."""
        path: Path = ()
        for part in key[:-1]:
            path = (*path, part)
            if path in self._tables_in:
                path = (*path, self._tables_in[path] - 1)
        return (*path, key[-1])

    def _pair(self, table: Path) -> None:
        start = self._at
        path: Path = (*table, *self._key())
        for length in range(len(table) + 1, len(path) + 1):
            self._note(path[:length], start)
        self._skip(_SPACE)
        self._at += 1  # the equals sign
        self._value(path)

    def _key(self) -> list[str]:
        parts = []
        while True:
            self._skip(_SPACE)
            start = self._at
            if self._text[self._at] in "\"'":
                self._string()
                parts.append(str(read_toml(f"key = {self._text[start : self._at]}")["key"]))
            else:
                while self._text[self._at] not in " \t.=]\n":
                    self._at += 1
                parts.append(self._text[start : self._at])
            self._skip(_SPACE)
            if self._text[self._at] != ".":
                return parts
            self._at += 1

    def _value(self, path: Path) -> None:
        self._skip(_SPACE)
        character = self._text[self._at]
        if character in "\"'":
            self._string()
        elif character == "[":
            self._at += 1
            number = 0
            while self._skip_blank() and self._text[self._at] != "]":
                self._note((*path, number))
                self._value((*path, number))
                number += 1
                self._skip_comma()
            self._at += 1
        elif character == "{":
            self._at += 1
            while self._skip_blank() and self._text[self._at] != "}":
                self._pair(path)
                self._skip_comma()
            self._at += 1
        else:
            while self._text[self._at] not in ",]}#\n":
                self._at += 1

    def _string(self) -> None:
        quote = self._text[self._at]
        marks = quote * 3 if self._text.startswith(quote * 3, self._at) else quote
        self._at += len(marks)
        while not self._text.startswith(marks, self._at):
            self._at += 2 if quote == '"' and self._text[self._at] == "\\" else 1
            if self._at >= len(self._text):
                raise IndexError
        self._at += len(marks)
        while len(marks) == 3 and self._text[self._at] == quote:  # quotes may stand right before the closing ones
            self._at += 1

    def _skip_comma(self) -> None:
        self._skip_blank()
        if self._text[self._at] == ",":
            self._at += 1

    def _skip(self, characters: str) -> None:
        while self._text[self._at] in characters:
            self._at += 1

    def _skip_blank(self) -> bool:
        """Past spaces, newlines and comments; whether anything follows."""
        while self._at < len(self._text):
            if self._text[self._at] in _BLANK:
                self._at += 1
            elif self._text[self._at] == "#":
                self._to_end_of_line()
            else:
                return True
        return False

    def _to_end_of_line(self) -> None:
        self._at = self._text.index("\n", self._at)

    def _note(self, path: Path, at: int | None = None) -> None:
        at = self._at if at is None else at
        self.lines.setdefault(path, bisect_right(self._line_starts, at))
