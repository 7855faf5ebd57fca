"""The robot program's end of the connection to the world: sends actions and requests values.

This module contains no physics. Positions, sensor values and the time come with the answers, and change only when the
program waits.
"""

from __future__ import annotations

import math
import struct
import sys
from collections.abc import Callable, Mapping
from typing import Any, NoReturn, Protocol

Frame = dict[str, Any]

SECOND = 3_000_000  # thirds of a microsecond
READ = SECOND // 100
#: Maximum time of a single wait; longer than any trial.
MAX_UNITS = 10**15
FREE_READS = 100_000

_WAITS = frozenset({"until", "until_said", "paid_motor"})

#: Packed format for frequent actions: kind, part of the robot, set point and command of a motor, and a value.
_pack = struct.Struct("<BBBBd").pack
_READ, _WAIT, _MOTOR, _LINE = range(4)
#: Maximum number of lookups of the current line. A program pays processor time for them. A notification counts as four,
#: because a program that prints without end sends nothing else.
_PLACE_LOOKUPS = 20_000
_LOOKUPS_OF_A_NOTIFICATION = 4
_PORTS = {"outB": 0, "outC": 1}
_SET_POINTS = {"speed_sp": 1, "position_sp": 2, "position": 3, "time_sp": 4}
_COMMANDS = {
    None: 0,
    "": 1,
    "reset": 2,
    "run-forever": 3,
    "run-timed": 4,
    "run-to-rel-pos": 5,
    "run-to-abs-pos": 6,
    "run-direct": 7,
}


class Wire(Protocol):
    """Connection to the world. ``send_later`` and ``act_later`` may buffer data until an urgent message."""

    def send(self, frame: Frame) -> None: ...

    def send_later(self, frame: Frame) -> None: ...

    def act(self, packed: bytes) -> None: ...

    def act_later(self, packed: bytes) -> None: ...

    def receive(self) -> Frame: ...


class _Unconnected:
    def __getattr__(self, name: str) -> NoReturn:
        raise RuntimeError("this program is not connected to a robot")


