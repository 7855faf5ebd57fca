"""Hints on responders: missing, not callable, or with wrong answers.

They need evidence from a trial. The responder's text only supplies the line.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator

from responders.message_format import JSON
from service.grading.hint_clues import Clues
from service.grading.hint_code import Statement, join_tokens
from service.grading.hint_files import hint_about_redefined_functions
from service.grading.hint_formats import describe_return_line, hint_about_answers
from service.grading.judging.message_parts import quote_text
from submissions.raw_files import sanitise_name

_MISSING_RESPONDER = "there is no responder: "
_NOTHING_RETURNED = "the responder returned NoneType"
_NO_FUNCTION = re.compile(r"there is no function called (\w+)")
_BAD_CALL = re.compile(r"TypeError: (\w+)\(\) (?:takes|missing)")
_NOT_CALLABLE = "roboSim.pyresponder is "
_UNREADABLE = re.compile(r"the responder returned \w+|begins with JSON:: but is not JSON")
_DOUBLE_JSON = re.compile(r'JSON::\s*"')
_MIN_SIMILARITY = 0.75
_RESPONDER = re.compile(r"responder\Z|\w+_responder\Z")
_EMPTY = re.compile(r"IndexError: list index out of range")
_RETURN = re.compile(r"\breturn\b")
_COLON = (('":"',), ("':'",))
_MOST_OF_CONTENT = 12
_PY = re.compile(r"""["']PY::""")


def hint_about_misnamed_function(clues: Clues) -> Iterator[str]:
    """Yield a hint on a required function that exists under a similar name."""
    names = (_NO_FUNCTION.search(fault.message) for fault in clues.faults)
    asked = next((name[1] for name in names if name), None)
    if asked is None:
        return
    found = [(one, each) for one in clues.responders for each in one.code.list_functions() if not each.indent]
    near = difflib.get_close_matches(asked, [each.tokens[1] for _, each in found], 1, 0.5)
    for listing, each in [pair for pair in found if pair[1].tokens[1] in near][:1]:
        yield f"{listing.locate(each.line)} defines {sanitise_name(each.tokens[1])}; expected a function called {asked}"


def hint_about_missing_responder(clues: Clues) -> Iterator[str]:
    """Yield a hint on a function that was probably meant as the responder, or that there is none."""
    if clues.missing == "responder" or not any(_MISSING_RESPONDER in fault.message for fault in clues.faults):
        return
    if clues.idle_responder:
        yield (
            f"the cell that begins with {quote_text(clues.idle_responder)} is a Raw cell, which is not run. "
            "Change its type to Code"
        )
        return
    for listing in clues.programs:
        for each in listing.code.list_functions():
            if _RESPONDER.match(each.tokens[1]) and listing.part is None:
                yield (
                    f"{listing.locate(each.line)} defines {each.tokens[1]} in the robot program, where nothing "
                    "calls it. "
                    f"Move it to a cell above, and add roboSim.pyresponder = {each.tokens[1]} below it"
                )
                return
    found = [
        (listing, each) for listing in clues.responders for each in listing.code.list_functions() if not each.indent
    ]
    near = [pair for pair in found if _measure_similarity(pair[1].tokens[1].lower(), "responder") >= _MIN_SIMILARITY]
    for listing, each in (*near, *found[-1:]):
        name, is_cell = each.tokens[1], listing.part is None
        if is_cell and _RESPONDER.match(name):
            return
        if near:
            yield f"{listing.locate(each.line)} defines {sanitise_name(name)}; expected a function called responder"
        elif is_cell:
            yield (
                f"{listing.locate(each.line)} defines {sanitise_name(name)}, but nothing makes it the responder. "
                f"Add the line roboSim.pyresponder = {name} below it"
            )
        else:
            yield (
                f"{listing.locate(each.line)} defines {sanitise_name(name)}, but there is no function called "
                "responder. "
                "Begin the function that answers the robot with def responder(text):"
            )
        return
    where = next((each.name for each in clues.responders if each.part is not None), "no cell")
    says = "defines no responder" if where != "no cell" else "defines a responder"
    yield f'{where} {says}. Add a function that begins with "def responder(text):"'


def hint_about_uncallable_responder(clues: Clues) -> Iterator[str]:
    """Yield a hint on a responder that does not take exactly one argument, or is not a function."""
    for fault in clues.faults:
        bad = _BAD_CALL.match(fault.message)
        if fault.who != "responder" or not (bad or _NOT_CALLABLE in fault.message):
            continue
        for listing in clues.responders:
            for each in listing.code.statements:
                is_function = bad is not None and fault.line is None and each.tokens[:2] == ("def", bad[1])
                if is_function and ":" in each.tokens:
                    count = _describe_parameters(each)
                    yield (
                        f"{listing.locate(each.line)}: {join_tokens(each.tokens)[4:-1]} asks for {count}, but it "
                        "is called with "
                        f"one text. Write def {each.tokens[1]}(text):"
                    )
                    return
                if not bad and each.tokens[:4] == ("roboSim", ".", "pyresponder", "="):
                    name = each.tokens[4]
                    yield (
                        f"{listing.locate(each.line)} assigns a text to roboSim.pyresponder; expected a function. "
                        f"Write it without brackets: roboSim.pyresponder = {name}"
                    )
                    return


