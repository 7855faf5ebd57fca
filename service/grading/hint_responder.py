"""Hints on responders: missing, not callable, or with wrong answers.

They need evidence from a trial. The responder's text only supplies the line.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator

from responders.message_format import JSON
from service.grading.fault_kinds import FaultKind, is_kind, read_values
from service.grading.hint_clues import Clues, find_listing
from service.grading.hint_code import Statement, join_tokens
from service.grading.hint_files import hint_about_redefined_functions
from service.grading.hint_formats import describe_return_line, hint_about_answers
from service.grading.judging.message_parts import quote_text
from submissions.raw_files import sanitise_name

_DOUBLE_JSON = re.compile(r'JSON::\s*"')
_MIN_SIMILARITY = 0.75
_RESPONDER = re.compile(r"responder\Z|\w+_responder\Z")
_RETURN = re.compile(r"\breturn\b")
_COLON = (('":"',), ("':'",))
_MAX_CONTENT_LENGTH = 12


def hint_about_misnamed_function(clues: Clues) -> Iterator[str]:
    """Yield a hint on a required function that exists under a similar name."""
    fault_values = (read_values(fault, FaultKind.MISSING_FUNCTION) for fault in clues.faults)
    required_name = next((values[0] for values in fault_values if values), None)
    if required_name is None:
        return
    functions = [(one, each) for one in clues.responders for each in one.code.list_functions() if not each.indent]
    similar_names = difflib.get_close_matches(required_name, [each.tokens[1] for _, each in functions], 1, 0.5)
    for listing, head in [pair for pair in functions if pair[1].tokens[1] in similar_names][:1]:
        yield (
            f"{listing.locate(head.line)} defines {sanitise_name(head.tokens[1])}; expected a function called "
            f"{required_name}"
        )


def hint_about_missing_responder(clues: Clues) -> Iterator[str]:
    """Yield a hint on a function that was probably meant as the responder, or that there is none."""
    if clues.missing == "responder" or not any(is_kind(fault, FaultKind.MISSING_RESPONDER) for fault in clues.faults):
        return
    if clues.idle_responder:
        yield (
            f"the cell that begins with {quote_text(clues.idle_responder)} is a Raw cell, which is not run. "
            "Change its type to Code"
        )
        return
    for listing in clues.programs:
        for head in listing.code.list_functions():
            if _RESPONDER.match(head.tokens[1]) and listing.part is None:
                yield (
                    f"{listing.locate(head.line)} defines {head.tokens[1]} in the robot program, where nothing calls "
                    f"it. Move it to a cell above, and add roboSim.pyresponder = {head.tokens[1]} below it"
                )
                return
    functions = [
        (listing, each) for listing in clues.responders for each in listing.code.list_functions() if not each.indent
    ]
    similar_functions = [
        pair for pair in functions if _measure_similarity(pair[1].tokens[1].lower(), "responder") >= _MIN_SIMILARITY
    ]
    for listing, head in (*similar_functions, *functions[-1:]):
        name, is_cell = head.tokens[1], listing.part is None
        if is_cell and _RESPONDER.match(name):
            return
        if similar_functions:
            yield f"{listing.locate(head.line)} defines {sanitise_name(name)}; expected a function called responder"
        elif is_cell:
            yield (
                f"{listing.locate(head.line)} defines {sanitise_name(name)}, but nothing makes it the responder. "
                f"Add the line roboSim.pyresponder = {name} below it"
            )
        else:
            yield (
                f"{listing.locate(head.line)} defines {sanitise_name(name)}, but there is no function called "
                "responder. Begin the function that answers the robot with def responder(text):"
            )
        return
    location = next((each.name for each in clues.responders if each.part is not None), "no cell")
    clause = "defines no responder" if location != "no cell" else "defines a responder"
    yield f'{location} {clause}. Add a function that begins with "def responder(text):"'


def hint_about_uncallable_responder(clues: Clues) -> Iterator[str]:
    """Yield a hint on a responder that does not take exactly one argument, or is not a function."""
    for fault in clues.faults:
        owner, called_name = read_values(fault, FaultKind.WRONG_ARGUMENTS) or ("", "")
        is_bad_call = bool(called_name) and not owner
        if fault.who != "responder" or not (is_bad_call or is_kind(fault, FaultKind.RESPONDER_NO_FUNCTION)):
            continue
        for listing in clues.responders:
            for statement in listing.code.statements:
                is_function = is_bad_call and fault.line is None and statement.tokens[:2] == ("def", called_name)
                if is_function and ":" in statement.tokens:
                    count = _describe_parameters(statement)
                    yield (
                        f"{listing.locate(statement.line)}: {join_tokens(statement.tokens)[4:-1]} expects {count}, "
                        f"but it is called with one text. Write def {statement.tokens[1]}(text):"
                    )
                    return
                if not is_bad_call and statement.tokens[:4] == ("roboSim", ".", "pyresponder", "="):
                    name = statement.tokens[4]
                    yield (
                        f"{listing.locate(statement.line)} assigns a text to roboSim.pyresponder; expected a function. "
                        f"Write it without brackets: roboSim.pyresponder = {name}"
                    )
                    return


def hint_about_called_responder(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``roboSim.pyresponder = responder()``, which failed in its cell."""
    for fault in clues.cell_errors:
        listing = find_listing(fault, clues)
        statement = listing.code.find_statement(fault.line) if listing is not None else None
        if listing is None or statement is None or statement.tokens[:4] != ("roboSim", ".", "pyresponder", "="):
            continue
        call = next((each for each in statement.calls if each.name == statement.tokens[4]), None)
        if call is not None:
            yield (
                f"{listing.locate(statement.line)} calls {call.name}, which failed: {fault.message.rstrip('.')}. Write "
                f"it without brackets: roboSim.pyresponder = {call.name}"
            )
            return


