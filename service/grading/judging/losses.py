"""What the channel lost of a conversation: by chance, which is nobody's doing, or because the robot was out of reach.

What is worth marks is decided in the modules of the families.
"""

from __future__ import annotations

from sim.recording import Message


def by_chance(message: Message) -> bool:
    """Whether chance kept the text from arriving as it was sent."""
    return message.lost == "chance" or message.arrived_as is not None


def out_of_reach(message: Message) -> bool:
    """Whether it was lost because of where the robot was, or how it stood."""
    return message.lost not in ("", "chance")


def loss_words(message: Message) -> str:
    """What befell a text that did not arrive as it was sent, in brackets behind ``the channel lost it``."""
    match message.lost:
        case "out of range":
            distance = round(message.distance or 0, 1)
            return f"the robot was {distance:g} mm from the receiver, which is out of the link's range"
        case "facing away":
            return f"the robot faced {abs(round(message.angle or 0, 1)):g}° away from the receiver"
        case "blocked":
            return "a wall or an obstacle stood between the robot and the receiver"
        case _:
            return "by chance"
