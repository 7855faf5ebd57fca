"""The link between robot and receiver: whether a text gets through from where they are now.

A cable always connects; infrared needs the receiver in reach. Random losses are in ``channel.py``, arrival times in
``conversation.py``.
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

_DECIMALS = 6  # decimals of a distance or an angle; the last bits depend on the C library

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
