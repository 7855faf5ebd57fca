"""Detection of robot program runs in a notebook, and selection of the run that is marked.

The notebook is analysed without running it. ``[parts] cell`` of the assignment names the run. Otherwise the submission
names it, and without a name the last run that fits is marked.
"""

from __future__ import annotations

import ast
import functools
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from responders.sandbox.inside.cell_source import WRAPPERS, parse_cell_magic
from sim.errors import UsageError
from sim.readers.python_source import parse_module
from sim.readers.reader_errors import UnreadableDataError
from sim.sentences import Sentence
from submissions.assignment.definition import Assignment
from submissions.magics import comment_out_magic, parse_flags, parse_magic
from submissions.notebook import describe_near_program
from submissions.raw_files import sanitise_name
from submissions.source_text import find_magic_line, is_program_magic
from submissions.submission import Cell, Notebook

LAST = "last"
_TAG = "tag:"

_LINE = re.compile(
    r"""(?:%sim_magic[ \t]+|\.run_line_magic\([ \t]*['"]sim_magic['"][ \t]*,[ \t]*f?['"])(?P<flags>.*)"""
)
_AUTORUN = re.compile(r"(?:^|\s)(?:-[A-Za-z]*R|--auto)")
_EXPANDED = re.compile(r"[{$]")
_CALL = re.compile(r"""\.run_cell_magic\([ \t]*['"]sim_magic""")

_SENDS = ("PY::", "IMG_DATA")
#: Maximum number of statements and characters of a sensor test.
_TEST_STATEMENTS, _TEST_LENGTH = 2, 300
_MAX_LISTED_RUNS = 5
_MAX_RUN_DIGITS = 9


@dataclass(frozen=True, slots=True)
class RunSite:
    """A line of a cell (both counted from 1) that loads or starts a robot program."""

    cell: int
    line: int


@dataclass(frozen=True, slots=True)
class ProgramRun:
    """A run of the notebook, numbered from 1.

    ``program`` is the cell with its robot program: the run's own cell, or the last one loaded before. ``floor`` is the
    last ``-b`` at or above the site; None if there is none or if it is only known at run time.
    """

    number: int
    site: RunSite
    program: Cell | None
    begins: bool  # the site is the first line of the program
    floor: str | None


