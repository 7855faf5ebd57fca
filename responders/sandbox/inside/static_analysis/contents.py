"""Contents of one file, or of the cells of one notebook: its units of code, and what each mentions where.

``syntax_walker.py`` fills them. ``reader.py`` applies the rules.
"""

from __future__ import annotations

import ast
from typing import NamedTuple

from .units import CodeUnit, Mention, SourcePlace
from .vocabulary import DOUBTFUL, MAGICS, RUNNERS, TABLES

#: Maximum number of places kept per mention.
_MAX_PLACES = 200


class Context(NamedTuple):
    """Whether code is reachable when its unit runs, and whether it is in a loop."""

    live: bool = True
    looped: bool = False


class CodeContents:
    """The contents, and the place in the source from which more are added."""

    def __init__(self) -> None:
        """Start with no contents."""
        self.units: list[CodeUnit] = []
        #: Files that a notebook writes: names and texts.
        self.written: list[tuple[str, str]] = []
        #: Names that the source defines itself.
        self.made: set[str] = set()
        self._file = ""
        self._unit = CodeUnit("")
        self._statement = (0, 0)  # start of the current statement

    def _begin_unit(self, file: str, unit: CodeUnit) -> None:
        self._file, self._unit = file, unit
        self.units.append(unit)

    def _add_mention(
        self, kind: str, name: str, node: ast.AST, context: Context, statement: tuple[int, int] | None = None
    ) -> None:
        """Add a mention. ``statement`` is the start of the statement that has to run for it, or the current one."""
        if name:
            place = SourcePlace(self._file, getattr(node, "lineno", 0), statement or self._statement)
            places = self._unit.mentions.setdefault(Mention(kind, name, context.live, context.looped), [])
            if len(places) < _MAX_PLACES:
                places.append(place)

    def _add_text_name(self, text: str, node: ast.AST, context: Context) -> None:
        self._add_mention("handed_on", text, node, context)
        self._add_mention("name", text, node, context)
        for part in sorted(DOUBTFUL.intersection(text.split("."))):
            self._add_mention("any_name" if part in TABLES | RUNNERS | MAGICS else "doubt", part, node, context)

    def _add_name_or_doubt(self, call: str, text: str | None, node: ast.AST, context: Context) -> None:
        if text is None:
            self._add_mention("any_name", call, node, context)
        else:
            self._add_text_name(text, node, context)
