"""Hints on times and amounts in the wrong unit: milliseconds for seconds, or degrees for rotations."""

from __future__ import annotations

from service.grading.hint_clues import Listing
from service.grading.hint_code import CodeStatements, Statement, join_tokens
from service.grading.hint_tables import AMOUNTS
from service.language import translatable
from sim.sentences import Sentence

#: The largest angle, in degrees, for which a program probably means a turn of the robot and not of its wheels.
_LARGEST_TURN = 180


def describe_large_amount(code: CodeStatements, statement: Statement, time_limit: float) -> str:
    """Return a hint that a call has a time or an amount in the wrong unit; otherwise empty."""
    for call in statement.calls:
        usual_amount = AMOUNTS.get(call.name.rpartition(".")[2])
        arguments = [each for each in call.arguments if "=" not in each]
        number = code.number(arguments[-1]) if arguments else None
        if usual_amount is None or number is None or abs(number) < min(usual_amount[0], time_limit or usual_amount[0]):
            continue
        maximum, unit = usual_amount
        if abs(number) < maximum / 2:
            continue
        if unit == "seconds":
            return Sentence(
                "%(name)s takes seconds, and %(number)g seconds are too many. %(number)g milliseconds are %(seconds)g "
                "seconds: write %(seconds)g",
                name=call.name,
                number=number,
                seconds=number / 1000,
            )
        template = (
            translatable(
                "%(name)s takes rotations, and %(number)g are too many. Write on_for_degrees for degrees of the "
                "wheels, or try 0.5 to 4 rotations to turn the robot"
            )
            if abs(number) <= _LARGEST_TURN
            else translatable(
                "%(name)s takes rotations, and %(number)g rotations are too many. For %(number)g degrees of the wheels "
                "write on_for_degrees, or %(rotations)g rotations"
            )
        )
        return Sentence(template, name=call.name, number=number, rotations=number / 360)
    return ""


def describe_passed_amount(code: CodeStatements, listing: Listing, statement: Statement) -> str:
    """Return a hint on a call that gives a function a much too large number for an amount; otherwise empty."""
    head = next((each for each in code.list_enclosing(statement) if each.keyword == "def"), None)
    parameters = (
        [token for at, token in enumerate(head.tokens) if at > 2 and head.tokens[at - 1] in "(,"] if head else []
    )
    for call in statement.calls if head is not None else ():
        usual_amount = AMOUNTS.get(call.name.rpartition(".")[2])
        name = call.arguments[-1][0] if call.arguments and len(call.arguments[-1]) == 1 else ""
        if usual_amount is None or head is None or name not in parameters:
            continue
        for caller in code.statements:
            for outer in caller.calls if caller is not head else ():
                place = parameters.index(name)
                argument = outer.arguments[place] if len(outer.arguments) > place else ()
                number = code.number(argument[2:] if argument[1:2] == ("=",) else argument) if argument else None
                if outer.name == head.tokens[1] and number is not None and abs(number) >= usual_amount[0]:
                    template = (
                        translatable(
                            "%(place)s gives %(function)s %(number)g for %(name)s, and %(number)g seconds are too "
                            "many. Check the order of the values: %(parameters)s"
                        )
                        if usual_amount[1] == "seconds"
                        else translatable(
                            "%(place)s gives %(function)s %(number)g for %(name)s, and %(number)g rotations are too "
                            "many. Check the order of the values: %(parameters)s"
                        )
                    )
                    return Sentence(
                        template,
                        place=listing.locate(caller.line),
                        function=outer.name,
                        number=number,
                        name=name,
                        parameters=join_tokens(head.tokens)[4:-1],
                    )
    return ""
