"""Hints on the student's functions that are called with the wrong number of values.

For agents and methods the definition is wrong, because others call them. Otherwise either may be wrong.
"""

from __future__ import annotations

from collections.abc import Iterator

from service.grading.fault_kinds import FaultKind, read_values
from service.grading.hint_clues import Clues, Listing, describe_fault_line
from service.grading.hint_code import Statement, is_name
from service.language import translatable
from sim.sentences import Sentence


def hint_about_signatures(clues: Clues) -> Iterator[str]:
    """Yield a hint on the definition that does not match a call."""
    for fault in clues.faults:
        _, name = read_values(fault, FaultKind.WRONG_ARGUMENTS) or ("", "")
        listing, head = _find_definition(name, clues) if name else (None, None)
        if listing is None or head is None:
            continue
        enclosing_class = next((each for each in listing.code.list_enclosing(head) if each.keyword == "class"), None)
        if enclosing_class is not None and "self" not in head.tokens:
            parameters = "".join(f", {each}" for each in _list_parameters(head))
            yield Sentence(
                '%(place)s: a method needs self as first parameter. Write "def %(name)s(self%(parameters)s):"',
                place=listing.locate(head.line),
                name=name,
                parameters=parameters,
            )
            return
        arguments = _list_arguments(name, clues)
        if fault.agent and fault.line is None and arguments:
            yield Sentence(
                "%(place)s defines %(name)s with %(parameters)s, but %(caller)s calls it with %(count)s. "
                'Write "def %(name)s(%(arguments)s):", or change the call',
                place=listing.locate(head.line),
                name=name,
                parameters=_describe_parameter_count(len(_list_parameters(head))),
                caller=_describe_call(name, clues),
                count=len(arguments),
                arguments=", ".join(arguments),
            )
            return
        location = describe_fault_line(fault, clues)
        if location and fault.line is not None and enclosing_class is None:
            parameters = ", ".join(_list_parameters(head))
            template = (
                translatable(
                    "%(place)s calls %(name)s with another number of values than %(definition)s defines. Its "
                    "parameters are: %(parameters)s"
                )
                if parameters
                else translatable(
                    "%(place)s calls %(name)s with another number of values than %(definition)s defines. Its "
                    "parameters are: none"
                )
            )
            definition = listing.locate(head.line)
            hint = Sentence(template, place=location, name=name, definition=definition, parameters=parameters)
            missing = read_values(fault, FaultKind.MISSING_ARGUMENT)
            advice = "" if missing is None else Sentence("Write a value for %(name)s in the brackets.", name=missing[1])
            yield Sentence("%(problem)s. %(advice)s", problem=hint, advice=advice) if advice else hint
            return


def _find_definition(name: str, clues: Clues) -> tuple[Listing | None, Statement | None]:
    heads = (
        (listing, head) for listing in clues.texts for head in listing.code.list_functions() if head.tokens[1] == name
    )
    return next(heads, (None, None))


def _list_parameters(head: Statement) -> list[str]:
    end = head.tokens.index(")") if ")" in head.tokens else len(head.tokens)
    return [
        token
        for place, token in enumerate(head.tokens[:end])
        if is_name(token) and head.tokens[place - 1] in ("(", ",")
    ]


def _list_arguments(name: str, clues: Clues) -> list[str]:
    """Return the argument names in a call of the function, with a placeholder for each that is not a name."""
    for listing in clues.responder_process_listings:
        for statement in listing.code.statements:
            for call in statement.calls:
                if call.name == name:
                    names = [one[0] if len(one) == 1 and is_name(one[0]) else "" for one in call.arguments]
                    return [text or f"value{number}" for number, text in enumerate(names, 1)]
    return []


def _describe_call(name: str, clues: Clues) -> str:
    """Return the line of the first call of a function."""
    calls = (
        listing.locate(statement.line)
        for listing in clues.responder_process_listings
        for statement in listing.code.statements
        if any(call.name == name for call in statement.calls)
    )
    return next(calls, Sentence("another part"))


def _describe_parameter_count(number: int) -> str:
    named_counts = {0: Sentence("no parameter"), 1: Sentence("one parameter")}
    return named_counts.get(number, Sentence("%(number)s parameters", number=number))
