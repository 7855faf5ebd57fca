"""How texts travel between robot and responder: a seeded model of delay, loss, duplication, reordering, corruption.

It moves no text itself; it says when each copy of one arrives. Whether the robot is in reach is ``link.py``'s.
"""

from __future__ import annotations

from dataclasses import dataclass
from string import ascii_lowercase, ascii_uppercase, digits
from typing import Literal

from sim.chance import Stream
from sim.recording import SECOND

#: How much longer a text takes that is overtaken by others.
_HELD_BACK = SECOND
_MOST_CHANGED = 3
_ALPHABETS = (digits, ascii_lowercase, ascii_uppercase)


@dataclass(frozen=True, slots=True)
class Channel:
    """Seconds, and chances between 0 and 1. The delay is of the whole way there and back.

    An infrared link, to a beacon or between robots, reaches ``range`` mm, and ``facing`` / 2 degrees to either side of
    where the robot faces.
    """

    delay: float = 0.1
    jitter: float = 0.0
    loss: float = 0.0
    duplication: float = 0.0
    reordering: float = 0.0
    corruption: float = 0.0
    link: Literal["cable", "infrared", "between robots"] = "cable"
    beacon: tuple[float, float] | None = None  # where the responder's end of an infrared link stands
    range: float = 600.0
    facing: float = 90.0
    blocked_by: Literal["obstacles", "nothing"] = "obstacles"


class ChannelOfTrial:
    """One trial's channel; the chances of a text depend on its number alone."""

    def __init__(self, channel: Channel, seed: int) -> None:
        self._channel = channel
        self._chance = Stream(seed, "channel")
        self._corruption = Stream(seed, "corruption")

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

    def corrupted(self, text: str, number: int, index: int = 0) -> str | None:
        """As what ``text`` arrives where it is corrupted, None where it is not.

        One to three of the letters and digits after its prefix become others of their kind.
        """
        chance = self._corruption
        if chance.uniform(number, index) >= self._channel.corruption:
            return None
        begin = text.find("::") + 2 if "::" in text else 0
        places = [place for place in range(begin, len(text)) if _alphabet(text[place])]
        if not places:
            return None
        letters = list(text)
        for turn in range(1 + chance.integer(number, index + 1) % _MOST_CHANGED):
            place = places[chance.integer(number, index + 2 + 2 * turn) % len(places)]
            others = _alphabet(text[place]).replace(text[place], "")
            letters[place] = others[chance.integer(number, index + 3 + 2 * turn) % len(others)]
        return "".join(letters)

    def corrupted_answer(self, text: str, number: int, copy: int, place: int) -> str | None:
        """The same of the answer to a copy of text ``number``, which may itself be doubled."""
        return self.corrupted(text, number, 16 + 16 * copy + 8 * place)

    def _delay(self, number: int, index: int) -> int:
        seconds = self._channel.delay + self._channel.jitter * self._chance.uniform(number, index)
        held_back = self._chance.uniform(number, index + 1) < self._channel.reordering
        return round(seconds * SECOND) + (_HELD_BACK if held_back else 0)


def _alphabet(character: str) -> str:
    return next((each for each in _ALPHABETS if character in each), "")
