"""Advice on values of the wrong type: a text as a counter, a decimal comma, a sensor in place of its reading.

The type is in the error message. The program's text shows where the value comes from.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from types import MappingProxyType

from responders.message_format import JSON
from service.grading.fault_kinds import FaultKind, is_kind, read_values
from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import Statement, is_name, iterate_equality_tests, join_tokens
from service.grading.hint_tables import USAGE
from service.grading.judging.message_parts import add_place
from service.language import translatable
from sim.recording import Fault
from sim.sentences import Sentence

_KEYWORDS: Mapping[str, tuple[str, ...]] = MappingProxyType({"say": ("txt", "wait", "show")})
_MOTOR_KEYWORDS = (
    "left_speed",
    "right_speed",
    "steering",
    "speed",
    "seconds",
    "rotations",
    "degrees",
    "brake",
    "block",
)
#: Functions of numpy that make one array of several, or of copies.
_COPYING_FUNCTIONS = ("concatenate", "stack", "vstack", "repeat", "tile", "append")
_DIGITS = re.compile(r"""["'](-?\d+(?:\.\d+)?)["']\Z""")
_KEY = re.compile(r"""["'](\w{2,40})["']\s*:""")
#: Short names of modules, as the course's programs import them.
_ALIASES: Mapping[str, str] = MappingProxyType({"glue": "ev3dev2_glue", "np": "numpy", "pd": "pandas"})
_NUMBER = re.compile(r"\d+(?:\.\d+)?\Z")
_SWITCH = re.compile(r"(?:True|False|\d+|wait\w*)\Z", re.IGNORECASE)
#: The names of devices in the preloaded preamble, and what to read from a device.
_DEVICES: Mapping[str, frozenset[str]] = MappingProxyType(
    {
        "ColorSensor": frozenset({"colorLeft", "colorRight"}),
        "UltrasonicSensor": frozenset({"ultrasonic"}),
        "GyroSensor": frozenset({"gyro"}),
        "LargeMotor": frozenset({"left_motor", "right_motor"}),
    }
)
_DEVICE_READINGS: Mapping[str, str] = MappingProxyType(
    {
        "ColorSensor": "reflected_light_intensity_pc",
        "UltrasonicSensor": "distance_centimeters",
        "GyroSensor": "angle",
        "LargeMotor": "position",
    }
)


def advise_on_text_operand(fault: Fault, _: Clues, listing: Listing | None, statement: Statement | None) -> str:
    """Return advice on a variable that is compared or calculated with, and was assigned a number in quotes."""
    if listing is None or statement is None or not is_kind(fault, FaultKind.TEXT_OPERAND, FaultKind.LIST_OPERAND):
        return ""
    for assignment in _list_assignments(listing, statement):
        match = _DIGITS.match(assignment.tokens[2]) if len(assignment.tokens) == 3 else None
        if match is not None:
            name, text = assignment.target, assignment.tokens[2]
            return Sentence(
                "Line %(line)s makes %(name)s a text, because %(text)s is in quotes. Write %(name)s = %(number)s "
                "there.",
                line=assignment.line,
                name=name,
                text=text,
                number=match[1],
            )
    return ""


def advise_on_list_operand(fault: Fault, _: Clues, listing: Listing | None, statement: Statement | None) -> str:
    """Return advice on a whole list that is used like one number."""
    if listing is None or statement is None or not is_kind(fault, FaultKind.LIST_OPERAND):
        return ""
    direct_assignments = _list_assignments(listing, statement)
    indirect_assignments = [one for each in direct_assignments for one in _list_assignments(listing, each)]
    for assignment in (*direct_assignments, *indirect_assignments):
        if assignment.tokens[2] == "[" and assignment.tokens[-1] == "]":
            return Sentence(
                "Line %(line)s makes %(name)s a whole list. Take one entry, as in %(name)s[0], or write the list "
                "behind for %(name)s in.",
                line=assignment.line,
                name=assignment.target,
            )
    return ""


def advise_on_decimal_comma(fault: Fault, _: Clues, listing: Listing | None, statement: Statement | None) -> str:
    """Return advice on ``1,6``, which is two numbers: in a call with too many values, or in a constant."""
    if listing is None or statement is None:
        return ""
    if is_kind(fault, FaultKind.TOO_MANY_ARGUMENTS):
        numbers = next((found for call in statement.calls if (found := find_decimal_comma(call.arguments))), None)
        return "" if numbers is None else describe_decimal_comma(*numbers)
    if not is_kind(fault, FaultKind.TUPLE_OPERAND):
        return ""
    for assignment in _list_assignments(listing, statement):
        numbers = find_decimal_comma(tuple((token,) for token in assignment.tokens[2:] if token != ","))
        if numbers is not None and len(assignment.tokens) == 5:
            explanation = describe_decimal_comma(*numbers)
            return Sentence("In line %(line)s, %(explanation)s", line=assignment.line, explanation=explanation)
    return ""


def find_decimal_comma(arguments: tuple[tuple[str, ...], ...]) -> tuple[str, str] | None:
    """Return the last two values if they are whole numbers without a sign between them; otherwise None."""
    numbers = ["".join(each) for each in arguments[-2:]]
    if len(numbers) == 2 and re.fullmatch(r"-?\d+", numbers[0]) and numbers[1].isdecimal():
        return numbers[0], numbers[1]
    return None


def describe_decimal_comma(whole: str, fraction: str) -> str:
    """Return a sentence on a number with a comma."""
    return Sentence(
        "%(whole)s,%(fraction)s is two numbers. Python has a decimal point: write %(whole)s.%(fraction)s.",
        whole=whole,
        fraction=fraction,
    )


def advise_on_device(fault: Fault, _: Clues, listing: Listing | None, statement: Statement | None) -> str:
    """Return advice on a sensor or motor that is used like a number, without the name of a reading."""
    values = read_values(fault, FaultKind.DEVICE_OPERAND)
    if values is None or listing is None or statement is None:
        return ""
    device = find_device(listing, statement, values[0])
    if device is None:
        return ""
    name, reading = device
    template = (
        translatable("%(name)s is the whole motor. Write what to read, such as %(name)s.%(reading)s.")
        if values[0] == "LargeMotor"
        else translatable("%(name)s is the whole sensor. Write what to read, such as %(name)s.%(reading)s.")
    )
    return Sentence(template, name=name, reading=reading)


def find_device(listing: Listing, statement: Statement, kind: str = "") -> tuple[str, str] | None:
    """Return the name of a device that a statement uses without an attribute, and the reading that is usually meant.

    ``kind`` is the class of the device; without it, all classes are tried.
    """
    if not kind:
        return next((found for each in _DEVICES if (found := find_device(listing, statement, each))), None)
    names = _DEVICES[kind] | {
        each.target for each in listing.code.statements if each.target and each.has_token(kind) and len(each.tokens) > 4
    }
    tokens = statement.tokens
    for index, token in enumerate(tokens):
        if token in names and tokens[index + 1 : index + 2] not in ((".",), ("=",)):
            start = index - 2 if index > 1 and tokens[index - 1] == "." else index
            return join_tokens(tokens[start : index + 1]), _DEVICE_READINGS[kind]
    return None


def advise_on_whole_object(fault: Fault, clues: Clues, _: Listing | None, statement: Statement | None) -> str:
    """Return advice on an object of the queue that is joined to a text without its key."""
    if statement is None or not is_kind(fault, FaultKind.JOINED_OBJECT):
        return ""
    if "pyState" not in statement.tokens:
        return ""
    used_keys = {token.strip("\"'") for token in statement.tokens}
    answers = (text for text in reversed(clues.answers) if text.startswith(JSON))
    keys = (key for text in answers for key in _KEY.findall(text) if key not in used_keys)
    return Sentence(
        'It is an object and no text: take one of its values with its key, as in ["%(key)s"].',
        key=next(keys, "message"),
    )


def advise_on_missing_alias(fault: Fault, _: Clues, listing: Listing | None, __: Statement | None) -> str:
    """Return advice on ``glue`` after ``import ev3dev2_glue``, or without any import."""
    values = read_values(fault, FaultKind.UNDEFINED_NAME)
    module = _ALIASES.get(values[0], "") if values is not None else ""
    if values is None or not module or listing is None:
        return ""
    statement = f"import {module} as {values[0]}"
    for each in listing.code.statements:
        if each.keyword in ("import", "from") and each.tokens[1] == module:
            return Sentence(
                "Line %(line)s imports %(module)s under another name. Write %(code)s there.",
                line=each.line,
                module=module,
                code=statement,
            )
    return Sentence("Add %(code)s at the top of the program.", code=statement)


def advise_on_keyword(fault: Fault, _: Clues, listing: Listing | None, __: Statement | None) -> str:
    """Return advice on an argument with a misspelt name, such as ``Wait=True``."""
    values = read_values(fault, FaultKind.UNEXPECTED_KEYWORD)
    if values is None or listing is None:
        return ""
    function, name = values[0], values[1]
    heads = [each for each in listing.code.list_functions() if each.tokens[1] == function]
    names = heads[0].tokens[3:] if heads else _KEYWORDS.get(function, _MOTOR_KEYWORDS)
    similar = difflib.get_close_matches(name.lower(), [each for each in names if is_name(each)], 1)
    if similar:
        return Sentence("Did you mean %(code)s?", code=f"{similar[0]}=")
    return Sentence("%(function)s has no %(name)s: leave %(name)s=... out.", function=function, name=name)


def advise_on_short_list(fault: Fault, _: Clues, listing: Listing | None, statement: Statement | None) -> str:
    """Return advice on a list of names that is shorter than the classes of the network."""
    if listing is None or statement is None or not is_kind(fault, FaultKind.LIST_INDEX):
        return ""
    if not statement.has_token("predict"):
        return ""
    for assignment in _list_assignments(listing, statement):
        entries = [token for token in assignment.tokens[3:] if token[:1] in ("'", '"')]
        if assignment.tokens[2] == "[" and entries:
            return Sentence(
                "%(name)s has %(count)s names, and the network answered with a larger number. Add the missing "
                "names in line %(line)s, in the order of the network.",
                name=assignment.target,
                count=len(entries),
                line=assignment.last_line,
            )
    return ""


def advise_on_parameter(fault: Fault, _: Clues, listing: Listing | None, statement: Statement | None) -> str:
    """Return advice on an undefined name in a function whose only parameter has another name, and is not used."""
    values = read_values(fault, FaultKind.UNDEFINED_NAME)
    if values is None or listing is None or statement is None:
        return ""
    head = next((each for each in listing.code.list_enclosing(statement) if each.keyword == "def"), None)
    if head is None or len(head.tokens) != 6 or not is_name(head.tokens[3]):
        return ""
    name = head.tokens[3]
    if any(each.has_token(name) for each in listing.code.list_body(head)):
        return ""
    return Sentence(
        "Line %(line)s calls the parameter %(name)s: write %(name)s in place of %(wrong)s, or rename the parameter.",
        line=head.line,
        name=name,
        wrong=values[0],
    )


def advise_on_mean_axis(fault: Fault, _: Clues, listing: Listing | None, __: Statement | None) -> str:
    """Return advice on ``mean(axis=0)`` of an image, which leaves too few numbers."""
    values = read_values(fault, FaultKind.FEATURE_COUNTS)
    if values is None or listing is None or int(values[0]) >= int(values[1]):
        return ""
    for statement in listing.code.statements:
        for call in statement.calls:
            axis = next((each[2] for each in call.arguments if each[:2] == ("axis", "=") and len(each) == 3), "")
            if call.name.rpartition(".")[2] == "mean" and axis in ("0", "1"):
                return Sentence(
                    "Line %(line)s takes the mean over axis %(axis)s. The colours are in axis 2: write axis=2.",
                    line=statement.line,
                    axis=axis,
                )
    return ""


def advise_on_sample_count(fault: Fault, _: Clues, __: Listing | None, statement: Statement | None) -> str:
    """Return advice on ``fit`` with more or fewer labels than images."""
    values = read_values(fault, FaultKind.SAMPLE_COUNTS)
    if values is None:
        return ""
    images, labels = int(values[0]), int(values[1])
    if images > labels > 0 and images % labels == 0:
        if statement is not None and statement.has_token(*_COPYING_FUNCTIONS):
            return Sentence(
                "There are %(share)s rows for each label. Repeat the labels %(share)s times, too, for example with "
                "np.tile(labels, %(share)s).",
                share=images // labels,
            )
        return Sentence(
            "There are %(rows)s rows for %(labels)s labels, so each image became %(share)s rows. Write "
            ".reshape(len(images), -1) for one row for each image.",
            rows=images,
            labels=labels,
            share=images // labels,
        )
    return Sentence(
        "There are %(images)s images and %(labels)s labels: fit needs one label for each image, in the same order.",
        images=images,
        labels=labels,
    )


def advise_on_narrow_except(fault: Fault, _: Clues, listing: Listing | None, statement: Statement | None) -> str:
    """Return advice on an error within ``try`` whose ``except`` names other errors."""
    values = read_values(fault, FaultKind.ANY_EXCEPTION)
    if values is None or listing is None or statement is None:
        return ""
    for head in listing.code.list_enclosing(statement):
        handler = listing.code.find_next_outside(head) if head.keyword == "try" else None
        if handler is None or handler.keyword != "except" or len(handler.tokens) < 3:
            continue
        names = [token for token in handler.tokens[1:] if is_name(token) and token != "as"]
        if handler.tokens[1] == "(" or len(names) == 1:
            error = "ValueError" if values[0] == "JSONDecodeError" else values[0]
            return Sentence(
                "The except in line %(line)s catches %(caught)s only. Write (%(listed)s) after except.",
                line=handler.line,
                caught=join_tokens(handler.tokens[1:-1]),
                listed=", ".join(dict.fromkeys((*names, error))),
            )
    return ""


def check_number_as_text(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``count != "5"``, where count is a number from its first value on."""
    tokens = statement.tokens
    for name, sign, text in zip(tokens, tokens[1:], tokens[2:], strict=False):
        match = _DIGITS.match(text)
        values = [each.tokens[2:] for each in listing.code.statements if each.target == name]
        is_changed = any(name in each.bound_names and each.target != name for each in listing.code.statements)
        if match is None or sign not in ("==", "!=") or not values or is_changed:
            continue
        if all(_NUMBER.match(one) or one in (name, "+", "-", "*") for value in values for one in value):
            return Sentence(
                "%(place)s: %(name)s is a number, and never equals the text %(text)s. Write %(number)s without quotes",
                place=listing.locate(statement.line),
                name=name,
                text=text,
                number=match[1],
            )
    return ""


def check_decimal_comma(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``tank_drive.on_for_rotations(50, 50, 1,6)``: one value too many, at a comma between digits."""
    for call in statement.calls:
        count = USAGE[call.name].count(",") + 1 if call.name in USAGE else None
        numbers = find_decimal_comma(call.arguments) if len(call.arguments) - 1 == count else None
        if numbers is not None and call.name.rpartition(".")[2] != "on":
            return add_place(listing.locate(statement.line), describe_decimal_comma(*numbers))
    return ""


def check_second_text(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``say("Colour", name)``: say takes one text, and print takes several."""
    for call in statement.calls:
        values = [each for each in call.arguments if "=" not in each]
        # A second value such as True, 1 or a variable called wait is meant for the parameter wait.
        is_switch = len(values) > 1 and len(values[1]) == 1 and _SWITCH.match(values[1][0])
        is_own = any("say" in one.bound_names for one in listing.code.statements)
        if call.name != "say" or len(values) < 2 or is_switch or is_own:
            continue
        texts = ' + " " + '.join(
            join_tokens(each) if each[0][:1] in "\"'" else f"str({join_tokens(each)})" for each in values
        )
        return Sentence(
            "%(place)s: say takes one text, and ignores the second. Write say(%(text)s)",
            place=listing.locate(statement.line),
            text=texts,
        )
    return ""


def check_robot_number(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``sender == "1"`` and on ``robot_number() == 0``: the numbers are 1 and 2."""
    for left, value in iterate_equality_tests(statement.tokens):
        match = _DIGITS.match(value)
        number = match[1] if match is not None else value
        is_wrong = match is not None or (number.isdecimal() and number not in ("1", "2"))
        is_number = left[-1] == "sender" or left[-3:] == ("robot_number", "(", ")")
        if not is_wrong or not is_number:
            continue
        if any("sender" in each.bound_names for each in listing.code.statements):
            continue
        name = "sender" if left[-1] == "sender" else "robot_number()"
        if match is None:
            return Sentence(
                "%(place)s: %(name)s is never %(number)s. The robots have the numbers 1 and 2",
                place=listing.locate(statement.line),
                name=name,
                number=number,
            )
        return Sentence(
            "%(place)s: %(name)s is a number, and never equals the text %(text)s. Write %(number)s without quotes",
            place=listing.locate(statement.line),
            name=name,
            text=value,
            number=number,
        )
    return ""


def _list_assignments(listing: Listing, statement: Statement) -> list[Statement]:
    """Return the assignments to the names that a statement uses."""
    names = {token for token in statement.tokens if is_name(token)}
    return [each for each in listing.code.statements if each.target in names and each is not statement]
