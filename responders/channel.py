"""The channel between robot and responder: a seeded model of delay, loss, duplication, reordering and corruption.

Its link decides whether a text gets through from where the robot is. ``conversation.py`` moves the texts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from string import ascii_lowercase, ascii_uppercase, digits
from typing import TYPE_CHECKING, Literal, Protocol

from sim.random_streams import RandomStream
from sim.recording import SECOND, LossReason, Pose
from sim.trigonometry import sincos

if TYPE_CHECKING:
    from sim.arena import Arena

#: Extra delay of a text that is reordered.
_REORDERING_DELAY = SECOND
_MAX_CHANGED_CHARACTERS = 3
_DECIMALS = 6  # decimals of a distance or an angle; the last bits depend on the C library
_ALPHABETS = (digits, ascii_lowercase, ascii_uppercase)


@dataclass(frozen=True, slots=True)
class Channel:
    """Options of a channel: times in seconds, probabilities from 0 to 1. ``delay`` is for the round trip.

    An infrared link, to a beacon or between robots, reaches ``range`` mm, and ``facing`` / 2 degrees to either side of
    the robot's heading.
    """

    delay: float = 0.1
    jitter: float = 0.0
    loss: float = 0.0
    duplication: float = 0.0
    reordering: float = 0.0
    corruption: float = 0.0
    link: Literal["cable", "infrared", "between robots"] = "cable"
    beacon: tuple[float, float] | None = None  # position of the beacon of an infrared link, mm
    range: float = 600.0
    facing: float = 90.0
    blocked_by: Literal["obstacles", "nothing"] = "obstacles"


class TrialChannel:
    """The channel of one trial. The random draws for a text depend only on its number.

    Texts with the numbers in ``never_lost``, and their answers, are not lost by chance.
    """

    def __init__(self, channel: Channel, seed: int, never_lost: frozenset[int] = frozenset()) -> None:
        self._channel = channel
        self._never_lost = never_lost
        self._chance = RandomStream(seed, "channel")
        self._corruption = RandomStream(seed, "corruption")

    def count_copies(self, number: int, index: int = 0) -> int:
        """Return how many copies of text ``number`` the responder receives: 0 if lost, 2 if duplicated, otherwise 1.

        The draws start at ``index``, so that each direction has its own.
        """
        if number not in self._never_lost and self._chance.uniform(number, index) < self._channel.loss:
            return 0
        return 2 if self._chance.uniform(number, index + 1) < self._channel.duplication else 1

    def compute_arrivals(self, number: int, copy: int, sent_at: int, slept: int) -> tuple[int, ...]:
        """Return the arrival times of the answer to one copy of text ``number``; empty if the answer is lost.

        Args:
            number: The number of the text among the robot's texts.
            copy: The copy of the text that is answered, from 0.
            sent_at: When the text was sent, in units of simulated time.
            slept: How long the responder slept before it answered, in the same units.
        """
        index = 16 + 16 * copy
        return tuple(
            sent_at + slept + self._compute_delay(number, index + 4 * place)
            for place in range(self.count_copies(number, index + 8))
        )

    def compute_one_way_arrivals(self, number: int, sent_at: int, copies: int) -> tuple[int, ...]:
        """Return the arrival times of the copies of a text that needs no answer, sent to the other robot."""
        return tuple(sent_at + self._compute_delay(number, 16 + 16 * copy) for copy in range(copies))

    def corrupt_text(self, text: str, number: int, index: int = 0) -> str | None:
        """Return the corrupted form of ``text``, or None if it arrives unchanged.

        Corruption replaces one to three letters or digits after the prefix with others of the same kind.
        """
        corruption = self._corruption
        if corruption.uniform(number, index) >= self._channel.corruption:
            return None
        start = text.find("::") + 2 if "::" in text else 0
        places = [place for place in range(start, len(text)) if _find_alphabet(text[place])]
        if not places:
            return None
        letters = list(text)
        for turn in range(1 + corruption.integer(number, index + 1) % _MAX_CHANGED_CHARACTERS):
            place = places[corruption.integer(number, index + 2 + 2 * turn) % len(places)]
            alternatives = _find_alphabet(text[place]).replace(text[place], "")
            letters[place] = alternatives[corruption.integer(number, index + 3 + 2 * turn) % len(alternatives)]
        return "".join(letters)

    def corrupt_answer(self, text: str, number: int, copy: int, index: int) -> str | None:
        """Return the corrupted form of an answer to a copy of text ``number``, or None. ``index`` counts duplicates."""
        return self.corrupt_text(text, number, 16 + 16 * copy + 8 * index)

    def _compute_delay(self, number: int, index: int) -> int:
        seconds = self._channel.delay + self._channel.jitter * self._chance.uniform(number, index)
        is_reordered = self._chance.uniform(number, index + 1) < self._channel.reordering
        return round(seconds * SECOND) + (_REORDERING_DELAY if is_reordered else 0)


def _find_alphabet(character: str) -> str:
    return next((each for each in _ALPHABETS if character in each), "")


#: Returns the current position of the receiver, mm. A beacon is fixed; another robot may move.
Receiver = Callable[[], tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Contact:
    """Distance (mm) and bearing (degrees to the left) of the receiver; ``lost`` is the reason for no contact."""

    lost: LossReason = ""
    distance: float | None = None
    angle: float | None = None


class ChannelLink(Protocol):
    """The link between a robot and its receiver."""

    def measure_contact(self) -> Contact:
        """Return whether a text gets through now, with distance and angle."""
        ...


class Cable:
    """A link without limits."""

    def measure_contact(self) -> Contact:
        """Return an unrestricted contact."""
        return Contact()


class InfraredLink:
    """A link with limited range and angle that obstacles can block.

    All distances and angles are measured from the middle of the robot's axle.
    """

    def __init__(self, channel: Channel, arena: Arena, robot: Callable[[], Pose], receiver: Receiver) -> None:
        self._channel = channel
        self._arena = arena
        self._robot = robot
        self._receiver = receiver

    def measure_contact(self) -> Contact:
        """Return the contact. The first failed test of range, facing and obstacles gives the reason."""
        channel, pose, (x, y) = self._channel, self._robot(), self._receiver()
        sine, cosine = sincos(math.radians(pose.heading))
        dx, dy = x - pose.x, y - pose.y
        distance = round(math.hypot(dx, dy), _DECIMALS)
        angle = round(math.degrees(math.atan2(cosine * dy - sine * dx, cosine * dx + sine * dy)), _DECIMALS)
        loss_reason: LossReason = ""
        if distance > channel.range:
            loss_reason = "out of range"
        elif abs(angle) > channel.facing / 2:
            loss_reason = "facing away"
        elif channel.blocked_by == "obstacles" and self._arena.is_blocked_between((pose.x, pose.y), (x, y)):
            loss_reason = "blocked"
        return Contact(loss_reason, distance, angle)


def build_link(channel: Channel, arena: Arena, robot: Callable[[], Pose]) -> ChannelLink:
    """Return the link of a robot whose receiver, if any, is the channel's beacon."""
    beacon = channel.beacon
    if channel.link == "cable" or beacon is None:
        return Cable()
    return InfraredLink(channel, arena, robot, lambda: beacon)
