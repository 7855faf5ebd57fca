"""Hints on functions that the grader calls directly: their name, return value and position.

Calls and return values come from the criteria's results. No robot runs.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator
from dataclasses import replace

from responders.message_format import IMG_DATA, PY
from service.grading.fault_kinds import FaultKind, is_kind, read_values
from service.grading.findings import FailedCall, UnloadedResponder, WrongHiddenCalls, WrongReturn
from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import LOOPS, Statement, guess_result_name, join_tokens
from service.grading.hint_differences import advise_on_difference
from service.grading.hint_errors import describe_error
from service.grading.judging.message_parts import quote_text
from service.language import translatable
from sim.recording import Fault, Verdict
from sim.sentences import Sentence, make_clause
from submissions.criteria.code import Functions
from submissions.raw_files import sanitise_name

_MIN_SIMILARITY = 0.75
#: Functions that make an object from a text, and methods that take the beginning of a text off.
_READERS = frozenset({"loads", "literal_eval"})
_PREFIX_METHODS = frozenset({"removeprefix", "partition", "split", "replace", "lstrip", "find", "index"})
_SLICE = re.compile(r"\[\w*\s*:")
#: Errors of programs that read a message. An ``except`` with three of them catches enough.
_COMMON_ERRORS = frozenset({"ValueError", "KeyError", "TypeError", "IndexError", "SyntaxError", "AttributeError"})


def hint_about_returned_values(clues: Clues) -> Iterator[str]:
    """Yield the line that makes a wrong value, and how the value differs from the expected one."""
    messages = {each.id: each.message for each in clues.results}
    for criterion in clues.costliest_criteria:
        message, wrong = messages.get(criterion.id, ""), clues.find_finding(criterion, WrongReturn)
        if wrong is None or not message:
            continue
        advice = advise_on_difference(wrong.expected, wrong.returned)
        if not advice and isinstance(wrong.returned, list) and isinstance(next(iter(wrong.returned), None), list):
            advice = advise_on_difference([], [[]])
        advice = advice or _describe_other_return(wrong, clues)
        literals = _find_literal_statements(wrong.returned, clues)
        value_statement = literals[0] if literals else _find_value_statement(wrong.function, clues)
        if len(literals) > 1 and not _describe_missing_literal(wrong, clues):
            value_statement = _find_value_statement(wrong.function, clues)
        if value_statement is not None:
            listing, statement = value_statement
            yield Sentence(
                "%(place)s, %(code)s: %(problem)s. %(advice)s",
                place=listing.locate(statement.line),
                code=join_tokens(statement.tokens),
                problem=make_clause(message),
                advice=advice or Sentence("Work this call out by hand, line by line, and compare"),
            )
            return


def _describe_other_return(wrong: WrongReturn, clues: Clues) -> str:
    """Return the line with the text that was expected, if one text in quotes came in place of another."""
    missing = _describe_missing_literal(wrong, clues)
    if missing:
        return missing
    expected, actual = (_find_literal_statement(each, clues) for each in (wrong.expected, wrong.returned))
    if expected is None or actual is None or expected[0] is not actual[0]:
        return ""
    listing, statement = expected
    heads = [
        next((each for each in listing.code.list_enclosing(one) if each.keyword in ("if", "elif")), None)
        for one in (actual[1], statement)
    ]
    if heads[0] is None or heads[1] is None or heads[0] is heads[1]:
        return ""
    return Sentence(
        "%(text)s is in line %(line)s. Compare the conditions in lines %(first)s and %(second)s with the rules: they "
        "or the two texts may be swapped",
        text=quote_text(str(wrong.expected)),
        line=statement.line,
        first=heads[0].line,
        second=heads[1].line,
    )


def _describe_missing_literal(wrong: WrongReturn, clues: Clues) -> str:
    """Return the lines with a text that came twice, if no line has the expected one."""
    if not all(isinstance(each, str) and each for each in (wrong.expected, wrong.returned)):
        return ""
    literals = _find_literal_statements(wrong.returned, clues)
    if _find_literal_statements(wrong.expected, clues) or len(literals) != 2:
        return ""
    lines = [each.line for _, each in literals]
    return Sentence(
        "No line gives %(expected)s, and lines %(first)s and %(second)s both give %(actual)s. Write %(expected)s in "
        "one of them",
        expected=quote_text(str(wrong.expected)),
        first=lines[0],
        second=lines[1],
        actual=quote_text(str(wrong.returned)),
    )


def hint_about_hidden_prefix(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``json.loads(text)`` of a text that begins with PY::, which fails within ``try``."""
    texts = [
        argument
        for each in clues.lost
        if isinstance(each, Functions)
        for call in each.calls
        for argument in call.arguments
        if isinstance(argument, str) and argument.startswith((PY, f"{IMG_DATA}::"))
    ]
    for listing in clues.responders if texts else ():
        statements = listing.code.statements
        if any(each.has_token(*_PREFIX_METHODS) for each in statements) or listing.find_line(_SLICE):
            continue
        for statement in statements:
            call = next((one for one in statement.calls if one.name.rpartition(".")[2] in _READERS), None)
            if call is not None and len(call.arguments) == 1 and len(call.arguments[0]) == 1:
                prefix = texts[0].partition("::")[0]
                fixed = f'{call.name}({call.arguments[0][0]}.removeprefix("{prefix}::"))'
                yield Sentence(
                    "%(place)s reads the whole text, which begins with %(prefix)s::, and fails. Take the beginning "
                    "off: %(code)s",
                    place=listing.locate(statement.line),
                    prefix=prefix,
                    code=fixed,
                )
                return


