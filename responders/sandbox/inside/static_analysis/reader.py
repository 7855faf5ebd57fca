"""Reads the files of a submission and finds the places that match each rule. It runs in a child.

The worker decides whether a rule is broken and writes the messages.
"""

from __future__ import annotations

import ast
import importlib.machinery
import itertools
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from fnmatch import fnmatchcase
from typing import Any

from .. import cell_source
from ..excluded_modules import find_exclusion
from .node_properties import is_doubtful_import
from .syntax_walker import SyntaxWalker
from .units import CodeUnit, Mention, SourcePlace
from .vocabulary import CONSTRUCTS, PLAIN_MODULES

_IMPORT = "import "
_CONSTRUCTS = frozenset({*CONSTRUCTS.values(), "else"})
_MAX_TEXT_LENGTH = 300_000
_MAX_TOTAL_LENGTH = 1_000_000
#: Sufficient for all source that the parser accepts.
_RECURSION_LIMIT = 30_000
_MAX_DOUBTS = 4
_MAX_NAME_LENGTH = 60
#: Modules of the course that robot programs use but don't import, and that responders don't have.
_COURSE_MODULES = frozenset({"brick_link", "brick_preambles"})

PlaceRow = list[Any] | None
#: For each kind of mention, the first place of each name.
Places = Mapping[str, Mapping[str, SourcePlace]]


def read(
    files: Sequence[Mapping[str, Any]],
    rules: Mapping[str, Sequence[str]],
    executed_statements: Sequence[Sequence[Any]] | None = None,
) -> dict[str, Any]:
    """Return the places for the rules in ``rules``.

    Args:
        files: Each has a ``name`` (empty for the main part) and a ``text``, ``bytes`` (as Latin-1) or ``cells``.
        rules: Lists of rules: ``uses``, ``avoids``, ``in_loop``, ``defines``, ``shown`` and ``entries``.
        executed_statements: The executed statements (file, line, column), if known. Then only these count as used or
            called in a loop.

    Returns:
        For each rule the file name and line, or None. ``unread`` is the first unreadable file and the reason. Invalid
        Python in cells, and in files beside the main part, is not reported there because it can't run.
    """
    reading = _SubmissionReader(files)
    units = reading.units
    all_places = _collect_first_places(
        (mention, places[0]) for unit in units for mention, places in unit.mentions.items()
    )
    reachable_places = _collect_first_places(
        _collect_reachable(
            units,
            rules["entries"],
            None if executed_statements is None else {(name, (*at,)) for name, *at in executed_statements},
        )
    )
    foreign_places = _exclude_own_names(reachable_places, reading.made - set(rules["defines"]), reading.own)
    return {
        "unread": reading.unread,
        "uses": [_find_first_place(foreign_places, rule, _USED_KINDS) for rule in rules["uses"]],
        "avoids": [_find_first_place(all_places, rule, _AVOIDED_KINDS) for rule in rules["avoids"]],
        "in_loop": [_find_first_place(foreign_places, rule, {"()": ("looped",)}) for rule in rules["in_loop"]],
        "defines": [_format_place(reachable_places["function"].get(name)) for name in rules["defines"]],
        "shown": [_find_first_place(all_places, rule, _AVOIDED_KINDS) for rule in rules["shown"]],
        "doubts": _collect_doubts(all_places, rules["avoids"])[:_MAX_DOUBTS] if rules["avoids"] else [],
    }


