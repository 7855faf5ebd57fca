"""How texts travel between robot and responder: a seeded model of delay, loss, duplication and reordering.

It moves no text itself; it says when each copy of one arrives.
"""

from __future__ import annotations

from dataclasses import dataclass

from sim.chance import Stream
from sim.recording import SECOND

#: How much longer a text takes that is overtaken by others.
_HELD_BACK = SECOND


@dataclass(frozen=True, slots=True)
class Channel:
    """Seconds, and chances between 0 and 1. The delay is of the whole way there and back."""

    delay: float = 0.1
    jitter: float = 0.0
    loss: float = 0.0
    duplication: float = 0.0
    reordering: float = 0.0


class ChannelOfTrial:
    """One trial's channel; the chances of a text depend on its number alone."""

    def __init__(self, channel: Channel, seed: int) -> None:
        self._channel = channel
        self._chance = Stream(seed, "channel")

    def copies(self, number: int, index: int = 0) -> int:
        """How often the responder receives text ``number``: 0 when it is lost, 2 when it is doubled.

        Each way has chances of its own, from ``index`` on.
        """
        if self._chance.uniform(number, index) < self._channel.loss:
            return 0
        return 2 if self._chance.uniform(number, index + 1) < self._channel.duplication else 1

    def arrivals(self, number: int, copy: int, sent: int, slept: int) -> tuple[int, ...]:
        """When the answer to a copy of text ``number``, sent at ``sent``, joins the queue; empty when it is lost.

        Times are units of simulated time; ``slept`` is how long the responder slept before it answered.
        """
        index = 16 + 16 * copy
        return tuple(
            sent + slept + self._delay(number, index + 4 * place) for place in range(self.copies(number, index + 8))
        )

    def one_way(self, number: int, sent: int, copies: int) -> tuple[int, ...]:
        """When each copy of text ``number``, sent at ``sent`` to somebody who answers nothing, joins their queue."""
        return tuple(sent + self._delay(number, 16 + 16 * copy) for copy in range(copies))

    def _delay(self, number: int, index: int) -> int:
        seconds = self._channel.delay + self._channel.jitter * self._chance.uniform(number, index)
        held_back = self._chance.uniform(number, index + 1) < self._channel.reordering
        return round(seconds * SECOND) + (_HELD_BACK if held_back else 0)