def hint_about_narrow_except(clues: Clues) -> Iterator[str]:
    """Yield a hint on an ``except`` that catches too few errors, if only hidden calls failed."""
    for criterion in clues.costliest_criteria:
        if clues.find_finding(criterion, WrongHiddenCalls) is None:
            continue
        for listing in clues.responders:
            for statement in listing.code.statements:
                is_narrow = len(statement.tokens) > 2 and len(_COMMON_ERRORS & set(statement.tokens)) < 3
                if statement.keyword == "except" and is_narrow and not statement.has_token("Exception"):
                    yield Sentence(
                        "%(place)s catches only %(errors)s. Another error, such as KeyError or TypeError, ends the "
                        "function. Write except Exception:",
                        place=listing.locate(statement.line),
                        errors=join_tokens(statement.tokens[1:]).rstrip(":"),
                    )
                    return


def _find_literal_statement(value: object, clues: Clues) -> tuple[Listing, Statement] | None:
    """Return the only statement that returns or assigns a text in quotes; None for other values."""
    candidates = _find_literal_statements(value, clues)
    return candidates[0] if len(candidates) == 1 else None


def _find_literal_statements(value: object, clues: Clues) -> list[tuple[Listing, Statement]]:
    """Return the statements that return or assign a text in quotes; empty for other values."""
    if not isinstance(value, str) or not value:
        return []
    return [
        (listing, each)
        for listing in clues.responders
        for each in listing.code.statements
        if each.tokens[-1][:1] in ("'", '"') and each.tokens[-1][1:-1] == value
    ]


def _find_value_statement(name: str, clues: Clues) -> tuple[Listing, Statement] | None:
    """Return the statement that makes the value of a function: its only append, otherwise its only computed return."""
    for listing in clues.responders:
        for head in listing.code.list_functions():
            body = listing.code.list_body(head) if head.tokens[1] == name else ()
            appends = [each for each in body if any(call.name.endswith(".append") for call in each.calls)]
            returns = [each for each in body if each.keyword == "return" and len(each.tokens) > 1]
            # A returned name says nothing about the line that went wrong.
            computed_returns = [each for each in returns if len(each.tokens) > 2]
            for candidates in (appends, computed_returns):
                if len(candidates) == 1:
                    return listing, candidates[0]
    return None


def hint_about_functions(clues: Clues) -> Iterator[str]:
    """Yield one hint for each function that lost marks."""
    for criterion in clues.lost:
        if not isinstance(criterion, Functions):
            continue
        names = {criterion.function, *(call.function for call in criterion.calls)} - {""}
        for name in sorted(names):
            hint = _hint_about_function_error(criterion, clues) or _hint_about_function(name, criterion, clues)
            if hint:
                yield hint
                break


