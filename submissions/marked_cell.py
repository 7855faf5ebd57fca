"""Where in a notebook robot programs are started, and which of these places is the one that is marked.

Found by looking at the lines, never by running; ``[parts] cell`` of the assignment says which is meant.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from responders.sandbox.inside.cell_source import WRAPPERS, cell_magic
from sim.errors import UsageError
from sim.sentences import Sentence
from submissions.magic_lines import is_program_magic, magic_place
from submissions.magics import parse_flags, parse_magic
from submissions.notebook import as_code_cell
from submissions.raw_files import shown
from submissions.submission import Cell, Notebook

LAST = "last"
TAG = "tag:"

_LINE = re.compile(
    r"""(?:%sim_magic[ \t]+|\.run_line_magic\([ \t]*['"]sim_magic['"][ \t]*,[ \t]*f?['"])(?P<flags>.*)"""
)
_AUTORUN = re.compile(r"(?:^|\s)(?:-[A-Za-z]*R|--auto)")
_EXPANDED = re.compile(r"[{$]")
#: A line that was to begin a robot program.
NEARLY_MAGIC = re.compile(r"[ \t\ufeff]*%*[ \t]?sim_?ma\w*(?:[ \t]+-|[ \t]*\r?$)")
#: Its percent signs and its name, also where blanks are between them.
_BEGIN = re.compile(r"%*[ \t]?sim_?ma\w*")
_CALL = re.compile(r"""\.run_cell_magic\([ \t]*['"]sim_magic""")


@dataclass(frozen=True, slots=True)
class Site:
    """A line of a cell (both counted from 1) from which a robot program is loaded or started."""

    cell: int
    line: int


def sites(notebook: Notebook) -> tuple[Site, ...]:
    """Every such place, from the top: cells that begin with ``%%sim_magic...``, and lines that start it again."""
    return tuple(site for cell in notebook.cells for site in _sites(cell))


def programs(notebook: Notebook) -> tuple[Site, ...]:
    """The cells that hold a robot program."""
    return tuple(site for cell in notebook.cells if (site := _program(cell)) is not None)


def marked_site(notebook: Notebook, which: str) -> Site:
    """The place that ``which`` means: ``last``, ``tag:NAME``, or the number of a robot program, from 1.

    Raises UsageError with what the notebook has instead where there is no such place.
    """
    found = sites(notebook)
    if not found:
        raise UsageError(
            "%(name)s: has no robot program, expected a cell that begins with %%%%sim_magic_preloaded%(near)s.",
            name=notebook.name,
            near=_near_miss(notebook),
        )
    if which.isdecimal():
        number, cells = int(which), programs(notebook)
        if number > len(cells):
            raise UsageError(
                "%(name)s: has %(count)s, expected at least %(number)s: number %(number)s is marked.",
                name=notebook.name,
                count=_count(len(cells)),
                number=number,
            )
        return cells[number - 1]
    if which == LAST:
        return found[-1]
    return _tagged(notebook, which.removeprefix(TAG))


def program_of(notebook: Notebook, site: Site) -> Cell | None:
    """The cell with the program that is run at ``site``: itself, or the last one loaded before it."""
    before = [each for each in programs(notebook) if (each.cell, each.line) <= (site.cell, site.line)]
    return next((cell for cell in notebook.cells if before and cell.number == before[-1].cell), None)


def named_floors(notebook: Notebook) -> dict[Site, str]:
    """The floor that each place has by the last ``-b`` at or above it; none where it follows from running."""
    found: dict[Site, str] = {}
    floor: str | None = None
    starts = set(sites(notebook))
    for cell in notebook.cells:
        program = _program(cell)
        for number, line in enumerate(cell.source.split("\n"), 1):
            site = Site(cell.number, number)
            named = _floor(line, site == program)
            floor = named or floor
            if site in starts and floor is not None and not _EXPANDED.search(floor):
                found[site] = floor
    return found


def _floor(line: str, program: bool) -> str | None:
    """The background that a magic's line names."""
    again = _LINE.search(line)
    try:
        if program:
            flags = parse_magic(line.lstrip("\ufeff").strip())
        elif again:
            flags = parse_flags("sim_magic", re.split(r"""['"]""", again["flags"])[0])
        else:
            return None
    except UsageError:
        return None
    return flags.values.get("b")


def _tagged(notebook: Notebook, tag: str) -> Site:
    tagged = [cell for cell in notebook.cells if tag in cell.tags]
    if not tagged:
        raise UsageError(
            '%(name)s: has no cell with the tag "%(tag)s", expected it on the cell with the robot program; '
            "it is lost when a notebook is saved as .py.",
            name=notebook.name,
            tag=tag,
        )
    found = [site for cell in tagged for site in _sites(cell)]
    if not found:
        raise UsageError(
            '%(name)s: cell %(cell)s has the tag "%(tag)s" but runs no robot, expected '
            "%%%%sim_magic_preloaded as its first line.",
            name=notebook.name,
            cell=tagged[-1].number,
            tag=tag,
        )
    return found[-1]


def _near_miss(notebook: Notebook) -> str | Sentence:
    """A line that is nearly a program's magic, or is one in the wrong place, such as a Markdown cell."""
    for place in notebook.markdown_programs:
        return Sentence("; %(near)s", {"near": as_code_cell(place)})
    for cell in notebook.cells:
        for number, line in enumerate(cell.source.split("\n"), 1):
            begin = _BEGIN.search(line[:200]) if NEARLY_MAGIC.match(line[:200]) else None
            if begin is not None:
                values = {"line": number, "cell": cell.number, "word": shown(begin[0]), "why": _why_not(line)}
                return Sentence("; line %(line)s of cell %(cell)s has %(word)s, %(why)s", values)
    return ""


def _why_not(line: str) -> Sentence:
    """Why a line that is nearly a program's magic begins no program."""
    if is_program_magic(line):
        return Sentence("below other code: make it the first line")
    if is_program_magic(f"%{line.lstrip()}"):
        return Sentence("with one %(sign)s: write two", {"sign": "%"})
    if is_program_magic(re.sub(r"^%%\s+", "%%", line.strip())):
        return Sentence("with a blank after %(signs)s: delete the blank", {"signs": "%%"})
    return Sentence("another word")


def _count(number: int) -> Sentence:
    if number == 1:
        return Sentence("1 robot program")
    return Sentence("%(count)s robot programs", {"count": number})


def _sites(cell: Cell) -> Iterator[Site]:
    program = _program(cell)
    if program is not None:
        yield program
        return
    magic = cell_magic(cell.source)
    if magic is not None and magic.name not in WRAPPERS:
        return
    for number, line in enumerate(cell.source.split("\n"), 1):
        again = _LINE.search(line)
        if _CALL.search(line) or (again and _AUTORUN.search(again["flags"])):
            yield Site(cell.number, number)


def _program(cell: Cell) -> Site | None:
    place = magic_place(cell.source)
    if place is None or not is_program_magic(cell.source.split("\n")[place]):
        return None
    return Site(cell.number, place + 1)
