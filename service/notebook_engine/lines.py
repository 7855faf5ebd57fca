"""The line protocol of the local engine: one line of JSON per request on stdin, and per event on stdout.

A request has an ``id`` and ``do``; events repeat the ``id``. A reader thread notices the end of the requests and of the
parent process while the engine is busy.
"""

from __future__ import annotations

import json
import os
import select
import threading
from collections.abc import Mapping
from queue import Empty, SimpleQueue
from typing import Any, Literal

from pydantic import Field

from service.notebook_engine.requests import CleanText, MagicRequest, StrictData
from sim.errors import Cancelled, UsageError
from sim.readers.json_text import read_json
from sim.readers.reader_errors import UnreadableDataError

PROTOCOL = 1
#: Longest line in bytes: the largest submission, as base64.
MAX_LINE_BYTES = 48 << 20
_MAX_VALUES = 100_000
_READ_BYTES = 1 << 16
_PARENT_SECONDS = 1.0
_MAX_ID = 2**53 - 1


class MagicLine(StrictData):
    """A request to perform a magic."""

    id: int = Field(ge=0, le=_MAX_ID)
    do: Literal["magic"]
    magic: MagicRequest


class CheckLine(StrictData):
    """A request to check a notebook. Notebook and files are base64; the assignment is an id or a folder's full path."""

    id: int = Field(ge=0, le=_MAX_ID)
    do: Literal["check"]
    assignment: CleanText = Field(max_length=4096)
    name: CleanText = Field(max_length=200)
    notebook: str
    files: dict[CleanText, str] = Field(max_length=256)


class AnswerLine(StrictData):
    """The answer to the question of the running magic."""

    id: int = Field(ge=0, le=_MAX_ID)
    do: Literal["answer"]
    text: str | None


_LINES: Mapping[str, type[MagicLine | CheckLine | AnswerLine]] = {
    "magic": MagicLine,
    "check": CheckLine,
    "answer": AnswerLine,
}


def parse_line(line: bytes) -> MagicLine | CheckLine | AnswerLine:
    """Return the request in a line. Raises UsageError if it is not a valid one."""
    try:
        data = read_json(line, max_values=_MAX_VALUES)
    except (ValueError, UnreadableDataError) as error:
        raise UsageError("the notebook sent a line that is not JSON: %(why)s", why=str(error)[:200]) from None
    kind = _LINES.get(str(data.get("do"))) if isinstance(data, dict) else None
    if kind is None:
        raise UsageError("the notebook sent a request that this release does not know; expected magic, check or answer")
    return kind.read(data)


class RequestLines:
    """Lines from a descriptor, read by a thread so that their end is noticed during work."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._parent = os.getppid()
        self._lines: SimpleQueue[bytes | None] = SimpleQueue()
        self._has_ended = threading.Event()
        threading.Thread(target=self._read_all, name="requests", daemon=True).start()

    def check(self) -> None:
        """Raise Cancelled if there will be no more lines."""
        if self._has_ended.is_set():
            raise Cancelled("the notebook has ended")

    def take(self, seconds: float | None = None) -> bytes | None:
        """Return the next line; None at the end. Raises Cancelled if none arrives in time."""
        try:
            return self._lines.get(timeout=seconds)
        except Empty:
            raise Cancelled("the notebook did not answer in time") from None

    def _read_all(self) -> None:
        try:
            self._read_lines()
        finally:
            self._has_ended.set()
            self._lines.put(None)

    def _read_lines(self) -> None:
        pieces: list[bytes] = []
        size = 0
        while (data := self._read_some()) is not None:
            *ended, rest = data.split(b"\n")
            for line in ended:
                self._lines.put(b"".join([*pieces, line]))
                pieces, size = [], 0
            pieces.append(rest)
            size += len(rest)
            if size > MAX_LINE_BYTES:
                return

    def _read_some(self) -> bytes | None:
        """Return the next bytes; None at the end of the descriptor or of the parent process."""
        while not select.select([self._descriptor], [], [], _PARENT_SECONDS)[0]:
            # Another child of the parent may have inherited the other end, so that it stays open.
            if os.getppid() != self._parent:
                return None
        return os.read(self._descriptor, _READ_BYTES) or None


class EventLines:
    """Writes events to a descriptor, one line of ASCII JSON each."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor

    def send(self, request_id: int | None, event: str, **values: Any) -> None:
        """Write an event. Raises Cancelled if nobody reads it any more."""
        line = json.dumps({"id": request_id, "event": event, **values}, separators=(",", ":"), allow_nan=False)
        data = memoryview(line.encode("ascii") + b"\n")
        try:
            while data:
                data = data[os.write(self._descriptor, data) :]
        except OSError:
            raise Cancelled("the notebook has ended") from None
