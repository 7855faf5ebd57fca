"""Which run of a notebook is marked where the assignment leaves it open: what was asked for, else the last that fits.

Decided by reading, before anything is run; where runs are, and what an assignment may ask for, is ``marked_cell.py``'s.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass

from sim.errors import UsageError
from sim.readers.python_source import parse_module
from sim.readers.unreadable import Unreadable
from submissions.assignment.definition import Assignment
from submissions.magics import without_magic
from submissions.marked_cell import LAST, TAG, Site, marked_site, named_floors, program_of, sites
from submissions.submission import Notebook

_SENDS = ("PY::", "IMG_DATA")
#: A test of a sensor: how many statements it has, and characters, at most.
_TEST_STATEMENTS, _TEST_LENGTH = 2, 300
_MOST_SHOWN = 5


@dataclass(frozen=True, slots=True)
class RunCandidate:
    """A run of the notebook, counted from 1, and why it does not fit the assignment."""

    number: int
    site: Site
    misfits: tuple[str, ...] = ()

    def __str__(self) -> str:
        why = f": {self.misfits[0]}" if self.misfits else ""
        return f"run {self.number} (cell {self.site.cell}{why})"


@dataclass(frozen=True, slots=True)
class RunChoice:
    """Where the run that is marked starts, as far as can be read.

    ``others`` take its place, in this order, where no cell comes to it, unless this is the ``only`` one that was asked
    for; ``notes`` tell of the choice if there was one.
    """

    site: Site
    only: bool
    others: tuple[Site, ...] = ()
    notes: tuple[str, ...] = ()


def choose_run(notebook: Notebook, assignment: Assignment, asked: str | None) -> RunChoice:
    """The run that the assignment names; where it names none, the one ``asked`` for, else the last that fits.

    Raises UsageError where there is no such run.
    """
    which = assignment.parts.cell
    if which != LAST:
        named = f"run = {asked} is not used: the assignment says which run is marked"
        return RunChoice(marked_site(notebook, which), True, notes=(named,) if asked is not None else ())
    if asked is not None:
        site = asked_site(notebook, asked)
        return RunChoice(site, True, notes=_told(_candidates(notebook, assignment), site, f"as run = {asked} asks"))
    marked_site(notebook, which)
    found = _candidates(notebook, assignment)
    best, *others = sorted(found, key=lambda each: (len(each.misfits), -each.number))
    why = "the last that fits" if not best.misfits else f"which fits best, though {', '.join(best.misfits)}"
    return RunChoice(best.site, False, tuple(each.site for each in others), _told(found, best.site, why))


def asked_site(notebook: Notebook, asked: str) -> Site:
    """Where the run of that number, or in the cell with that tag, starts. Raises UsageError."""
    if not asked.isdecimal():
        return marked_site(notebook, asked if asked.startswith(TAG) else f"{TAG}{asked}")
    found = sites(notebook)
    if not 1 <= int(asked) <= len(found):
        raise UsageError(
            "%(name)s: has no run %(asked)s, expected a number from 1 to %(most)s, or a tag.",
            name=notebook.name,
            asked=asked,
            most=len(found),
        )
    return found[int(asked) - 1]


def _told(candidates: tuple[RunCandidate, ...], site: Site, why: str) -> tuple[str, ...]:
    if len(candidates) < 2:
        return ()
    marked = next(each for each in candidates if each.site == site)
    others = [str(each) for each in candidates if each is not marked]
    more = f" and {len(others) - _MOST_SHOWN} more" if len(others) > _MOST_SHOWN else ""
    shown = ", ".join(others[:_MOST_SHOWN]) + more
    return (
        f"that is run {marked.number} of {len(candidates)}, {why}; the others are {shown}",
        "another run is marked with --run NUMBER, or with run = NUMBER in submission.toml",
    )


def _candidates(notebook: Notebook, assignment: Assignment) -> tuple[RunCandidate, ...]:
    world, answered = assignment.world, assignment.parts.responder != "none"
    floors = named_floors(notebook) if world.image is None else {}
    found = []
    for number, site in enumerate(sites(notebook), 1):
        cell = program_of(notebook, site)
        text = cell.source if cell is not None else ""
        floor = floors.get(site, world.background)
        found.append(RunCandidate(number, site, tuple(_misfits(text, floor, world.background, answered))))
    return tuple(found)


def _misfits(text: str, floor: str, wanted: str, answered: bool) -> Iterator[str]:
    if floor != wanted:
        yield f"its floor is {floor[:40]}"
    sends = any(word in text for word in _SENDS)
    if answered and not sends:
        yield "it sends nothing to the responder"
    if not (answered and sends) and _is_test(without_magic(text)):
        yield "it only prints"


def _is_test(text: str) -> bool:
    """Whether a program is one or two statements that call nothing but ``print``."""
    code = text.strip("# \n")
    if len(code) > _TEST_LENGTH:
        return False
    try:
        nodes = list(ast.walk(parse_module(code)))
    except (SyntaxError, Unreadable):
        return False
    statements = [node for node in nodes if isinstance(node, ast.stmt)]
    called = [ast.unparse(node.func) for node in nodes if isinstance(node, ast.Call)]
    return len(statements) <= _TEST_STATEMENTS and set(called) <= {"print"}
