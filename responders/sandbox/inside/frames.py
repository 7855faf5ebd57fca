"""The child's end of the wire: JSON lines over two pipes, with packed actions of a robot program between them.

The worker validates every frame as untrusted input. This module does not protect the worker.
"""

from __future__ import annotations

import functools
import json
import os
import struct
from collections.abc import Iterator
from typing import Any

Frame = dict[str, Any]

#: Maximum line length that the worker accepts, bytes.
MAX_FRAME_BYTES = 65536
_MAX_NUMBER_LENGTH = 20
#: Maximum bytes per character: for the first 65,536 code points, and for all.
_WIDE, _WIDEST = 6, 12
#: Texts up to this length are never cut.
_NEVER_CUT_LENGTH = 100

#: Header of a packet: zero, where a line begins with a brace, then the number of entries and the frame number.
_HEADER = struct.Struct("<BxHxxxxQ")
_MAX_DELAYED_ACTIONS = 2000
#: Maximum bytes per read. Longer frames arrive in parts.
_READ_BYTES = 8192

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
        """Send an action of a robot program with the next frame that can't wait."""
        self._acts.append(packed)
        if len(self._acts) == _MAX_DELAYED_ACTIONS:
            self._write(b"")

    def act(self, packed: bytes) -> None:
        """Send an action that needs a reply now, after the delayed ones."""
        self._acts.append(packed)
        self._write(b"")

    def send_later(self, frame: Frame) -> None:
        """Send the frame with the next one that can't wait."""
        self._hold_acts()
        self._held += self._encode_line(frame)
        if len(self._held) > MAX_FRAME_BYTES // 2:
            self._write(b"")

    def send(self, frame: Frame) -> None:
        """Send the frame now, after the delayed ones."""
        self._hold_acts()
        self._write(self._encode_line(frame))

    def _encode_line(self, frame: Frame) -> bytes:
        """Return the numbered line of a frame. Texts that are too long for a line are cut."""
        number = self._sent
        self._sent += 1
        text = _encode(frame)
        if len(text) > MAX_FRAME_BYTES - _MAX_NUMBER_LENGTH:
            text = _encode(shorten_frame(frame))
        return b'{"n":%d,%s\n' % (number, text.encode("ascii")[1:])

    def _hold_acts(self) -> None:
        """Add the actions so far to the delayed output, before the next frame."""
        actions = self._acts
        if actions:
            self._acts = []
            self._held += _HEADER.pack(0, len(actions), self._sent) + b"".join(actions)
            self._sent += 1

    def _write(self, data: bytes) -> None:
        self._hold_acts()
        data = self._held + data
        self._held = b""
        while data:
            data = data[os.write(self._writing, data) :]

    def receive(self) -> Frame:
        """Return the next frame. Ends the process if the worker is gone or other code has read from the pipe."""
        while not self._pending:
            self._read_bytes()
        if self._pending[0] == 0:
            return self._receive_packet()
        while True:
            line, newline, rest = self._pending.partition(b"\n")
            if newline:
                self._pending = rest
                number = self._count_received()  # increment even if deep recursion prevents decoding
                frame: Frame = json.loads(line)
                if frame.pop("n") != number:
                    os._exit(0)
                return frame
            self._read_bytes()

    def _receive_packet(self) -> Frame:
        """Return a packet with the time and the sensor readings."""
        while len(self._pending) < _HEADER.size:
            self._read_bytes()
        _, count, number = _HEADER.unpack_from(self._pending)
        numbers = _build_readings_struct(count)
        while len(self._pending) < numbers.size:
            self._read_bytes()
        units, *values = numbers.unpack_from(self._pending)
        self._pending = self._pending[numbers.size :]
        if self._count_received() != number:
            os._exit(0)
        return {"t": units, "v": values}

    def _count_received(self) -> int:
        number = self._received
        self._received += 1
        return number

    def _read_bytes(self) -> None:
        data = os.read(self._reading, _READ_BYTES)
        if not data:
            os._exit(0)
        self._pending += data


@functools.cache
def _build_readings_struct(count: int) -> struct.Struct:
    """Return the struct of a readings packet without its header."""
    return struct.Struct(f"<{_HEADER.size}xq{count - 1}d")


def can_send_text(text: str) -> bool:
    """Return whether a frame can carry ``text``."""
    # Reserves space for the rest of the frame.
    return len(text) * _WIDEST < MAX_FRAME_BYTES - 200 or len(_encode(text)) < MAX_FRAME_BYTES - 200


def shorten_frame(frame: Frame) -> Frame:
    """Return ``frame`` with its long texts cut to the same length, so that it fits a line."""
    texts = [value for value in _list_values(frame) if isinstance(value, str)]
    long_count = sum(len(text) > _NEVER_CUT_LENGTH for text in texts)
    space = MAX_FRAME_BYTES // max(long_count, 1) - _WIDEST * _NEVER_CUT_LENGTH * len(texts)

    def cut(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: each if name == "do" else cut(each) for name, each in value.items()}
        if not isinstance(value, str) or len(value) <= _NEVER_CUT_LENGTH:
            return value
        return clip(value, space // (_WIDEST if max(value) > "\uffff" else _WIDE))

    short_frame: Frame = cut(frame)
    return short_frame


def _list_values(frame: Frame) -> Iterator[Any]:
    for name, value in frame.items():
        if isinstance(value, dict):
            yield from _list_values(value)
        elif name != "do":
            yield value


def clip(text: str, max_length: int = 2000) -> str:
    """Return ``text`` cut to ``max_length`` characters, with a note."""
    return text if len(text) <= max_length else f"{text[:max_length]}… ({len(text)} characters)"
