"""The brick's end of the bridge: it tells the world what the program does and asks what the program wants to know.

It knows no physics: positions, sensor values and the time come with the answers, and only a wait can change them.
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
#: The longest time that the world lets pass at once: longer than any trial.
MOST_UNITS = 10**15
FREE_READS = 100_000

_WAITS = frozenset({"until", "until_said", "paid_motor"})

#: Acts that programs do by the thousand go packed: what it is, of which part of the robot, a motor's set point and
#: command, and a value.
_packed = struct.Struct("<BBBBd").pack
_READ, _WAIT, _MOTOR = range(3)
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
    """What leads to the world; one that sends later may hold things back until something cannot wait."""

    def send(self, frame: Frame) -> None: ...

    def send_later(self, frame: Frame) -> None: ...

    def act(self, packed: bytes) -> None: ...

    def act_later(self, packed: bytes) -> None: ...

    def receive(self) -> Frame: ...


class _Unconnected:
    def __getattr__(self, name: str) -> NoReturn:
        raise RuntimeError("this program is not connected to a robot")


class Link:
    """Holds the connection, the time as last told, and the messages that have arrived."""

    def __init__(self) -> None:
        self.units = 0
        self.number = 1  # of the robot, where there are two
        self.state: dict[str, list[Any]] = {"messages": []}
        self._wire: Wire = _Unconnected()
        self._stuck: Callable[[], None] | None = None
        self._free = 0
        self._sensors: dict[tuple[str, int], tuple[bytes, int, int | slice]] = {}
        self._seen: list[float] = []  # what the sensors read up to _seen_until
        self._seen_until = 0
        self._tick = SECOND

    def connect(self, wire: Wire, stuck: Callable[[], None], sensors: Mapping[str, int], tick: int) -> None:
        """``stuck`` ends a program that never waits.

        Each time one of ``sensors`` is read, the world tells what they all give, in this order: so many numbers each,
        0 for one that stands alone. Values change every ``tick``.
        """
        self._wire, self._stuck, self._tick = wire, stuck, tick
        start = 0
        for index, (name, width) in enumerate(sensors.items()):
            where = slice(start, start + width) if width else start
            for times in (1, 2):
                self._sensors[name, times] = _packed(_READ, index, 0, 0, times), times * READ, where
            start += width or 1

    def tell(self, frame: Frame) -> None:
        """Something happened; no answer is awaited."""
        self.read_freely()
        self._wire.send(frame)

    def set_motor(
        self, port: str, command: str | None = None, polarity: str | None = None, **set_points: float
    ) -> None:
        """Set points, and then a command; they show only once the world moves, so they are sent with what waits."""
        self.read_freely()
        if command not in _COMMANDS:
            raise ValueError(
                f"a motor has no command {command!r}: expected one of {', '.join(filter(None, _COMMANDS))}"
            )
        if polarity is not None:
            self._wire.send_later({"do": "polarity", "port": port, "polarity": polarity})
        part, left = _PORTS[port], len(set_points)
        for name, value in set_points.items():
            left -= 1
            self._wire.act_later(
                _packed(_MOTOR, part, _SET_POINTS[name], 0 if left else _COMMANDS[command], finite(name, value))
            )
        if not set_points and command is not None:
            self._wire.act_later(_packed(_MOTOR, part, 0, _COMMANDS[command], 0))

    def run_forever(self, port: str, speed: float) -> None:
        """What ``set_motor`` does for the programs that steer all the time."""
        self.read_freely()
        self._wire.act_later(_packed(_MOTOR, _PORTS[port], _SET_POINTS["speed_sp"], _COMMANDS["run-forever"], speed))

    def ask(self, frame: Frame) -> Any:
        """The answer's value, once the world has moved as far as the question takes."""
        if frame["do"] in _WAITS:
            self._free = 0
        else:
            self.read_freely()
        self._wire.send(frame)
        return self._answer()

    def _answer(self) -> Any:
        answer = self._wire.receive()
        self.units = answer["t"]
        arrived = answer.get("m")
        if arrived:
            # A new dictionary for new messages: what a program took earlier stays as it was.
            self.state = {"messages": [*self.state["messages"], *arrived]}
        return answer.get("v")

    def read(self, what: str, times: int) -> Any:
        """A sensor's value after ``times`` reading times.

        Values change only at ticks: a reading that ends before the next one is known already, so the world is told
        of it and not asked. The world counts the time by the same rule, and gives no answer then.
        """
        packed, lasts, where = self._sensors[what, times]
        self._free = 0
        end = self.units + lasts
        if end < self._seen_until:
            self.units = end
            self._wire.act_later(packed)
        else:
            self._wire.act(packed)
            self._seen = self._answer()
            self._seen_until = (self.ticks + 1) * self._tick
        return self._seen[where]

    @property
    def ticks(self) -> int:
        """How many there were."""
        return self.units // self._tick

    def read_freely(self) -> None:
        """Count an act that costs no time; the world cannot move while a program only does these."""
        self._free += 1
        if self._free > FREE_READS and self._stuck is not None:
            self._stuck()

    def wait(self, seconds: float) -> None:
        """Let the world move for that long."""
        self.wait_units(round(seconds * SECOND))

    def wait_units(self, units: int) -> None:
        """The same, in thirds of a microsecond; a trial ends long before the longest."""
        self._free = 0
        self._wire.act(_packed(_WAIT, 0, 0, 0, min(units, MOST_UNITS)))
        self._answer()


link = Link()


def finite(name: str, value: float) -> float:
    """The nearest number that the world knows. Raises ValueError for NaN."""
    if math.isnan(value):
        raise ValueError(f"{name} is not a number ({value})")
    return min(max(float(value), -sys.float_info.max), sys.float_info.max)


def number(value: float) -> float:
    """Whole numbers as ``int``, so that they print as they do in the simulator."""
    return int(value) if value == int(value) else value


def clock() -> float:
    """Seconds since the program began, in whole ticks, of which the original has thirty a second."""
    link.read_freely()
    return number(link.ticks / 30)
