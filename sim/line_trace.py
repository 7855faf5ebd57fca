"""The lines that a program came to during a trial, in little memory."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from typing import overload

from sim.recording import ProgramLine

#: Memory of one line in a trace: a float and two integers.
LINE_BYTES = 16


class LineTrace(Sequence[ProgramLine]):
    """The lines of a program in the order in which it came to them."""

    __slots__ = ("_lines", "_outer", "_times")

    def __init__(self) -> None:
        self._times = array("d")
        self._lines, self._outer = array("i"), array("i")

    def append(self, t: float, line: int, outer: int) -> None:
        """Add a line. The arguments are those of ``ProgramLine``."""
        self._times.append(t)
        self._lines.append(line)
        self._outer.append(outer)

    def __len__(self) -> int:
        return len(self._times)

    def __iter__(self) -> Iterator[ProgramLine]:
        return map(ProgramLine, self._times, self._lines, self._outer)

    @overload
    def __getitem__(self, index: int) -> ProgramLine: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[ProgramLine, ...]: ...

    def __getitem__(self, index: int | slice) -> ProgramLine | tuple[ProgramLine, ...]:
        if isinstance(index, slice):
            return tuple(map(ProgramLine, self._times[index], self._lines[index], self._outer[index]))
        return ProgramLine(self._times[index], self._lines[index], self._outer[index])
