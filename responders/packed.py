"""The compact encoding of what a robot program does by the thousand: it reads a sensor, waits, sets a motor.

A packet stands between the lines of the wire and is checked as strictly; every other frame is a line, in ``wire.py``.
"""

from __future__ import annotations

import functools
import itertools
import struct
from collections.abc import Sequence
from typing import NamedTuple

from responders.wire import LARGEST, MOST, MOST_UNITS, WireError
from sim.recording import SENSORS


class Read(NamedTuple):
    """A sensor is read, which takes so many reading times."""

    what: str


class Wait(NamedTuple):
    """So much time is to pass, thirds of a microsecond."""


class MotorCommand(NamedTuple):
    """A motor's set point becomes this (unless it is empty), then a command begins (unless it is None)."""

    port: str
    set_point: str
    command: str | None


Kind = Read | Wait | MotorCommand
Act = tuple[Kind, float]

#: What a packet begins with, where a line begins with a brace.
MARK = 0
#: The mark, how many entries follow, and the packet's number among all frames.
_HEADER = struct.Struct("<BxHxxxxQ")
#: Of what kind it is, and a number.
_ACT = struct.Struct("<Id")
HEADER_BYTES = _HEADER.size
_PORTS = ("outB", "outC")
_SET_POINTS = ("", "speed_sp", "position_sp", "position", "time_sp")
_COMMANDS = (None, "", "reset", "run-forever", "run-timed", "run-to-rel-pos", "run-to-abs-pos", "run-direct")
_READ, _WAIT, _MOVE = range(3)


def _code(what: int, part: int = 0, set_point: int = 0, command: int = 0) -> int:
    return int.from_bytes((what, part, set_point, command), "little")


#: Every kind that there is by its code, with the least and the greatest of its numbers, and whether they are whole.
_KINDS: dict[int, tuple[Kind, float, float, bool]] = {
    _code(_WAIT): (Wait(), 0, MOST_UNITS, True),
    **{_code(_READ, part): (Read(what), 1, 2, True) for part, what in enumerate(SENSORS)},
    **{
        _code(_MOVE, part, place, number): (MotorCommand(port, set_point, command), -LARGEST, LARGEST, False)
        for (part, port), (place, set_point), (number, command) in itertools.product(
            enumerate(_PORTS), enumerate(_SET_POINTS), enumerate(_COMMANDS)
        )
    },
}


def read_header(header: bytes) -> tuple[int, int]:
    """How long the packet is that begins so, and its number. Raises WireError for one that is empty or too long."""
    mark, count, number = _HEADER.unpack_from(header)
    size: int = HEADER_BYTES + count * _ACT.size
    if mark != MARK or count == 0 or size > MOST:
        raise WireError(f"a packet of {count} acts")
    return size, number


def acts_of(packet: bytes) -> list[Act]:
    """What a whole packet asks for, in order. Raises WireError."""
    acts = []
    for code, number in _ACT.iter_unpack(packet[HEADER_BYTES:]):
        known = _KINDS.get(code)
        if known is None:
            raise WireError("an act that there is not")
        kind, least, most, whole = known
        if not least <= number <= most or (whole and number % 1):
            raise WireError("an act that there is not")
        acts.append((kind, number))
    return acts


def pack_readings(units: int, values: Sequence[float], number: int) -> bytes:
    """Packet ``number`` for a child: the time, thirds of a microsecond, and what all sensors read."""
    return _readings(len(values)).pack(MARK, 1 + len(values), number, units, *values)


@functools.cache
def _readings(count: int) -> struct.Struct:
    return struct.Struct(f"{_HEADER.format}q{count}d")