def hint_about_unreturned_answers(clues: Clues) -> Iterator[str]:
    """Yield a hint on a responder that ends without a return, in some or all branches."""
    if not any(is_kind(fault, FaultKind.NO_ANSWER) for fault in clues.faults):
        return
    for listing in clues.responders:
        for head in listing.code.list_functions():
            if not _RESPONDER.match(head.tokens[1]):
                continue
            body = listing.code.list_body(head)
            returns = [each for each in body if each.keyword == "return" and len(each.tokens) > 1]
            print_statements = [each for each in body if each.keyword == "print"]
            if print_statements and (not returns or print_statements[-1].line > returns[-1].line):
                line = print_statements[-1].line
                code_line = quote_text(listing.lines[line - 1])
                yield (
                    f"{listing.locate(line)}, {code_line}, prints the answer, but no line returns it. Return the "
                    "answer with return"
                )
            elif not returns:
                yield f"{listing.locate(head.line)}: {head.tokens[1]} has no return with an answer; expected one"
            elif any(each.tokens == ("return",) for each in body):
                line = next(each.line for each in body if each.tokens == ("return",))
                yield f"{listing.locate(line)}: return without a value answers nothing. Write the answer after return"
            else:
                yield (
                    f"{listing.locate(head.line)}: {head.tokens[1]} can end without a return, and then answers "
                    "nothing. Add a return with an answer as its last line"
                )
            return


def hint_about_unreadable_answers(clues: Clues) -> Iterator[str]:
    """Yield a hint on a return value that is not a text, or has invalid JSON after ``JSON::``."""
    unreadable_faults = (each for each in clues.faults if is_kind(each, FaultKind.UNREADABLE_ANSWER))
    fault = next((each for each in unreadable_faults if not each.agent), None)
    if fault is None or is_kind(fault, FaultKind.NO_ANSWER):
        return
    for listing in clues.responders:
        for head in listing.code.list_functions():
            returns = [
                each for each in listing.code.list_body(head) if each.keyword == "return" and len(each.tokens) > 1
            ]
            if not _RESPONDER.match(head.tokens[1]) or not returns:
                continue
            undumped_returns = [
                each for each in returns if not any(_is_dump_function(call.name) for call in each.calls)
            ]
            str_returns = [each for each in returns if each.has_token("str")]
            return_statement = (str_returns or undumped_returns or returns)[-1]
            fix = "Write json.dumps(...) instead of str(...)" if str_returns else fault.hint
            yield f"{listing.locate(return_statement.line)}: {fault.message.rstrip('.')}. {fix}"
            return