@dataclass(frozen=True, slots=True)
class RunChoice:
    """The run that is marked, as far as static analysis can tell.

    If no cell reaches it, ``others`` replace it in this order, unless ``only`` says that this exact run was requested.
    ``notes`` explain the choice if there was one.
    """

    run: ProgramRun
    only: bool
    others: tuple[RunSite, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def site(self) -> RunSite:
        """The start of the run."""
        return self.run.site


@functools.lru_cache(maxsize=4)
def find_runs(notebook: Notebook) -> tuple[ProgramRun, ...]:
    """Return all runs from the top: cells that begin with ``%%sim_magic...``, and lines that restart their program.

    The results for the last notebooks are cached, because intake and grading use the same ones.
    """
    runs: list[ProgramRun] = []
    program: Cell | None = None
    floor: str | None = None
    for cell in notebook.cells:
        program_line = _find_program_line(cell)
        program = program if program_line is None else cell
        magic = parse_cell_magic(cell.source)
        is_python = program_line is None and (magic is None or magic.name in WRAPPERS)
        for number, line in enumerate(cell.source.split("\n"), 1):
            flags = _LINE.search(line)
            floor = _parse_floor(line, flags, number == program_line) or floor
            if number == program_line or (is_python and _is_restart(line, flags)):
                known_floor = None if floor is None or _EXPANDED.search(floor) else floor
                runs.append(
                    ProgramRun(
                        len(runs) + 1, RunSite(cell.number, number), program, number == program_line, known_floor
                    )
                )
    return tuple(runs)


def choose_run(notebook: Notebook, assignment: Assignment, requested_run: str | None) -> RunChoice:
    """Return the run that the assignment names, otherwise ``requested_run``, otherwise the last one that fits.

    Raises:
        UsageError: The run does not exist.
    """
    marked_run = find_run(notebook, assignment.parts.cell, requested_run)
    if assignment.parts.cell != LAST:
        if requested_run is None:
            return RunChoice(marked_run, True)
        ignored_note = Sentence("run = %(run)s is not used: the assignment says which run is marked", run=requested_run)
        return RunChoice(marked_run, True, notes=(ignored_note,))
    runs = find_runs(notebook)
    misfits = {run: tuple(_find_mismatches(run, assignment)) for run in runs}
    if requested_run is not None:
        request = Sentence("as run = %(run)s asks", run=requested_run)
        return RunChoice(marked_run, True, notes=_explain_choice(misfits, marked_run, request))
    best, *other_runs = sorted(runs, key=lambda run: (len(misfits[run]), -run.number))
    reason = (
        Sentence("which fits best, though %(misfits)s", misfits=_join_with_commas(misfits[best]))
        if misfits[best]
        else Sentence("the last that fits")
    )
    return RunChoice(best, False, tuple(run.site for run in other_runs), _explain_choice(misfits, best, reason))


def find_run(notebook: Notebook, selector: str, requested_run: str | None = None) -> ProgramRun:
    """Return the run for ``selector``: ``last``, ``tag:NAME``, or the number of a robot program, from 1.

    ``last`` leaves the choice to the submission: ``requested_run`` is the number of a run, or a tag.

    Raises:
        UsageError: The run does not exist. The message lists the existing runs.
    """
    runs = find_runs(notebook)
    if not runs:
        raise UsageError(
            "%(name)s: has no robot program, expected a cell that begins with %%%%sim_magic_preloaded%(near)s.",
            name=notebook.name,
            near=describe_near_program(notebook),
        )
    if selector == LAST and requested_run is not None:
        return _find_requested_run(notebook, runs, requested_run)
    if selector == LAST:
        return runs[-1]
    if not selector.isdecimal():
        return _find_tagged_run(notebook, runs, selector.removeprefix(_TAG))
    number, programs = int(selector), [run for run in runs if run.begins]
    if number > len(programs):
        raise UsageError(
            "%(name)s: has %(count)s, expected at least %(number)s: number %(number)s is marked.",
            name=notebook.name,
            count=_format_count(len(programs)),
            number=number,
        )
    return programs[number - 1]


def _find_requested_run(notebook: Notebook, runs: Sequence[ProgramRun], requested_run: str) -> ProgramRun:
    if not requested_run.isdecimal():
        return _find_tagged_run(notebook, runs, requested_run.removeprefix(_TAG))
    # Python rejects integers with thousands of digits.
    number = int(requested_run) if len(requested_run) <= _MAX_RUN_DIGITS else 0
    if not 1 <= number <= len(runs):
        raise UsageError(
            "%(name)s: has no run %(asked)s, expected a number from 1 to %(most)s, or a tag.",
            name=notebook.name,
            asked=sanitise_name(requested_run),
            most=len(runs),
        )
    return runs[number - 1]


def _find_tagged_run(notebook: Notebook, runs: Sequence[ProgramRun], tag: str) -> ProgramRun:
    tagged_cells = [cell.number for cell in notebook.cells if tag in cell.tags]
    if not tagged_cells:
        raise UsageError(
            '%(name)s: has no cell with the tag "%(tag)s", expected it on the cell with the robot program; '
            "it is lost when a notebook is saved as .py.",
            name=notebook.name,
            tag=sanitise_name(tag),
        )
    tagged_runs = [run for run in runs if run.site.cell in tagged_cells]
    if not tagged_runs:
        raise UsageError(
            '%(name)s: cell %(cell)s has the tag "%(tag)s" but runs no robot, expected '
            "%%%%sim_magic_preloaded as its first line.",
            name=notebook.name,
            cell=tagged_cells[-1],
            tag=tag,
        )
    return tagged_runs[-1]


def _explain_choice(misfits: dict[ProgramRun, tuple[str, ...]], marked_run: ProgramRun, reason: str) -> tuple[str, ...]:
    if len(misfits) < 2:
        return ()
    other_runs = [_describe_other_run(run, found) for run, found in misfits.items() if run != marked_run]
    others = _join_with_commas(other_runs[:_MAX_LISTED_RUNS])
    if len(other_runs) > _MAX_LISTED_RUNS:
        others = Sentence("%(runs)s and %(count)s more", runs=others, count=len(other_runs) - _MAX_LISTED_RUNS)
    return (
        Sentence(
            "that is run %(number)s of %(count)s, %(reason)s; the others are %(others)s",
            number=marked_run.number,
            count=len(misfits),
            reason=reason,
            others=others,
        ),
        Sentence("another run is marked with --run NUMBER, or with run = NUMBER in submission.toml"),
    )


def _join_with_commas(parts: Sequence[str]) -> str:
    return functools.reduce(lambda these, last: Sentence("%(these)s, %(last)s", these=these, last=last), parts)


def _describe_other_run(run: ProgramRun, misfits: Sequence[str]) -> str:
    if not misfits:
        return Sentence("run %(number)s (cell %(cell)s)", number=run.number, cell=run.site.cell)
    return Sentence(
        "run %(number)s (cell %(cell)s: %(misfit)s)", number=run.number, cell=run.site.cell, misfit=misfits[0]
    )


def _find_mismatches(run: ProgramRun, assignment: Assignment) -> Iterator[str]:
    """Yield the reasons why a run does not fit the assignment."""
    world, has_responder = assignment.world, assignment.parts.responder != "none"
    text = run.program.source if run.program is not None else ""
    if world.image is None and run.floor is not None and run.floor != world.background:
        yield Sentence("its floor is %(floor)s", floor=run.floor[:40])
    is_sending = any(word in text for word in _SENDS)
    if has_responder and not is_sending:
        yield Sentence("it sends nothing to the responder")
    if not (has_responder and is_sending) and _is_test(comment_out_magic(text)):
        yield Sentence("it only prints")


@functools.lru_cache(maxsize=64)
def _is_test(text: str) -> bool:
    """Return whether a program consists of one or two statements that call only ``print``."""
    code = text.strip("# \n")
    if len(code) > _TEST_LENGTH:
        return False
    try:
        nodes = list(ast.walk(parse_module(code)))
    except (SyntaxError, UnreadableDataError):
        return False
    statements = [node for node in nodes if isinstance(node, ast.stmt)]
    called_names = [ast.unparse(node.func) for node in nodes if isinstance(node, ast.Call)]
    return len(statements) <= _TEST_STATEMENTS and set(called_names) <= {"print"}


def _find_program_line(cell: Cell) -> int | None:
    """Return the line, from 1, of the magic that makes the cell a robot program."""
    magic_line = find_magic_line(cell.source)
    if magic_line is None or not is_program_magic(cell.source.split("\n")[magic_line]):
        return None
    return magic_line + 1


def _is_restart(line: str, flags: re.Match[str] | None) -> bool:
    return bool(_CALL.search(line) or (flags and _AUTORUN.search(flags["flags"])))


def _parse_floor(line: str, restart_flags: re.Match[str] | None, is_first_line: bool) -> str | None:
    """Return the background named in a magic's line."""
    try:
        if is_first_line:
            flags = parse_magic(line.lstrip("\ufeff").strip())
        elif restart_flags:
            flags = parse_flags("sim_magic", re.split(r"""['"]""", restart_flags["flags"])[0])
        else:
            return None
    except UsageError:
        return None
    return flags.values.get("b")


def _format_count(number: int) -> Sentence:
    if number == 1:
        return Sentence("1 robot program")
    return Sentence("%(count)s robot programs", count=number)
