"""Block and sequence diagrams, as described by a notebook's ``%%blockdiag`` and ``%%seqdiag`` cells.

The classes are plain data. ``diagram_text.py`` parses the text and ``service`` draws the diagram.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

DiagramKind = Literal["blockdiag", "seqdiag"]
LineStyle = Literal["solid", "dashed", "dotted"]
ArrowHeads = Literal["target", "both", "none"]
_CHARACTERS_OF_PART = 200


@dataclass(frozen=True, slots=True)
class DiagramActor:
    """A box or a lifeline. Colours are CSS names or ``#rrggbb`` as in the text; empty for the default."""

    name: str
    label: str
    shape: str = "box"
    colour: str = ""
    text_colour: str = ""
    line: LineStyle = "solid"


@dataclass(frozen=True, slots=True)
class DiagramArrow:
    """An arrow between two actors, given by name. ``note`` is a text on the side named by ``note_side``."""

    source: str
    target: str
    label: str = ""
    line: LineStyle = "solid"
    heads: ArrowHeads = "target"
    open_head: bool = False  # ->>, a message without waiting
    failed: bool = False
    colour: str = ""
    note: str = ""
    note_side: Literal["left", "right"] = "right"


@dataclass(frozen=True, slots=True)
class Divider:
    """A line across all lifelines; a ``delay`` marks elapsed time."""

    text: str
    delay: bool = False


@dataclass(frozen=True, slots=True)
class ActorGroup:
    """Actors in a common frame."""

    label: str
    members: tuple[str, ...]
    colour: str = ""


@dataclass(frozen=True, slots=True)
class Diagram:
    """Actors in order of first mention, and steps in the order of the text."""

    kind: DiagramKind
    actors: tuple[DiagramActor, ...]
    steps: tuple[DiagramArrow | Divider, ...]
    groups: tuple[ActorGroup, ...] = ()
    portrait: bool = False

    @property
    def parts(self) -> int:
        """The effort to draw it: one part per actor, step, group and 200 characters of text."""
        text_length = sum(len(actor.label) for actor in self.actors)
        for step in self.steps:
            text_length += len(step.text) if isinstance(step, Divider) else len(step.label) + len(step.note)
        return len(self.actors) + len(self.steps) + len(self.groups) + text_length // _CHARACTERS_OF_PART

    @property
    def arrows(self) -> tuple[DiagramArrow, ...]:
        """The steps that are arrows."""
        return tuple(step for step in self.steps if isinstance(step, DiagramArrow))
