"""The child's end of the wire: one JSON object a line over one descriptor.

The worker checks every frame as if it came from the internet; here there is nothing to defend.
"""

from __future__ import annotations

import json
import os
from typing import Any

Frame = dict[str, Any]

#: The longest line that the worker accepts, bytes.
MOST = 65536

_encode = json.JSONEncoder(separators=(",", ":"), ensure_ascii=True).encode


class Wire:
    """Sends and receives frames over descriptor ``fd``."""

    def __init__(self, fd: int) -> None:
        self._fd = fd
        self._sent = self._received = 0  # frames
        self._pending = b""
        self._held = b""

    def send_later(self, frame: Frame) -> None:
        """Send with the next frame that cannot wait."""
        self._held += self._line(frame)
        if len(self._held) > MOST // 2:
            self._write(b"")

    def send(self, frame: Frame) -> None:
        """Send now, after what was held back."""
        self._write(self._line(frame))

    def _line(self, frame: Frame) -> bytes:
        """It, beginning with its number; both sides count."""
        number = self._sent
        self._sent += 1
        return b'{"n":%d,%s\n' % (number, _encode(frame).encode("ascii")[1:])

    def _write(self, data: bytes) -> None:
        data = self._held + data
        self._held = b""
        while data:
            data = data[os.write(self._fd, data) :]

    def receive(self) -> Frame:
        """The next frame. Ends the process when the worker has gone, or if somebody else has read what was sent."""
        while True:
            line, newline, rest = self._pending.partition(b"\n")
            if newline:
                self._pending = rest
                number = self._received
                self._received += 1  # even if a program that calls itself too deeply cannot read it
                frame: Frame = json.loads(line)
                if frame.pop("n") != number:
                    os._exit(0)
                return frame
            data = os.read(self._fd, MOST)
            if not data:
                os._exit(0)
            self._pending += data


def fits(text: str) -> bool:
    """Whether a frame can carry ``text``."""
    # Six bytes a character at the most, and some room for the rest of the frame.
    return len(text) * 6 < MOST - 200 or len(_encode(text)) < MOST - 200


def fitted(text: str) -> str:
    """``text``, cut so that a frame can carry it."""
    return text if fits(text) else clip(text, MOST // 6 - 100)


def clip(text: str, most: int = 2000) -> str:
    """``text`` cut to ``most`` characters, saying so."""
    return text if len(text) <= most else f"{text[:most]}… ({len(text)} characters)"