def hint_about_wrong_values(criterion: Functions, message: str, clues: Clues) -> str:
    """Return a hint with the function, its call and the value. It names no line, since the return may be correct."""
    problem = make_clause(message)
    if clues.find_finding(criterion, WrongHiddenCalls) is None:
        call = clues.find_finding(criterion, WrongReturn) or clues.find_finding(criterion, FailedCall)
        function = criterion.function if call is None else call.function
        return Sentence("The function %(function)s: %(problem)s", function=function, problem=problem)
    return Sentence(
        "The function %(function)s: %(problem)s. Call it yourself with other arguments: 0, the largest and the "
        "smallest, equal ones, numbers with a fraction, and those on the borders of each rule",
        function=criterion.function,
        problem=problem,
    )


def describe_missing_return(listing: Listing, head: Statement) -> str:
    """Return a hint that the function has no return, with the line to add."""
    result = guess_result_name(listing.code.list_body(head))
    template = (
        translatable(
            "%(place)s: %(function)s has no return, so it gives nothing back. Add return %(result)s as its last line"
        )
        if result
        else translatable("%(place)s: %(function)s has no return, so it gives nothing back. Add return with the result")
    )
    return Sentence(template, place=listing.locate(head.line), function=head.tokens[1], result=result)


def hint_about_missing_return(clues: Clues) -> Iterator[str]:
    """Yield a hint on a function such as ``train`` that ends without a return."""
    fault_values = (read_values(fault, FaultKind.NO_RETURN) for fault in clues.faults)
    name = next((values[0] for values in fault_values if values), "")
    for listing in clues.responders:
        for head in listing.code.list_functions():
            has_return = any(each.keyword == "return" for each in listing.code.list_body(head))
            if head.tokens[1] == name and not has_return:
                yield describe_missing_return(listing, head)
                return


def find_early_return(listing: Listing, head: Statement) -> Statement | None:
    """Return a return that ends a loop in its first iteration, or None.

    It is directly in the loop, or in the else of an if whose branches all return.
    """
    for statement in listing.code.list_body(head):
        parent = listing.code.statements[statement.parent] if statement.parent >= 0 else None
        if statement.keyword != "return" or parent is None:
            continue
        if parent.keyword in LOOPS or (parent.keyword == "else" and _has_exhaustive_returns(listing, parent)):
            return statement
    return None


def _has_exhaustive_returns(listing: Listing, else_branch: Statement) -> bool:
    """Return whether an ``else`` is directly in a loop and all branches before it also end with a return."""
    loop = listing.code.statements[else_branch.parent] if else_branch.parent >= 0 else None
    if loop is None or loop.keyword not in LOOPS:
        return False
    siblings = [
        each for each in listing.code.list_body(loop) if each.parent == loop.number and each.number < else_branch.number
    ]
    for branch in reversed(siblings):
        last_statement = [one for one in listing.code.list_body(branch) if one.parent == branch.number][-1:]
        if branch.keyword not in ("if", "elif") or not last_statement or last_statement[0].keyword != "return":
            return False
        if branch.keyword == "if":
            return True
    return False


def _is_shorter_list(wrong: WrongReturn) -> bool:
    """Return whether a function returned a list with fewer values than expected."""
    match wrong.expected, wrong.returned:
        case [*expected], list(returned):
            return len(returned) < len(expected)
    return False


def _find_call_fault(criterion: Functions, clues: Clues) -> Fault | None:
    """Return the fault of the criterion's first call that failed, or of loading the responder."""
    failure = clues.find_finding(criterion, FailedCall) or clues.find_finding(criterion, UnloadedResponder)
    return None if failure is None else failure.fault


