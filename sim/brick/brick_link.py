"""The brick's end of the bridge: it tells the world what the program does and asks what the program wants to know.

It knows no physics: positions, sensor values and the time come with the answers, and only a wait can change them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NoReturn

Frame = dict[str, Any]

TICK = 100_000  # thirds of a microsecond in a thirtieth of a second
SECOND = 30 * TICK
FREE_READS = 100_000

_WAITS = frozenset({"wait", "read", "until", "until_said", "paid_motor"})


def _unconnected(frame: Frame) -> NoReturn:
    raise RuntimeError("this program is not connected to a robot")


class Link:
    """Holds the connection, the time as last told, and the messages that have arrived."""

    def __init__(self) -> None:
        self.units = 0
        self.state: dict[str, list[Any]] = {"messages": []}
        self._send: Callable[[Frame], None] = _unconnected
        self._receive: Callable[[], Frame] | None = None
        self._stuck: Callable[[], None] | None = None
        self._free = 0

    def connect(self, send: Callable[[Frame], None], receive: Callable[[], Frame], stuck: Callable[[], None]) -> None:
        """``stuck`` is called when the program has read too often without ever waiting."""
        self._send, self._receive, self._stuck = send, receive, stuck

    def tell(self, frame: Frame) -> None:
        """Something happened; no answer is awaited."""
        self.read_freely()
        self._send(frame)

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
    """Seconds since the program began, in whole ticks."""
    link.read_freely()
    return number(link.units // TICK / 30)
