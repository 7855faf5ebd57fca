"""Packets: the compact encoding of the robot program's frequent actions: sensor reads, waits and motor commands.

A packet stands between the lines of the wire format and is validated as strictly. ``wire.py`` handles all other frames.
"""

from __future__ import annotations

import functools
import itertools
import struct
from collections.abc import Sequence
from typing import NamedTuple

from responders.wire import MAX_FRAME_BYTES, MAX_NUMBER, MAX_UNITS, WireError
from sim.recording import SENSORS


class SensorRead(NamedTuple):
    """Read a sensor. The number counts reading times."""

    sensor: str


class Wait(NamedTuple):
    """Wait. The number is the time in thirds of a microsecond."""


class MotorCommand(NamedTuple):
    """Set a motor's set point to the number (unless it is empty), then send the command (unless it is None)."""

    port: str
    set_point: str
    command: str | None


class LineChange(NamedTuple):
    """The program has come to another line. The number contains two lines: the innermost and the outermost.

    The number 0 means that no more lines follow, because the program exceeded the maximum number of lines.
    """


ActionKind = SensorRead | Wait | MotorCommand | LineChange
Action = tuple[ActionKind, float]

#: First byte of a packet. A line begins with a brace.
PACKET_MARK = 0
#: Mark, number of entries, and frame number.
_HEADER = struct.Struct("<BxHxxxxQ")
#: Code of the action, and its number.
_ACTION = struct.Struct("<Id")
HEADER_BYTES = _HEADER.size
_PORTS = ("outB", "outC")
_SET_POINTS = ("", "speed_sp", "position_sp", "position", "time_sp")
_COMMANDS = (None, "", "reset", "run-forever", "run-timed", "run-to-rel-pos", "run-to-abs-pos", "run-direct")
_READ, _WAIT, _MOVE, _LINE = range(4)
#: Packed numbers are ``outer * factor + inner``, for the outermost and innermost line.
_OUTER_LINE_FACTOR = 1 << 20


def _encode_kind(action_code: int, part: int = 0, set_point: int = 0, command: int = 0) -> int:
    return int.from_bytes((action_code, part, set_point, command), "little")


#: All actions by code: kind, smallest and largest number, and whether the number must be whole.
_KINDS_BY_CODE: dict[int, tuple[ActionKind, float, float, bool]] = {
    _encode_kind(_WAIT): (Wait(), 0, MAX_UNITS, True),
    _encode_kind(_LINE): (LineChange(), 0, _OUTER_LINE_FACTOR**2, True),
    **{_encode_kind(_READ, part): (SensorRead(what), 1, 2, True) for part, what in enumerate(SENSORS)},
    **{
        _encode_kind(_MOVE, part, place, number): (
            MotorCommand(port, set_point, command),
            -MAX_NUMBER,
            MAX_NUMBER,
            False,
        )
        for (part, port), (place, set_point), (number, command) in itertools.product(
            enumerate(_PORTS), enumerate(_SET_POINTS), enumerate(_COMMANDS)
        )
    },
}


def read_header(header: bytes) -> tuple[int, int]:
    """Return the length of a packet and its frame number.

    Raises:
        WireError: If the packet is empty or too long.
    """
    mark, count, number = _HEADER.unpack_from(header)
    size: int = HEADER_BYTES + count * _ACTION.size
    if mark != PACKET_MARK or count == 0 or size > MAX_FRAME_BYTES:
        raise WireError(f"a packet of {count} acts")
    return size, number


def unpack_actions(packet: bytes) -> list[Action]:
    """Return the actions in a packet, in order.

    Raises:
        WireError: If an action is invalid.
    """
    actions = []
    for code, number in _ACTION.iter_unpack(packet[HEADER_BYTES:]):
        kind_limits = _KINDS_BY_CODE.get(code)
        if kind_limits is None:
            raise WireError("an act that there is not")
        kind, minimum, maximum, is_whole = kind_limits
        if not minimum <= number <= maximum or (is_whole and number % 1):
            raise WireError("an act that there is not")
        actions.append((kind, number))
    return actions


def unpack_lines(line_pair: float) -> tuple[int, int]:
    """Return the innermost and the outermost line in the number of a place."""
    outer, inner = divmod(int(line_pair), _OUTER_LINE_FACTOR)
    return inner, outer


def pack_readings(units: int, values: Sequence[float], number: int) -> bytes:
    """Return packet ``number`` for a child: the time in thirds of a microsecond, and all sensor readings."""
    return _build_readings_struct(len(values)).pack(PACKET_MARK, 1 + len(values), number, units, *values)


@functools.cache
def _build_readings_struct(count: int) -> struct.Struct:
    return struct.Struct(f"{_HEADER.format}q{count}d")