def _hint_about_function_error(criterion: Functions, clues: Clues) -> str:
    """Return the line where a called function failed, with advice on its error; empty if unknown."""
    fault = _find_call_fault(criterion, clues)
    listing = next((each for each in clues.responders if each.part == "responder"), None)
    if fault is None or fault.verdict is not Verdict.RESPONDER_ERROR or fault.line is None or listing is None:
        return ""
    # The tables give better advice than the similar name of an attribute: math.pi and not pi for math.PI.
    error = describe_error(replace(fault, hint=""), clues)
    place = listing.locate(fault.line)
    return "" if fault.file else Sentence("%(place)s: %(problem)s", place=place, problem=error)


def _find_inner_function(name: str, clues: Clues) -> str:
    """Return a hint on a function that is defined inside another one; empty if there is none of this name."""
    for listing in clues.responders:
        for head in listing.code.list_functions():
            outer = next((each for each in listing.code.list_enclosing(head) if each.keyword == "def"), None)
            if head.tokens[1] == name and outer is not None:
                return Sentence(
                    "%(place)s defines %(name)s inside %(outer)s, so nothing else calls it. Move it to the left edge",
                    place=listing.locate(head.line),
                    name=name,
                    outer=sanitise_name(outer.tokens[1]),
                )
    return ""


def _hint_about_function(name: str, criterion: Functions, clues: Clues) -> str:
    functions = [
        (listing, head) for listing in clues.responders for head in listing.code.list_functions() if not head.indent
    ]
    function = next(((listing, head) for listing, head in functions if head.tokens[1] == name), None)
    if function is None:
        fault = _find_call_fault(criterion, clues)
        if fault is None or not is_kind(fault, FaultKind.MISSING_FUNCTION):
            return ""
        inner = _find_inner_function(name, clues)
        if inner:
            return inner
        similar_names = difflib.get_close_matches(name, [head.tokens[1] for _, head in functions], 1, _MIN_SIMILARITY)
        listing, head = next(((one, each) for one, each in functions if each.tokens[1] in similar_names), (None, None))
        if listing is None or head is None:
            return ""
        return Sentence(
            "%(place)s defines %(function)s; expected a function called %(expected)s",
            place=listing.locate(head.line),
            function=sanitise_name(head.tokens[1]),
            expected=name,
        )
    listing, head = function
    fault = _find_call_fault(criterion, clues)
    missing = None if fault is None or fault.line else read_values(fault, FaultKind.MISSING_ARGUMENT)
    if missing is not None and missing[0] == name:
        return Sentence(
            "%(place)s: %(function)s is also called without %(name)s. Give %(name)s a value for such calls, with "
            "%(name)s=... in this line, or remove it",
            place=listing.locate(head.line),
            function=name,
            name=missing[1],
        )
    body = listing.code.list_body(head)
    returns = [each for each in body if each.keyword == "return" and len(each.tokens) > 1]
    print_statement = next((each for each in body if each.keyword == "print"), None)
    if not returns and print_statement is not None:
        return Sentence(
            "%(place)s prints the result of %(function)s and does not return it. Write return there",
            place=listing.locate(print_statement.line),
            function=name,
        )
    wrong = clues.find_finding(criterion, WrongReturn)
    if not returns and wrong is not None and wrong.returned is None:
        return describe_missing_return(listing, head)
    early_return = find_early_return(listing, head)
    if early_return is not None:
        return Sentence(
            "%(place)s: return is in the loop, so %(function)s ends in the first pass of the loop. Move return below "
            "the loop: indent it less",
            place=listing.locate(early_return.line),
            function=name,
        )
    stop = next((each for each in body if each.tokens == ("break",)), None)
    if stop is not None and wrong is not None and _is_shorter_list(wrong):
        condition = listing.code.statements[stop.parent]
        if condition.keyword == "if" and condition.tokens.count("!=") == 1:
            return Sentence(
                "%(place)s: break ends the loop as soon as %(condition)s. Write == in place of != in line %(line)s",
                place=listing.locate(stop.line),
                condition=join_tokens(condition.condition),
                line=condition.line,
            )
        return Sentence(
            "%(place)s: break ends the whole loop, so %(function)s returns too few values. To skip only this value, "
            "write continue instead of break",
            place=listing.locate(stop.line),
            function=name,
        )
    return ""
