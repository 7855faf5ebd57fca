"""The child's end of the wire: one JSON object a line over two pipes, and packed acts of a robot program between.

The worker checks every frame as if it came from the internet; here there is nothing to defend.
"""

from __future__ import annotations

import functools
import json
import os
import struct
from collections.abc import Iterator
from typing import Any

Frame = dict[str, Any]

#: The longest line that the worker accepts, bytes.
MOST = 65536
_LONGEST_NUMBER = 20
#: The bytes that a character takes at most: one of the first 65,536, and any.
_WIDE, _WIDEST = 6, 12
#: A text of so many characters is never cut.
_SHORT = 100

#: What begins a packet, where a line begins with a brace: zero, how many entries follow, and the packet's number.
_HEADER = struct.Struct("<BxHxxxxQ")
_MOST_ACTS = 2000
#: What may be read at once; longer frames come in pieces.
_AT_ONCE = 8192

_encode = json.JSONEncoder(separators=(",", ":"), ensure_ascii=True).encode


class Wire:
    """Sends and receives frames over two descriptors."""

    def __init__(self, writing: int, reading: int) -> None:
        self._writing, self._reading = writing, reading
        self._sent = self._received = 0  # frames
        self._pending = b""
        self._held = b""
        self._acts: list[bytes] = []

    def act_later(self, packed: bytes) -> None:
        """An act of a robot program is sent with the next frame that cannot wait."""
        self._acts.append(packed)
        if len(self._acts) == _MOST_ACTS:
            self._write(b"")

    def act(self, packed: bytes) -> None:
        """An act that asks for something: sent now, after what was held back."""
        self._acts.append(packed)
        self._write(b"")

    def send_later(self, frame: Frame) -> None:
        """Send with the next frame that cannot wait."""
        self._hold_acts()
        self._held += self._line(frame)
        if len(self._held) > MOST // 2:
            self._write(b"")

    def send(self, frame: Frame) -> None:
        """Send now, after what was held back."""
        self._hold_acts()
        self._write(self._line(frame))

    def _line(self, frame: Frame) -> bytes:
        """It, beginning with its number, both sides count; texts that are too long for a line are cut."""
        number = self._sent
        self._sent += 1
        text = _encode(frame)
        if len(text) > MOST - _LONGEST_NUMBER:
            text = _encode(fitted(frame))
        return b'{"n":%d,%s\n' % (number, text.encode("ascii")[1:])

    def _hold_acts(self) -> None:
        """What was done so far comes before what is sent next."""
        acts = self._acts
        if acts:
            self._acts = []
            self._held += _HEADER.pack(0, len(acts), self._sent) + b"".join(acts)
            self._sent += 1

    def _write(self, data: bytes) -> None:
        self._hold_acts()
        data = self._held + data
        self._held = b""
        while data:
            data = data[os.write(self._writing, data) :]

    def receive(self) -> Frame:
        """The next frame. Ends the process when the worker has gone, or if somebody else has read what was sent."""
        while not self._pending:
            self._read()
        if self._pending[0] == 0:
            return self._receive_packed()
        while True:
            line, newline, rest = self._pending.partition(b"\n")
            if newline:
                self._pending = rest
                number = self._counted()  # even if a program that calls itself too deeply cannot read it
                frame: Frame = json.loads(line)
                if frame.pop("n") != number:
                    os._exit(0)
                return frame
            self._read()

    def _receive_packed(self) -> Frame:
        """The time and what the sensors read, as numbers alone."""
        while len(self._pending) < _HEADER.size:
            self._read()
        _, count, number = _HEADER.unpack_from(self._pending)
        numbers = _numbers(count)
        while len(self._pending) < numbers.size:
            self._read()
        units, *values = numbers.unpack_from(self._pending)
        self._pending = self._pending[numbers.size :]
        if self._counted() != number:
            os._exit(0)
        return {"t": units, "v": values}

    def _counted(self) -> int:
        number = self._received
        self._received += 1
        return number

    def _read(self) -> None:
        data = os.read(self._reading, _AT_ONCE)
        if not data:
            os._exit(0)
        self._pending += data


@functools.cache
def _numbers(count: int) -> struct.Struct:
    """A packet of the time and of what all sensors read, without what its header says."""
    return struct.Struct(f"<{_HEADER.size}xq{count - 1}d")


def fits(text: str) -> bool:
    """Whether a frame can carry ``text``."""
    # Some room is left for the rest of the frame.
    return len(text) * _WIDEST < MOST - 200 or len(_encode(text)) < MOST - 200


def fitted(frame: Frame) -> Frame:
    """``frame`` with its long texts cut, the same length each, so that a line can carry it."""
    texts = [value for value in _values(frame) if isinstance(value, str)]
    long = sum(len(text) > _SHORT for text in texts)
    space = MOST // max(long, 1) - _WIDEST * _SHORT * len(texts)

    def cut(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: each if name == "do" else cut(each) for name, each in value.items()}
        if not isinstance(value, str) or len(value) <= _SHORT:
            return value
        return clip(value, space // (_WIDEST if max(value) > "\uffff" else _WIDE))

    fitting: Frame = cut(frame)
    return fitting


def _values(frame: Frame) -> Iterator[Any]:
    for name, value in frame.items():
        if isinstance(value, dict):
            yield from _values(value)
        elif name != "do":
            yield value


def clip(text: str, most: int = 2000) -> str:
    """``text`` cut to ``most`` characters, saying so."""
    return text if len(text) <= most else f"{text[:most]}… ({len(text)} characters)"
