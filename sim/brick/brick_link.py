"""The brick's end of the bridge: it tells the world what the program does and asks what the program wants to know.

It knows no physics: positions, sensor values and the time come with the answers, and only a wait can change them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NoReturn

Frame = dict[str, Any]

SECOND = 3_000_000  # thirds of a microsecond
READ = SECOND // 100
FREE_READS = 100_000

_WAITS = frozenset({"wait", "read", "until", "until_said", "paid_motor"})


def _unconnected(frame: Frame) -> NoReturn:
    raise RuntimeError("this program is not connected to a robot")


class Link:
    """Holds the connection, the time as last told, and the messages that have arrived."""

    def __init__(self) -> None:
        self.units = 0
        self.number = 1  # of the robot, where there are two
        self.state: dict[str, list[Any]] = {"messages": []}
        self._send: Callable[[Frame], None] = _unconnected
        self._send_later: Callable[[Frame], None] = _unconnected
        self._receive: Callable[[], Frame] | None = None
        self._stuck: Callable[[], None] | None = None
        self._free = 0
        self._sensors: list[str] = []
        self._seen: Frame = {}  # what the sensors read in tick number _seen_in
        self._seen_in = -1
        self._tick = SECOND

    def connect(
        self,
        send: Callable[[Frame], None],
        send_later: Callable[[Frame], None],
        receive: Callable[[], Frame],
        stuck: Callable[[], None],
        sensors: list[str],
        tick: int,
    ) -> None:
        """``send_later`` may hold a frame back until the next one; ``stuck`` ends a program that never waits.

        Each time one of ``sensors`` is read, the world tells what they all give, in this order. Values change every
        ``tick``.
        """
        self._sensors, self._tick = sensors, tick
        self._send, self._send_later, self._receive, self._stuck = send, send_later, receive, stuck

    def tell(self, frame: Frame) -> None:
        """Something happened; no answer is awaited."""
        self.read_freely()
        self._send(frame)

    def tell_later(self, frame: Frame) -> None:
        """Something that shows only once the world moves; it is sent with the next question at the latest."""
        self.read_freely()
        self._send_later(frame)

    def ask(self, frame: Frame) -> Any:
        """The answer's value, once the world has moved as far as the question takes."""
        if frame["do"] in _WAITS:
            self._free = 0
        else:
            self.read_freely()
        self._send(frame)
        assert self._receive is not None
        answer = self._receive()
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
        frame = {"do": "read", "what": what, "times": times}
        end = self.units + times * READ
        if self._seen_in == end // self._tick:
            self._free = 0
            self.units = end
            self._send_later(frame)
            return self._seen[what]
        values = self.ask(frame)
        self._seen = dict(zip(self._sensors, values, strict=True))
        self._seen_in = self.ticks
        return self._seen[what]

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
        self.ask({"do": "wait", "units": round(seconds * SECOND)})


link = Link()


def number(value: float) -> float:
    """Whole numbers as ``int``, so that they print as they do in the simulator."""
    return int(value) if value == int(value) else value


def clock() -> float:
    """Seconds since the program began, in whole ticks, of which the original has thirty a second."""
    link.read_freely()
    return number(link.ticks / 30)
