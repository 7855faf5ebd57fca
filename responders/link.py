"""Whether a text gets across between robot and receiver as they stand now: by cable always, by infrared in reach.

What chance does to a text on its way is ``channel.py``'s; when it arrives is ``conversation.py``'s.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from responders.channel import Channel
from sim.arena import Arena
from sim.recording import LossReason, Pose
from sim.trigonometry import sincos

_DIGITS = 6  # of a distance or an angle: the last bits are the C library's

#: Says where the receiver is now, mm; a beacon stays, another robot may not.
Receiver = Callable[[], tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Contact:
    """How the robot stands to the receiver, mm and degrees to its left; ``lost`` is why nothing gets across."""

    lost: LossReason = ""
    distance: float | None = None
    angle: float | None = None


class ChannelLink(Protocol):
    """The way between a robot and its receiver."""

    def contact(self) -> Contact:
        """Whether a text would get across now."""
        ...


class Cable:
    """Reaches everywhere."""

    def contact(self) -> Contact:
        """Nothing is ever out of its reach."""
        return Contact()


class InfraredLink:
    """Reaches as far as the channel's range, in front of the robot, along a straight way that nothing blocks.

    All is measured from the middle of the robot's axle.
    """

    def __init__(self, channel: Channel, arena: Arena, robot: Callable[[], Pose], receiver: Receiver) -> None:
        self._channel = channel
        self._arena = arena
        self._robot = robot
        self._receiver = receiver

    def contact(self) -> Contact:
        """Of several reasons the first of range, facing and what stands between."""
        channel, pose, (x, y) = self._channel, self._robot(), self._receiver()
        sine, cosine = sincos(math.radians(pose.heading))
        dx, dy = x - pose.x, y - pose.y
        distance = round(math.hypot(dx, dy), _DIGITS)
        angle = round(math.degrees(math.atan2(cosine * dy - sine * dx, cosine * dx + sine * dy)), _DIGITS)
        lost: LossReason = ""
        if distance > channel.range:
            lost = "out of range"
        elif abs(angle) > channel.facing / 2:
            lost = "facing away"
        elif channel.blocked_by == "obstacles" and self._arena.stands_between((pose.x, pose.y), (x, y)):
            lost = "blocked"
        return Contact(lost, distance, angle)


def link_of(channel: Channel, arena: Arena, robot: Callable[[], Pose]) -> ChannelLink:
    """The link of a robot whose receiver is the channel's beacon, if it has one."""
    beacon = channel.beacon
    if channel.link == "cable" or beacon is None:
        return Cable()
    return InfraredLink(channel, arena, robot, lambda: beacon)