class _SubmissionReader:
    """All files, read in order, including those that a notebook writes."""

    def __init__(self, files: Sequence[Mapping[str, Any]]) -> None:
        self.units: list[CodeUnit] = []
        self.unread: list[Any] | None = None
        self._remaining_characters = _MAX_TOTAL_LENGTH
        self.made: set[str] = set()
        self.own = {str(file["name"]).partition(".")[0] for file in files}
        for file in files:
            self._read_file(file)

    def _read_file(self, file: Mapping[str, Any]) -> None:
        name = str(file["name"])
        walker = SyntaxWalker(self._describe_doubt)
        if "cells" in file:
            for number, cell in file["cells"]:
                self._read_cell(walker, f"cell {number}", cell)
        else:
            source = file["bytes"].encode("latin-1") if "bytes" in file else file["text"]
            tree = self._parse_source(source, name)
            if tree is not None:
                unit = CodeUnit(name.partition(".")[0], always=not name)
                self._run_walk(name, lambda: walker.read_tree(tree, name, unit))
        self.units += walker.units
        self.made |= walker.made
        for file_name, text in walker.written:
            self.own.add(file_name.partition(".")[0])
            self._read_file({"name": file_name or "a file", "text": text})

    def _read_cell(self, walker: SyntaxWalker, name: str, cell: str) -> None:
        magic = cell_source.parse_cell_magic(cell)
        unit = CodeUnit("", always=True)
        if magic is not None:
            self._run_walk(name, lambda: walker.read_magic(magic, name, unit))
            return
        tree = self._parse_source(cell_source.convert_to_python(cell), name)
        if tree is not None:
            self._run_walk(name, lambda: walker.read_tree(tree, name, unit))

    def _parse_source(self, source: str | bytes, name: str) -> ast.Module | None:
        self._remaining_characters -= len(source)
        try:
            if len(source) > _MAX_TEXT_LENGTH:
                self._record_unreadable(name, f"it has more than {_MAX_TEXT_LENGTH} characters")
            elif self._remaining_characters < 0:
                self._record_unreadable(name, f"with the others it has more than {_MAX_TOTAL_LENGTH} characters")
            else:
                return ast.parse(source)
        except SyntaxError as error:
            if not name:
                self._record_unreadable(name, str(error.msg)[:200], error.lineno)
        except ValueError:
            if not name:
                self._record_unreadable(name, "it has characters that no Python file has")
        except (RecursionError, MemoryError):
            self._record_unreadable(name, "it is nested too deeply")
        return None

    def _run_walk(self, name: str, walk: Callable[[], None]) -> None:
        limit = sys.getrecursionlimit()
        sys.setrecursionlimit(_RECURSION_LIMIT)
        try:
            walk()
        except (RecursionError, MemoryError):
            self._record_unreadable(name, "it is nested too deeply")
        finally:
            sys.setrecursionlimit(limit)

    def _record_unreadable(self, name: str, reason: str, line: int | None = None) -> None:
        if self.unread is None:
            self.unread = [name[:_MAX_NAME_LENGTH], reason, line]

    def _describe_doubt(self, module: str) -> str:
        top = module.partition(".")[0]
        if top in PLAIN_MODULES:
            return module if is_doubtful_import(module) else ""
        if top in sys.stdlib_module_names:
            return top
        if not top or top in self.own:
            return ""
        if top in _COURSE_MODULES or importlib.machinery.PathFinder.find_spec(top) is not None:
            return top
        return f"the module {top}, which is not among the files,"


def _collect_reachable(
    units: Sequence[CodeUnit], entries: Sequence[str], executed_statements: Set[tuple[Any, ...]] | None
) -> Iterable[tuple[Mention, SourcePlace]]:
    """Yield the mentions in code that may run, or in the ``executed_statements``, and whether a loop reaches each.

    A function may run if reachable code uses its name, regardless of the object. If any name may be looked up, all
    functions may run.
    """
    has_any_name = any(mention.kind == "any_name" for unit in units for mention in unit.mentions)
    units_by_name: dict[str, list[CodeUnit]] = defaultdict(list)
    for unit in units:
        units_by_name[unit.name].append(unit)
        if unit.owner and unit.name.startswith("__"):
            units_by_name[unit.owner].append(unit)
    used_names: dict[str, bool] = {}  # names, and whether in a loop
    reachable_units: dict[CodeUnit, bool] = {}  # reachable units, and whether through a loop

    def is_loop_reached(unit: CodeUnit) -> bool | None:
        """Return whether a loop reaches the unit, or None if nothing does."""
        if not unit.made or (unit.made_in is not None and unit.made_in not in reachable_units):
            return None
        names = (unit.name, unit.owner) if unit.name.startswith("__") else (unit.name,)
        loop_flags = [used_names[name] for name in names if name in used_names]
        is_entry = unit.made_in is not None and any(fnmatchcase(unit.name, pattern) for pattern in entries)
        return any(loop_flags) if loop_flags or is_entry or unit.always or has_any_name else None

    def list_run_mentions(unit: CodeUnit) -> Iterator[tuple[Mention, SourcePlace]]:
        for mention, places in unit.mentions.items():
            if mention.live:
                run_places = (
                    each
                    for each in places
                    if executed_statements is None or (each.file, each.statement) in executed_statements
                )
                yield from ((mention, place) for place in itertools.islice(run_places, 1))

    pending_units = list(units)
    while pending_units:
        unit = pending_units.pop()
        is_looped = is_loop_reached(unit)
        if is_looped is None or (unit in reachable_units and reachable_units[unit] >= is_looped):
            continue
        reachable_units[unit] = is_looped
        pending_units += unit.units
        for mention, _ in list_run_mentions(unit):
            if mention.kind in ("construct", "function", "doubt", "any_name"):
                continue
            in_loop = is_looped or mention.looped
            for name in mention.name.split("."):
                if name not in used_names or used_names[name] < in_loop:
                    used_names[name] = in_loop
                    pending_units += units_by_name.get(name, ())
    for unit, is_looped in reachable_units.items():
        for mention, place in list_run_mentions(unit):
            yield mention._replace(looped=is_looped or mention.looped), place


