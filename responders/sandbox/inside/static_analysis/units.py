"""Data structures for the contents of a file: mentions, their places, and the units of code that run together.

``syntax_walker.py`` fills them. ``reader.py`` applies the rules.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple


class Mention(NamedTuple):
    """A name or construct in a file. ``live`` is True if it is reachable when its unit runs.

    The kinds are:

    - ``construct``, ``name``, ``call``, ``import``
    - ``function``: a definition
    - ``handed_on``: stored or passed on
    - ``base``: the object of an attribute
    - ``unsure``: passed on, if it is not defined in the file
    - ``through``: an attribute of a module
    - ``taken``: imported from a module
    - ``doubt``: code that the analysis can't follow
    - ``any_name``: doubt about code that may look up any name
    """

    kind: str
    name: str
    live: bool
    looped: bool


class SourcePlace(NamedTuple):
    """A file name as shown in messages, a line, and the start of the statement that has to run for it."""

    file: str
    line: int
    statement: tuple[int, int] = (0, 0)


@dataclass(eq=False, slots=True)
class CodeUnit:
    """Code that runs together: of a file or a function. ``owner`` is the class of a method.

    For each mention, only the first places are kept.
    """

    name: str
    owner: str = ""
    made_in: CodeUnit | None = None
    made: bool = True  # its definition is reachable
    always: bool = False  # it runs without being named
    mentions: dict[Mention, list[SourcePlace]] = field(default_factory=dict)
    units: list[CodeUnit] = field(default_factory=list)
