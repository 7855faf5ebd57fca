"""Advice on undefined or overwritten names: those of another process, of a later line, of a module.

The robot program does not see names defined in the responder or another cell, and the reverse.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from service.grading.fault_kinds import FaultKind, is_kind, read_values
from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import Statement, join_tokens
from service.language import translatable
from sim.recording import Fault
from sim.sentences import Sentence

_CALL = re.compile(r"(?<![.\w])(\w+)\(")
#: Python's form of constants from JSON and other languages.
_CONSTANTS = {"null": "None", "none": "None", "NULL": "None", "true": "True", "false": "False"}

#: Names that %%sim_magic_preloaded binds and the other magics don't.
PRELOADED = frozenset(("say", "speaker", "tank_turn", "tank_drive", "ultrasonic", "colorLeft", "colorRight", "gyro"))
_PREDEFINED_NAMES = PRELOADED | {
    "print",
    "str",
    "int",
    "float",
    "list",
    "len",
    "range",
    "max",
    "min",
    "sum",
    "round",
    "input",
}
#: Objects whose attributes are often written without the object.
_OWNERS = {
    **dict.fromkeys(("left_motor", "right_motor"), ("tank_drive",)),
    **dict.fromkeys(("on_for_seconds", "on_for_rotations", "on_for_degrees"), ("tank_drive", "tank_turn")),
    **dict.fromkeys(("reflected_light_intensity", "reflected_light_intensity_pc"), ("colorLeft", "colorRight")),
    **dict.fromkeys(("color", "color_name", "rgb"), ("colorLeft", "colorRight")),
    **dict.fromkeys(("distance_centimeters", "distance_inches"), ("ultrasonic",)),
    "angle": ("gyro",),
}


def advise_on_owner(fault: Fault, clues: Clues, *_: object) -> str:
    """Return advice on an attribute of a robot part that is written without its object."""
    name = _find_undefined_name(fault)
    owners = _OWNERS.get(name, ()) if fault.who == "program" and clues.preamble == "preloaded" else ()
    if not owners:
        return ""
    if len(owners) == 1:
        return Sentence("%(name)s belongs to %(owner)s: write %(owner)s.%(name)s.", name=name, owner=owners[0])
    return Sentence(
        "%(name)s belongs to %(first)s and %(second)s: write %(first)s.%(name)s or %(second)s.%(name)s.",
        name=name,
        first=owners[0],
        second=owners[1],
    )


def advise_on_constant(fault: Fault, *_: object) -> str:
    """Return advice on ``null`` or ``true``, as written in JSON."""
    name = _find_undefined_name(fault)
    if name not in _CONSTANTS:
        return ""
    return Sentence("Write %(right)s instead of %(wrong)s.", right=_CONSTANTS[name], wrong=name)


def advise_on_other_process(fault: Fault, clues: Clues, listing: Listing | None, _: Statement | None) -> str:
    """Return advice on a name that only the other process (robot or responder) defines."""
    name = _find_undefined_name(fault)
    if not name or listing is None:
        return ""
    robots = {each.name for each in clues.programs}
    is_robot = listing.name in robots
    other_listings = (each for each in clues.listings if (each.name in robots) != is_robot)
    defining_listing, definition = next(_collect_definitions(name, other_listings), (None, None))
    if (
        defining_listing is None
        or definition is None
        or next(_collect_definitions(name, _list_process_listings(listing, clues)), None)
    ):
        return ""
    if definition.keyword in ("import", "from"):
        template = (
            translatable("The import in %(source)s is only for the responder. Add %(code)s at the top of %(target)s.")
            if is_robot
            else translatable(
                "The import in %(source)s is only for the robot program. Add %(code)s at the top of %(target)s."
            )
        )
        source, target = defining_listing.locate(None), listing.locate(None)
        return Sentence(template, source=source, code=join_tokens(definition.tokens), target=target)
    if not is_robot:
        template = translatable(
            "%(owner)s defines %(name)s, but the responder does not see it. Define %(name)s in %(target)s as well."
        )
    elif listing.part is None:
        template = translatable(
            "%(owner)s defines %(name)s, but a robot program does not see it. Define %(name)s in %(target)s as well, "
            "below its first line."
        )
    else:
        template = translatable(
            "%(owner)s defines %(name)s, but a robot program does not see it. Define %(name)s in %(target)s as well."
        )
    owner = _name_at_start(defining_listing) if defining_listing.part is None else defining_listing.name
    return Sentence(template, owner=owner, name=name, target=listing.locate(None))


def _name_at_start(cell: Listing) -> str:
    """Return the name of a cell for the start of a sentence."""
    return Sentence("Cell %(number)s", number=cell.name.removeprefix("cell "))


def advise_on_later_cell(fault: Fault, clues: Clues, listing: Listing | None, _: Statement | None) -> str:
    """Return advice on a name that a later cell, not a robot program, defines."""
    name = _find_undefined_name(fault)
    if not name or listing is None or fault.cell is None:
        return ""
    cells = [each for each in _list_process_listings(listing, clues) if each.part is None]
    later_cell = next((each for each, _ in _collect_definitions(name, cells[cells.index(listing) + 1 :])), None)
    if later_cell is None:
        return ""
    return Sentence(
        "%(owner)s defines %(name)s, but runs later. Move %(later)s above %(earlier)s.",
        owner=_name_at_start(later_cell),
        name=name,
        later=later_cell.locate(None),
        earlier=listing.locate(None),
    )


def advise_on_later_line(fault: Fault, _: Clues, listing: Listing | None, statement: Statement | None) -> str:
    """Return advice on a function that is defined after the line that calls it."""
    name = _find_undefined_name(fault)
    if not name or listing is None or statement is None or listing.code.list_enclosing(statement):
        return ""
    for following in listing.code.list_following(statement):
        if not following.indent and following.keyword == "def" and name in following.bound_names:
            return Sentence(
                "Line %(line)s defines %(name)s, but is below. Move line %(caller)s below the definition.",
                line=following.line,
                name=name,
                caller=statement.line,
            )
    return ""


def advise_on_overwritten_name(fault: Fault, clues: Clues, listing: Listing | None, statement: Statement | None) -> str:
    """Return advice on a module or function whose name was assigned another value."""
    if listing is None or statement is None:
        return ""
    values = read_values(fault, FaultKind.NO_ATTRIBUTE)
    if values:
        owners = _collect_owners(values[1], statement)
    elif is_kind(fault, FaultKind.NOT_CALLABLE):
        # The tokenizer returns an f-string as one token, so calls in it are searched by pattern.
        owners = _CALL.findall("".join(listing.lines[statement.line - 1 : statement.last_line]))
    else:
        return ""
    for name in owners:
        for other_listing in _list_process_listings(listing, clues):
            for assignment in other_listing.code.statements:
                if assignment.target == name and _is_shared_name(name, listing, clues):
                    template = (
                        translatable("Line %(line)s gives %(name)s another value: %(code)s. Choose another name there.")
                        if other_listing is listing
                        else translatable(
                            "Line %(line)s of %(file)s gives %(name)s another value: %(code)s. Choose another name "
                            "there."
                        )
                    )
                    return Sentence(
                        template,
                        line=assignment.line,
                        file=other_listing.locate(None),
                        name=name,
                        code=join_tokens(assignment.tokens),
                    )
    return ""


def _find_undefined_name(fault: Fault) -> str:
    """Return the name that is not defined; empty if the fault is of another kind."""
    (name,) = read_values(fault, FaultKind.UNDEFINED_NAME) or ("",)
    return name


def _is_shared_name(name: str, listing: Listing, clues: Clues) -> bool:
    """Return whether a name is that of a module, a function or a robot object, not only of this variable."""
    binding_statements = (
        each
        for other in _list_process_listings(listing, clues)
        for each in other.code.statements
        if each.keyword in ("import", "from", "def") and name in each.bound_names
    )
    return name in _PREDEFINED_NAMES or any(binding_statements)


def _collect_owners(attribute: str, statement: Statement) -> list[str]:
    tokens = statement.tokens
    return [
        owner
        for owner, dot, name in zip(tokens, tokens[1:], tokens[2:], strict=False)
        if dot == "." and name == attribute
    ]


def _collect_definitions(name: str, listings: Iterator[Listing] | list[Listing]) -> Iterator[tuple[Listing, Statement]]:
    """Yield the statements that bind a name outside functions."""
    for listing in listings:
        for statement in listing.code.statements:
            if not statement.indent and name in statement.bound_names:
                yield listing, statement


def _list_process_listings(listing: Listing, clues: Clues) -> list[Listing]:
    """Return the texts in the same process, in order. Robot cells and files run alone."""
    if listing.part is not None or listing.name in {each.name for each in clues.programs}:
        return [listing]
    if listing not in clues.listings:
        return [listing]
    robots = {each.name for each in clues.programs}
    return [each for each in clues.listings if each.part is None and each.name not in robots]