def hint_about_double_json(clues: Clues) -> Iterator[str]:
    """Yield a hint on an answer that is encoded as JSON twice."""
    if not any(_DOUBLE_JSON.match(text) for text in clues.answers):
        return
    for listing in clues.responders:
        dump_statements = [
            each for each in listing.code.statements if any(_is_dump_function(call.name) for call in each.calls)
        ]
        double_dumps = [
            each for each in dump_statements if sum(_is_dump_function(call.name) for call in each.calls) > 1
        ]
        for statement in (*double_dumps, *dump_statements[-1:]):
            yield (
                f"{listing.locate(statement.line)}: the object is made JSON twice, so the robot gets a text and no "
                "object. Call json.dumps once"
            )
            return


def hint_about_single_colon(clues: Clues) -> Iterator[str]:
    """Yield a hint on a message that is split at its first colon, so the rest begins with the second."""
    contents = {text.partition("::")[2][:_MAX_CONTENT_LENGTH] for text in clues.sent if "::" in text} - {""}
    if not clues.lost or not any(
        f":{each}" in text and f"::{each}" not in text for each in contents for text in clues.answers
    ):
        return
    for listing in clues.responder_process_listings:
        for statement in listing.code.statements:
            for call in statement.calls:
                method = call.name.rpartition(".")[2]
                if method in ("partition", "split") and call.arguments and call.arguments[0] in _COLON:
                    split_call = 'partition("::")' if method == "partition" else 'split("::", 1)'
                    yield (
                        f'{listing.locate(statement.line)} cuts the message at ":", so the rest still begins with '
                        f"a colon. The prefix ends in two colons: write {split_call}"
                    )
                    return


def hint_about_unqueued_answers(clues: Clues) -> Iterator[str]:
    """Yield a hint on an empty queue if no answer begins with JSON::, with the line that answers."""
    is_queue_empty = any(is_kind(fault, FaultKind.LIST_INDEX) and fault.who == "program" for fault in clues.faults)
    if (
        not is_queue_empty
        or not clues.should_use_queue
        or not clues.answers
        or any(JSON in text for text in clues.answers)
    ):
        return
    if any(True for _ in (*hint_about_answers(clues), *hint_about_wrong_prefix(clues))):
        return
    answer = quote_text(clues.answers[0])
    redefinition_hint = next((each for each in hint_about_redefined_functions(clues) if "responder again" in each), "")
    if redefinition_hint:
        yield (
            f"{redefinition_hint.partition('. ')[0]}. It answers {answer}, without {JSON}, so the queue stays empty. "
            "Delete it"
        )
        return
    location = describe_return_line(clues.answers[0], clues, _RETURN)
    yield (
        f"{location} answers {answer}, without {JSON} at its start, so the queue stays empty. "
        f'Write return "{JSON}" + json.dumps(...)'
    )


def hint_about_wrong_prefix(clues: Clues) -> Iterator[str]:
    """Yield a hint on an answer with the prefix PY::, which is for messages from the robot."""
    for text in clues.answers:
        if text.startswith("PY::") and clues.should_use_queue:
            location = clues.describe_matching_line("responder", re.compile(r"""["']PY::"""))
            yield (
                f'{location}: the answer is {quote_text(text)}, which begins with PY::; expected "{JSON}" at its start'
            )
            return


def _is_dump_function(name: str) -> bool:
    return name.rpartition(".")[2] in ("dumps", "dump")


def _describe_parameters(head: Statement) -> str:
    count = head.tokens.count(",") + (1 if head.tokens[2:5] != ("(", ")", ":") else 0)
    return {0: "nothing", 2: "two values", 3: "three values"}.get(count, f"{count} values")


def _measure_similarity(first_name: str, second_name: str) -> float:
    return difflib.SequenceMatcher(None, first_name, second_name).ratio()
