"""Hints on misplaced content: swapped parts, a second definition, a second robot program.

They search whole texts. ``hint_slips.py`` has the mistakes within one statement.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache

from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import Statement
from service.grading.hint_structure import DRIVING_CRITERIA, has_motor_call
from service.grading.hint_tables import CONTINUOUS_MOVES, LIMITED_MOVES
from submissions.assignment.folder import list_catalogue_ids, locate_assignment_folder
from submissions.criteria.code import SourceRules
from submissions.criteria.drawing import Drawing
from submissions.criteria.point import Circuits

_RESPONDER = re.compile(r"^def (?:\w+_)?responder\(")
_ROBOT = re.compile(
    r"^\s*(?:from|import) ev3dev2|^[^#]*(?:print\(f?[\"'](?:PY::|IMG_DATA)|tank_(?:drive|turn)\.|\bsay\()"
)
#: A word that is not a flag, and on the next line the flag with the word before it.
_CUT_VALUE = re.compile(r"'(\w+)' is not a flag\n.*?(-[br]|--background|--robotSetup) (\w+) \1\b")


def hint_about_starter_files(clues: Clues) -> Iterator[str]:
    """Yield a hint if the parts are unchanged starter files."""
    own = {each.name: each for each in clues.listings if each.part is not None}
    given = {name: text for name, text in _load_starter_files(clues.assignment).items() if name in own}
    if (
        not clues.lost
        or not given
        or any(_drop_blank_lines(own[name].lines) != _drop_blank_lines(given[name]) for name in given)
    ):
        return
    name, text = next(
        ((name, text) for name, text in given.items() if _find_todo_line(text)), next(iter(given.items()))
    )
    line = _find_todo_line(text)
    as_given = f"{name} is the starter as it was given, and has nothing of your own yet"
    if line:
        yield f"line {line} of {name}: {as_given}. Begin here: {text[line - 1].strip(' #')}"
    else:
        yield f"{as_given}. Add your own lines to it"


def _find_todo_line(lines: Sequence[str]) -> int:
    return next((number for number, line in enumerate(lines, 1) if "TODO" in line), 0)


def _drop_blank_lines(lines: Sequence[str]) -> list[str]:
    return [line.rstrip() for line in lines if line.strip()]


@cache
def _load_starter_files(assignment: str) -> Mapping[str, tuple[str, ...]]:
    """Return the lines of each starter file. Only assignments in the catalogue are known."""
    if assignment not in list_catalogue_ids():
        return {}
    files = sorted((locate_assignment_folder(assignment) / "starter").glob("*.py"))
    return {file.name: tuple(file.read_text("utf-8").split("\n")) for file in files}


def hint_about_swapped_parts(clues: Clues) -> Iterator[str]:
    """Yield a hint if robot.py contains the responder and responder.py the robot program."""
    parts = {each.part: each for each in clues.listings if each.part is not None}
    program, responder = parts.get("program"), parts.get("responder")
    if not clues.lost or program is None or responder is None:
        return
    is_swapped = program.find_line(_RESPONDER) and responder.find_line(_ROBOT)
    if is_swapped and not program.find_line(_ROBOT) and not responder.find_line(_RESPONDER):
        yield (
            f"{program.name} has the responder, and {responder.name} has the robot program. "
            "Swap the names of the two files"
        )


def hint_about_ignored_magic(clues: Clues) -> Iterator[str]:
    """Yield a hint on an ignored magic line, if its flags are required or -p was needed to draw."""
    draws = any(isinstance(each, Drawing | Circuits) for each in clues.lost)
    asks = any(isinstance(each, SourceRules) and each.flags for each in clues.lost)
    if not clues.ignored_magic or not (draws or asks):
        return
    for listing in clues.programs:
        place = listing.magic_place
        if place is not None and (clues.marked_cell is None or listing.name == f"cell {clues.marked_cell}"):
            why = clues.ignored_magic.partition(": ")[2] or clues.ignored_magic
            cut = _CUT_VALUE.search(f"{why}\n{listing.lines[place]}")
            if cut is not None:
                fix = f"The value of {cut[2]} has no blank: write {cut[2]} {cut[3]}_{cut[1]}"
            elif draws:
                fix = "Write -p to put the pen down, and check the other flags"
            else:
                fix = "Correct it, and check the other flags"
            pen = ", and the pen was never down" if draws else ""
            yield f"{listing.locate(place + 1)}: {why}, so all flags of the line are ignored{pen}. {fix}"
            return


def hint_about_redefined_functions(clues: Clues) -> Iterator[str]:
    """Yield a hint on a function that a later definition replaces before it is called."""
    if not clues.lost:
        return
    programs = {each.name for each in clues.programs}
    cells: list[Listing] = []
    for listing in clues.texts:
        is_cell = listing.part is None and listing in clues.listings
        if is_cell and listing.name not in programs:
            cells.append(listing)
            continue
        yield from _hint_about_redefinitions([listing])
        if is_cell:
            # This robot program uses the cells above it.
            yield from _hint_about_redefinitions(cells)
            cells = []
    yield from _hint_about_redefinitions(cells)


def hint_about_several_programs(clues: Clues) -> Iterator[str]:
    """Yield a hint if a notebook has other robot cells that drive but are not graded."""
    if clues.marked_cell is None or not any(isinstance(each, DRIVING_CRITERIA) for each in clues.lost):
        return
    marked = f"cell {clues.marked_cell}"
    others = [
        each for each in clues.programs if each.name != marked and any(_is_driving(one) for one in each.code.statements)
    ]
    if others:
        yield (
            f"only the robot program in {marked} is marked; {others[-1].name} is a program by itself. "
            f"If they belong together, put both into {marked}"
        )


def _hint_about_redefinitions(process: list[Listing]) -> Iterator[str]:
    first: dict[str, tuple[Listing, Statement]] = {}
    for listing in process:
        for each in listing.code.statements:
            if each.keyword == "def" and not each.indent and len(each.tokens) > 1:
                name = each.tokens[1]
                if name in first:
                    before, head = first[name]
                    where = f"line {head.line}" if before is listing else f"line {head.line} of {before.name}"
                    yield (
                        f"{listing.locate(each.line)} defines {name} again, in place of the function in {where}. "
                        "Delete one of the two, or give it another name"
                    )
                    return
                first[name] = listing, each
            elif not each.indent:
                for called in {call.name for call in each.calls} & first.keys():
                    del first[called]


def _is_driving(statement: Statement) -> bool:
    return has_motor_call(statement, LIMITED_MOVES | CONTINUOUS_MOVES)
