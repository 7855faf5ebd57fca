"""What is written down of a file that is read: what stands in it, where, and which code is run at one go.

Finding it is ``walk.py``'s, and what the rules make of it ``reader.py``'s.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple


class Mention(NamedTuple):
    """Something that stands in a file; ``live`` if the code that is run with its unit can come to it.

    The kinds are ``construct``, ``function`` (it is defined), ``name``, ``call``, ``handed_on`` (kept or given away),
    ``base`` (something of it is asked for), ``unsure`` (handed on, if it is not a name of the text's own), ``import``,
    ``through`` (something of a module), ``taken`` (out of a module), ``doubt`` and ``any_name``, which is doubt about
    what may take anything by its name.
    """

    kind: str
    name: str
    live: bool
    looped: bool


class SourcePlace(NamedTuple):
    """A file's name, as messages have it, and a line; and where the statement begins that has to be run for it."""

    file: str
    line: int
    statement: tuple[int, int] = (0, 0)


@dataclass(eq=False, slots=True)
class Unit:
    """Code that is run at one go: a file's or a function's own. ``owner`` is the class that it is a method of.

    Of each mention the first places are kept.
    """

    name: str
    owner: str = ""
    made_in: Unit | None = None
    made: bool = True  # its definition can be come to
    always: bool = False  # it is run without being named
    mentions: dict[Mention, list[SourcePlace]] = field(default_factory=dict)
    units: list[Unit] = field(default_factory=list)
