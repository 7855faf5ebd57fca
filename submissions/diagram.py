"""A block or sequence diagram as a notebook's ``%%blockdiag`` or ``%%seqdiag`` cell describes it.

Plain data; reading the text is ``diagram_text.py``'s, drawing it the service's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

DiagramKind = Literal["blockdiag", "seqdiag"]
Line = Literal["solid", "dashed", "dotted"]
Heads = Literal["target", "both", "none"]
_CHARACTERS_OF_PART = 200


@dataclass(frozen=True, slots=True)
class DiagramActor:
    """A box or a lane. Colours are what the text says, a CSS name or ``#rrggbb``; empty for the usual ones."""

    name: str
    label: str
    shape: str = "box"
    colour: str = ""
    text_colour: str = ""
    line: Line = "solid"


@dataclass(frozen=True, slots=True)
class DiagramArrow:
    """From one actor to another, by their names; ``note`` stands beside it, on the side that it names."""

    source: str
    target: str
    label: str = ""
    line: Line = "solid"
    heads: Heads = "target"
    open_head: bool = False  # ->>, a message that nobody waits for
    failed: bool = False
    colour: str = ""
    note: str = ""
    note_side: Literal["left", "right"] = "right"


@dataclass(frozen=True, slots=True)
class Divider:
    """A line across all lanes; a ``delay`` is where time passes."""

    text: str
    delay: bool = False


@dataclass(frozen=True, slots=True)
class ActorGroup:
    """Actors that stand in one frame."""

    label: str
    members: tuple[str, ...]
    colour: str = ""


@dataclass(frozen=True, slots=True)
class Diagram:
    """Actors in the order in which they are named first, and steps in the order of the text."""

    kind: DiagramKind
    actors: tuple[DiagramActor, ...]
    steps: tuple[DiagramArrow | Divider, ...]
    groups: tuple[ActorGroup, ...] = ()
    portrait: bool = False

    @property
    def parts(self) -> int:
        """What drawing it takes: an actor, step, group or piece of text of 200 characters is one part."""
        texts = sum(len(actor.label) for actor in self.actors)
        for step in self.steps:
            texts += len(step.text) if isinstance(step, Divider) else len(step.label) + len(step.note)
        return len(self.actors) + len(self.steps) + len(self.groups) + texts // _CHARACTERS_OF_PART

    @property
    def arrows(self) -> tuple[DiagramArrow, ...]:
        """The steps that are arrows."""
        return tuple(step for step in self.steps if isinstance(step, DiagramArrow))