def hint_about_unreturned_answers(clues: Clues) -> Iterator[str]:
    """Yield a hint on a responder that ends without a return, in some or all branches."""
    if not any(fault.message.startswith(_NOTHING_RETURNED) for fault in clues.faults):
        return
    for listing in clues.responders:
        for head in listing.code.list_functions():
            if not _RESPONDER.match(head.tokens[1]):
                continue
            body = listing.code.list_body(head)
            returns = [each for each in body if each.keyword == "return" and len(each.tokens) > 1]
            prints = [each for each in body if each.keyword == "print"]
            if prints and (not returns or prints[-1].line > returns[-1].line):
                line = prints[-1].line
                said = quote_text(listing.lines[line - 1])
                yield (
                    f"{listing.locate(line)}, {said}, prints the answer, but no line returns it. Return the "
                    "answer with "
                    "return"
                )
            elif not returns:
                yield f"{listing.locate(head.line)}: {head.tokens[1]} has no return with an answer; expected one"
            elif any(each.tokens == ("return",) for each in body):
                line = next(each.line for each in body if each.tokens == ("return",))
                yield f"{listing.locate(line)}: return without a value answers nothing. Write the answer after return"
            else:
                yield (
                    f"{listing.locate(head.line)}: {head.tokens[1]} can come to its end without a return, and answers "
                    "nothing then. Add a return with an answer as its last line"
                )
            return


def hint_about_unreadable_answers(clues: Clues) -> Iterator[str]:
    """Yield a hint on a return value that is not a text, or has invalid JSON after ``JSON::``."""
    fault = next((each for each in clues.faults if _UNREADABLE.search(each.message) and not each.agent), None)
    if fault is None or _NOTHING_RETURNED in fault.message:
        return
    for listing in clues.responders:
        for head in listing.code.list_functions():
            returns = [
                each for each in listing.code.list_body(head) if each.keyword == "return" and len(each.tokens) > 1
            ]
            if not _RESPONDER.match(head.tokens[1]) or not returns:
                continue
            plain = [each for each in returns if not any(_is_dump_function(call.name) for call in each.calls)]
            texts = [each for each in returns if each.has_token("str")]
            each = (texts or plain or returns)[-1]
            fix = "Write json.dumps(...) in place of str(...)" if texts else fault.hint
            yield f"{listing.locate(each.line)}: {fault.message.rstrip('.')}. {fix}"
            return


def hint_about_double_json(clues: Clues) -> Iterator[str]:
    """Yield a hint on an answer that is encoded as JSON twice."""
    if not any(_DOUBLE_JSON.match(text) for text in clues.answers):
        return
    for listing in clues.responders:
        dumps = [each for each in listing.code.statements if any(_is_dump_function(call.name) for call in each.calls)]
        twice = [each for each in dumps if sum(_is_dump_function(call.name) for call in each.calls) > 1]
        for each in (*twice, *dumps[-1:]):
            yield (
                f"{listing.locate(each.line)}: the object is made JSON twice, so the robot gets a text and no object. "
                "Call json.dumps once"
            )
            return


def hint_about_single_colon(clues: Clues) -> Iterator[str]:
    """Yield a hint on a message that is split at its first colon, so the rest begins with the second."""
    contents = {text.partition("::")[2][:_MOST_OF_CONTENT] for text in clues.sent if "::" in text} - {""}
    if not clues.lost or not any(
        f":{each}" in text and f"::{each}" not in text for each in contents for text in clues.answers
    ):
        return
    for listing in clues.responder_process_listings:
        for each in listing.code.statements:
            for call in each.calls:
                method = call.name.rpartition(".")[2]
                if method in ("partition", "split") and call.arguments and call.arguments[0] in _COLON:
                    cut = 'partition("::")' if method == "partition" else 'split("::", 1)'
                    yield (
                        f'{listing.locate(each.line)} cuts the message at ":", so the rest still begins with a colon. '
                        f"The prefix ends in two colons: write {cut}"
                    )
                    return


def hint_about_unqueued_answers(clues: Clues) -> Iterator[str]:
    """Yield a hint on an empty queue if no answer begins with JSON::, with the line that answers."""
    empty = any(_EMPTY.match(fault.message) and fault.who == "program" for fault in clues.faults)
    if not empty or not clues.should_use_queue or not clues.answers or any(JSON in text for text in clues.answers):
        return
    if any(True for _ in (*hint_about_answers(clues), *hint_about_wrong_prefix(clues))):
        return
    answer = quote_text(clues.answers[0])
    again = next((each for each in hint_about_redefined_functions(clues) if "responder again" in each), "")
    if again:
        yield f"{again.partition('. ')[0]}. It answers {answer}, without {JSON}, so the queue stays empty. Delete it"
        return
    where = describe_return_line(clues.answers[0], clues, _RETURN)
    yield (
        f"{where} answers {answer}, without {JSON} at its start, so the queue stays empty. "
        f'Write return "{JSON}" + json.dumps(...)'
    )


def hint_about_wrong_prefix(clues: Clues) -> Iterator[str]:
    """Yield a hint on an answer with the prefix PY::, which is for messages from the robot."""
    for text in clues.answers:
        if text.startswith("PY::") and clues.should_use_queue:
            where = clues.describe_matching_line("responder", re.compile(r"""["']PY::"""))
            yield f'{where}: the answer is {quote_text(text)}, which begins with PY::; expected "{JSON}" at its start'
            return


def _is_dump_function(name: str) -> bool:
    return name.rpartition(".")[2] in ("dumps", "dump")


def _describe_parameters(head: Statement) -> str:
    count = head.tokens.count(",") + (1 if head.tokens[2:5] != ("(", ")", ":") else 0)
    return {0: "nothing", 2: "two values", 3: "three values"}.get(count, f"{count} values")


def _measure_similarity(one: str, other: str) -> float:
    return difflib.SequenceMatcher(None, one, other).ratio()
