"""Messages lost by the channel: by chance, or because the robot was out of reach.

The modules of the families decide the marks.
"""

from __future__ import annotations

from sim.recording import Message
from sim.sentences import Sentence


def is_lost_by_chance(message: Message) -> bool:
    """Return whether a random loss or corruption kept the text from arriving as sent."""
    return message.lost == "chance" or message.arrived_as is not None


def is_out_of_reach(message: Message) -> bool:
    """Return whether it was lost because of the robot's position or heading."""
    return message.lost not in ("", "chance")


def describe_loss(message: Message) -> str:
    """Return why a text did not arrive as sent, for use in brackets after ``the channel lost it``."""
    match message.lost:
        case "out of range":
            return Sentence(
                "the robot was %(distance)g mm from the receiver, which is out of the link's range",
                distance=round(message.distance or 0, 1),
            )
        case "facing away":
            angle = abs(round(message.angle or 0, 1))
            return Sentence("the robot faced %(angle)g° away from the receiver", angle=angle)
        case "blocked":
            return Sentence("a wall or an obstacle was between the robot and the receiver")
        case _:
            return Sentence("by chance")
