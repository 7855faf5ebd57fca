"""The compact encoding of what a robot program does by the thousand: it reads a sensor, waits, sets a motor.

A packet stands between the lines of the wire and is checked as strictly; every other frame is a line, in ``wire.py``.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

from responders.wire import LARGEST, MOST, MOST_UNITS, WireError
from sim.recording import SENSORS


class Read(NamedTuple):
    """A sensor is read, which takes so many reading times."""

    what: str
    times: int


class Wait(NamedTuple):
    """So much time is to pass, thirds of a microsecond."""

    units: int


class Move(NamedTuple):
    """A motor's set point changes (unless it is empty), then a command begins (unless it is None)."""

    port: str
    set_point: str
    value: float
    command: str | None


Act = Read | Wait | Move

#: What a packet begins with, where a line begins with a brace.
MARK = 0
#: The mark, how many entries follow, and the packet's number among all frames.
_HEADER = struct.Struct("<BxHxxxxQ")
#: What it is, of which part of the robot, a motor's set point and command, and a value.
_ACT = struct.Struct("<BBBBd")
HEADER_BYTES = _HEADER.size
_PORTS = ("outB", "outC")
_SET_POINTS = ("", "speed_sp", "position_sp", "position", "time_sp")
_COMMANDS = (None, "", "reset", "run-forever", "run-timed", "run-to-rel-pos", "run-to-abs-pos", "run-direct")
_READ, _WAIT, _MOVE = range(3)
_READS = {(_READ, part, 0, 0, float(times)): Read(what, times) for part, what in enumerate(SENSORS) for times in (1, 2)}


def packet_bytes(header: bytes) -> int:
    """How long the packet is that begins with ``header``. Raises WireError for one that is empty or too long."""
    mark, count, _ = _HEADER.unpack_from(header)
    size: int = HEADER_BYTES + count * _ACT.size
    if mark != MARK or count == 0 or size > MOST:
        raise WireError(f"a packet of {count} acts")
    return size


def unpack(packet: bytes) -> tuple[int, list[Act]]:
    """The number of a packet, and its acts in order. Raises WireError."""
    acts = [_READS.get(each) or _act(*each) for each in _ACT.iter_unpack(packet[HEADER_BYTES:])]
    return _HEADER.unpack_from(packet)[2], acts


def _act(kind: int, part: int, set_point: int, command: int, value: float) -> Act:
    if kind == _MOVE:
        known = part < len(_PORTS) and set_point < len(_SET_POINTS) and command < len(_COMMANDS)
        if known and -LARGEST <= value <= LARGEST:
            return Move(_PORTS[part], _SET_POINTS[set_point], value, _COMMANDS[command])
    elif kind == _WAIT and (part, set_point, command) == (0, 0, 0) and 0 <= value <= MOST_UNITS and value % 1 == 0:
        return Wait(int(value))
    raise WireError("an act that there is not")


def pack_readings(units: int, values: Sequence[float], number: int) -> bytes:
    """Packet ``number`` for a child: the time, thirds of a microsecond, and what all sensors read."""
    return _HEADER.pack(MARK, 1 + len(values), number) + struct.pack(f"<q{len(values)}d", units, *values)
