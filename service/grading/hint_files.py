"""Hints on misplaced content: swapped parts, a second definition, a second robot program.

They search whole texts. ``hint_slips.py`` has the mistakes within one statement.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache

from service.grading.hint_clues import Clues, Listing, name_cell
from service.grading.hint_code import Statement, is_name, join_tokens
from service.grading.hint_structure import DRIVING_CRITERIA, has_motor_call
from service.grading.hint_tables import CONTINUOUS_MOVES, LIMITED_MOVES
from service.language import translatable
from sim.sentences import Sentence, iterate_values
from submissions.assignment.starter import read_starter
from submissions.criteria.code import SourceRules
from submissions.criteria.drawing import Drawing
from submissions.criteria.point import Circuits

_RESPONDER = re.compile(r"^def (?:\w+_)?responder\(")
_ROBOT = re.compile(
    r"^\s*(?:from|import) ev3dev2|^[^#]*(?:print\(f?[\"'](?:PY::|IMG_DATA)|tank_(?:drive|turn)\.|\bsay\()"
)
#: A word that is not a flag, and on the next line the flag with the word before it.
#: Flags of one letter with a - before each, and no blanks.
_JOINED_FLAGS = re.compile(r"(?<=\s)(?:-[A-Za-z]){2,}(?=\s|$)")
_CUT_VALUE = re.compile(r"(-[br]|--background|--robotSetup) (\w+) (\w+)")


def hint_about_starter_files(clues: Clues) -> Iterator[str]:
    """Yield a hint if the parts are unchanged starter files."""
    parts_by_name = {each.name: each for each in clues.listings if each.part is not None}
    starter_files = {
        name: text for name, text in _load_starter_files(clues.assignment).items() if name in parts_by_name
    }
    if (
        not clues.lost
        or not starter_files
        or any(
            _drop_blank_lines(parts_by_name[name].lines) != _drop_blank_lines(starter_files[name])
            for name in starter_files
        )
    ):
        return
    name, text = next(
        ((name, text) for name, text in starter_files.items() if _find_todo_line(text)),
        next(iter(starter_files.items())),
    )
    line = _find_todo_line(text)
    if line:
        yield Sentence(
            "%(place)s: %(file)s is the starter as it was given, and has nothing of your own yet. Begin here: %(code)s",
            place=parts_by_name[name].locate(line),
            file=name,
            code=text[line - 1].strip(" #"),
        )
    else:
        yield Sentence(
            "%(file)s is the starter as it was given, and has nothing of your own yet. Add your own lines to it",
            file=name,
        )


def _find_todo_line(lines: Sequence[str]) -> int:
    return next((number for number, line in enumerate(lines, 1) if "TODO" in line), 0)


def _drop_blank_lines(lines: Sequence[str]) -> list[str]:
    return [line.rstrip() for line in lines if line.strip()]


@cache
def _load_starter_files(assignment: str) -> Mapping[str, tuple[str, ...]]:
    """Return the lines of each starter file."""
    return {name: tuple(text.split("\n")) for name, text in read_starter(assignment).items()}


def hint_about_swapped_parts(clues: Clues) -> Iterator[str]:
    """Yield a hint if robot.py contains the responder and responder.py the robot program."""
    parts = {each.part: each for each in clues.listings if each.part is not None}
    program, responder = parts.get("program"), parts.get("responder")
    if not clues.lost or program is None or responder is None:
        return
    is_swapped = program.find_line(_RESPONDER) and responder.find_line(_ROBOT)
    if is_swapped and not program.find_line(_ROBOT) and not responder.find_line(_RESPONDER):
        yield Sentence(
            "%(program)s has the responder, and %(responder)s has the robot program. Swap the names of the two files",
            program=program.name,
            responder=responder.name,
        )


def hint_about_ignored_magic(clues: Clues) -> Iterator[str]:
    """Yield a hint on an ignored magic line, if its flags are required or -p was needed to draw."""
    needs_pen = any(isinstance(each, Drawing | Circuits) for each in clues.lost)
    needs_flags = any(isinstance(each, SourceRules) and each.flags for each in clues.lost)
    if not clues.ignored_magic or not (needs_pen or needs_flags):
        return
    for listing in clues.programs:
        magic_index = listing.magic_place
        if magic_index is not None and (clues.marked_cell is None or listing.name == name_cell(clues.marked_cell)):
            reason = dict(iterate_values(clues.ignored_magic)).get("problem", clues.ignored_magic)
            cut_match = _CUT_VALUE.search(listing.lines[magic_index])
            if cut_match is not None:
                fix = Sentence(
                    "The value of %(flag)s has no blank: write %(flag)s %(value)s",
                    flag=cut_match[1],
                    value=f"{cut_match[2]}_{cut_match[3]}",
                )
            elif (joined_match := _JOINED_FLAGS.search(listing.lines[magic_index])) is not None:
                fix = Sentence(
                    "Write one - before the letters, -%(flags)s, or a blank before each -",
                    flags=joined_match[0].replace("-", ""),
                )
            elif needs_pen:
                fix = Sentence("Write -p to put the pen down, and check the other flags")
            else:
                fix = Sentence("Correct it, and check the other flags")
            template = (
                translatable(
                    "%(place)s: %(reason)s, so all flags of the line are ignored, and the pen was never down. %(fix)s"
                )
                if needs_pen
                else translatable("%(place)s: %(reason)s, so all flags of the line are ignored. %(fix)s")
            )
            yield Sentence(template, place=listing.locate(magic_index + 1), reason=reason, fix=fix)
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
    marked_cell = name_cell(clues.marked_cell)
    other_programs = [
        each
        for each in clues.programs
        if each.name != marked_cell and any(_is_driving(one) for one in each.code.statements)
    ]
    if other_programs:
        yield Sentence(
            "only the robot program in %(cell)s is marked; %(other_cell)s is a program by itself. If they belong "
            "together, put both into %(cell)s",
            cell=marked_cell,
            other_cell=other_programs[-1].name,
        )


def _hint_about_redefinitions(process: list[Listing]) -> Iterator[str]:
    definitions: dict[str, tuple[Listing, Statement]] = {}
    for listing in process:
        for statement in listing.code.statements:
            if statement.keyword == "def" and not statement.indent and len(statement.tokens) > 1:
                name = statement.tokens[1]
                if name in definitions:
                    earlier_listing, head = definitions[name]
                    if earlier_listing is listing:
                        other_place: str = Sentence("line %(line)s", line=head.line)
                    else:
                        other_place = earlier_listing.locate(head.line)
                    yield Sentence(
                        "%(place)s defines %(name)s again, instead of the function in %(other_place)s. Delete one of "
                        "the two, or give it another name",
                        place=listing.locate(statement.line),
                        name=name,
                        other_place=other_place,
                    )
                    return
                definitions[name] = listing, statement
            elif statement.target in definitions and _replaces_function(statement, process):
                earlier_listing, head = definitions[statement.target]
                yield Sentence(
                    "%(place)s gives %(name)s another value, so the function in %(other_place)s is lost: %(code)s. "
                    "Choose another name there",
                    place=listing.locate(statement.line),
                    name=statement.target,
                    other_place=earlier_listing.locate(head.line),
                    code=join_tokens(statement.tokens),
                )
                return
            elif not statement.indent:
                for called_name in {call.name for call in statement.calls} & definitions.keys():
                    del definitions[called_name]


def _replaces_function(statement: Statement, process: list[Listing]) -> bool:
    """Return whether an assignment at the left edge makes a text or number of a name that a function calls."""
    is_literal = len(statement.tokens) == 3 and not is_name(statement.tokens[2])
    inner_calls = (call for each in process for one in each.code.statements if one.indent for call in one.calls)
    return is_literal and not statement.indent and any(call.name == statement.target for call in inner_calls)


def _is_driving(statement: Statement) -> bool:
    return has_motor_call(statement, LIMITED_MOVES | CONTINUOUS_MOVES)