class Link:
    """Connection to the world, with the last known time and the messages that have arrived."""

    def __init__(self) -> None:
        self.units = 0
        self.number = 1  # of the robot, if there are two
        self.state: dict[str, list[Any]] = {"messages": []}
        self._wire: Wire = _Unconnected()
        self._stuck: Callable[[], None] | None = None
        self._free = 0
        self._sensors: dict[tuple[str, int], tuple[bytes, int, int | slice]] = {}
        self._seen: list[float] = []  # sensor readings, valid until _seen_until
        self._seen_until = 0
        self._tick = SECOND
        self._place: Callable[[], int] = int
        self._sent_place = 0
        self._place_lookups = _PLACE_LOOKUPS

    def connect(
        self,
        wire: Wire,
        stuck: Callable[[], None],
        sensors: Mapping[str, int],
        tick: int,
        place: Callable[[], int] = int,
    ) -> None:
        """Connect to the world. ``stuck`` ends a program that never waits. ``place`` returns the current line.

        For each read of one of ``sensors``, the world sends the values of all sensors in this order. The number given
        for a sensor is the length of its list of values; 0 means a single value. Values change every ``tick``.
        """
        self._wire, self._stuck, self._tick, self._place = wire, stuck, tick, place
        start = 0
        for index, (name, width) in enumerate(sensors.items()):
            selector = slice(start, start + width) if width else start
            for times in (1, 2):
                self._sensors[name, times] = _pack(_READ, index, 0, 0, times), times * READ, selector
            start += width or 1

    def notify(self, frame: Frame) -> None:
        """Send a notification that needs no answer."""
        self.read_freely()
        self._send_place(_LOOKUPS_OF_A_NOTIFICATION)
        self._wire.send(frame)

    def set_motor(
        self, port: str, command: str | None = None, polarity: str | None = None, **set_points: float
    ) -> None:
        """Send set points and a command with the next wait. They take effect only when the world moves."""
        self.read_freely()
        self._send_place()
        if command not in _COMMANDS:
            raise ValueError(
                f"a motor has no command {command!r}: expected one of {', '.join(filter(None, _COMMANDS))}"
            )
        if polarity is not None:
            self._wire.send_later({"do": "polarity", "port": port, "polarity": polarity})
        part, remaining = _PORTS[port], len(set_points)
        for name, value in set_points.items():
            remaining -= 1
            self._wire.act_later(
                _pack(
                    _MOTOR,
                    part,
                    _SET_POINTS[name],
                    0 if remaining else _COMMANDS[command],
                    clamp_to_finite(name, value),
                )
            )
        if not set_points and command is not None:
            self._wire.act_later(_pack(_MOTOR, part, 0, _COMMANDS[command], 0))

    def run_forever(self, port: str, speed: float) -> None:
        """Set a speed and run. This is a fast path of ``set_motor`` for programs that steer all the time."""
        self.read_freely()
        self._send_place()
        self._wire.act_later(_pack(_MOTOR, _PORTS[port], _SET_POINTS["speed_sp"], _COMMANDS["run-forever"], speed))

    def ask(self, frame: Frame) -> Any:
        """Send a question and return the value of the answer. The world moves as far as the question requires."""
        if frame["do"] in _WAITS:
            self._free = 0
        else:
            self.read_freely()
        self._send_place()
        self._wire.send(frame)
        return self._receive_answer()

    def _send_place(self, lookups: int = 1) -> None:
        """Send the line of the program that is running, if it has changed; 0 once if no more lines follow."""
        if self._place_lookups < 0:
            return
        self._place_lookups -= lookups
        place = self._place() if self._place_lookups >= 0 else 0
        if place != self._sent_place:
            self._sent_place = place
            self._wire.act_later(_pack(_LINE, 0, 0, 0, place))

    def _receive_answer(self) -> Any:
        answer = self._wire.receive()
        self.units = answer["t"]
        message = answer.get("m")
        if message:
            # New messages go into a new dictionary, so that a dictionary returned earlier does not change.
            self.state = {"messages": [*self.state["messages"], *message]}
        return answer.get("v")

    def read(self, what: str, times: int) -> Any:
        """Return a sensor's value after ``times`` reading times.

        Values change only at ticks. If the reading ends before the next tick, the value is already known. The world
        then gets a notification instead of a question, and counts the time by the same rule.
        """
        packed, duration, selector = self._sensors[what, times]
        self._free = 0
        self._send_place()
        end = self.units + duration
        if end < self._seen_until:
            self.units = end
            self._wire.act_later(packed)
        else:
            self._wire.act(packed)
            self._seen = self._receive_answer()
            self._seen_until = (self.ticks + 1) * self._tick
        return self._seen[selector]

    @property
    def ticks(self) -> int:
        """The number of ticks that have passed."""
        return self.units // self._tick

    def read_freely(self) -> None:
        """Count an action that costs no time. The world cannot move during such actions."""
        self._free += 1
        if self._free > FREE_READS and self._stuck is not None:
            self._stuck()

    def wait(self, seconds: float) -> None:
        """Advance the world by this time."""
        self.wait_units(round(seconds * SECOND))

    def wait_units(self, units: int) -> None:
        """Advance the world by this time in thirds of a microsecond, at most the maximum wait."""
        self._free = 0
        self._send_place()
        self._wire.act(_pack(_WAIT, 0, 0, 0, min(units, MAX_UNITS)))
        self._receive_answer()


link = Link()


def clamp_to_finite(name: str, value: float) -> float:
    """Return the nearest number that the world can represent.

    Raises:
        ValueError: The value is NaN.
    """
    if math.isnan(value):
        raise ValueError(f"{name} is not a number ({value})")
    return min(max(float(value), -sys.float_info.max), sys.float_info.max)


def to_plain_number(value: float) -> float:
    """Return whole numbers as ``int``, so that they print as in the simulator."""
    return int(value) if value == int(value) else value


def read_clock() -> float:
    """Return the seconds since the start of the program, in whole ticks. The original has thirty ticks a second."""
    link.read_freely()
    return to_plain_number(link.ticks / 30)