#: The kinds of mention that have a name.
_NAMED_KINDS = frozenset({"call", "looped", "name"})
#: The kinds of mention that match a rule for a call, a module or a name.
_USED_KINDS = {"()": ("call",), _IMPORT: ("import", "through"), "": ("name",)}
_AVOIDED_KINDS = {"()": ("call", "handed_on", "base"), _IMPORT: ("import", "through"), "": ("name", "taken")}


def _collect_first_places(mentions: Iterable[tuple[Mention, SourcePlace]]) -> Places:
    first_places: dict[str, dict[str, SourcePlace]] = defaultdict(dict)
    for mention, place in mentions:
        for kind in (mention.kind, "looped") if mention.kind == "call" and mention.looped else (mention.kind,):
            first_places[kind][mention.name] = min(place, first_places[kind].get(mention.name, place))
    return first_places


def _exclude_own_names(places: Places, defined_names: Set[str], own_modules: Set[str]) -> Places:
    """Return the places without names that the submission defines itself."""

    def is_own_name(name: str) -> bool:
        root, attribute = name.partition(".")[0], name.rpartition(".")[2]
        return root in defined_names or (root in own_modules and (attribute in defined_names or attribute == root))

    foreign_places = {
        kind: {name: place for name, place in found.items() if kind not in _NAMED_KINDS or not is_own_name(name)}
        for kind, found in places.items()
    }
    return defaultdict(dict, foreign_places)


def _find_first_place(places: Places, rule: str, kinds: Mapping[str, Sequence[str]]) -> PlaceRow:
    if rule in _CONSTRUCTS:
        return _format_place(places["construct"].get(rule))
    form = "()" if rule.endswith("()") else _IMPORT if rule.startswith(_IMPORT) else ""
    matches = [
        place for kind in kinds.get(form, ()) for name, place in places[kind].items() if _MATCHERS[form](name, rule)
    ]
    return _format_place(min(matches, default=None))


def _is_called(name: str, rule: str) -> bool:
    pattern = rule.removesuffix("()")
    return fnmatchcase(name, pattern) or fnmatchcase(name, f"*.{pattern}")


def _is_imported(name: str, rule: str) -> bool:
    return find_exclusion(name, (_parse_module_name(rule),)) is not None


def _is_named(name: str, rule: str) -> bool:
    return f".{rule}." in f".{name}."


_MATCHERS = {"()": _is_called, _IMPORT: _is_imported, "": _is_named}


def _parse_module_name(rule: str) -> str:
    return rule.removeprefix(_IMPORT).strip()


def _collect_doubts(places: Places, rules: Sequence[str]) -> list[list[Any]]:
    """Return places that may match or hide what a rule avoids: file, line and description, in file order."""
    doubts: dict[SourcePlace, str] = {}
    for kind in ("doubt", "any_name"):
        for description, place in places[kind].items():
            doubts.setdefault(place, description)
    for rule in rules:
        for description, place in _list_look_alikes(places, rule):
            doubts.setdefault(place, description)
    return [
        [place.file[:_MAX_NAME_LENGTH], place.line, what[:_MAX_NAME_LENGTH]] for place, what in sorted(doubts.items())
    ]


def _list_look_alikes(places: Places, rule: str) -> Iterable[tuple[str, SourcePlace]]:
    if rule.endswith("()"):
        yield from ((name, place) for name, place in places["unsure"].items() if _is_called(name, rule))
        owner, _, attribute = rule.removesuffix("()").rpartition(".")
        if owner and any(_is_called(name, f"{attribute}()") for name in places["call"]):
            yield from ((name, place) for name, place in places["handed_on"].items() if _is_named(name, owner))
    elif rule.startswith(_IMPORT) and "." not in _parse_module_name(rule):
        for kind in ("import", "through"):
            yield from (
                (name, place) for name, place in places[kind].items() if f".{_parse_module_name(rule)}." in f"{name}."
            )


def _format_place(place: SourcePlace | None) -> PlaceRow:
    return None if place is None else [place.file[:_MAX_NAME_LENGTH], place.line]
