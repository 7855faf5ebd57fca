"""Hints on responders: missing, not callable, or with wrong answers.

They need evidence from a trial. The responder's text only supplies the line.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator

from responders.message_format import JSON
from service.grading.fault_kinds import FaultKind, is_kind, read_values
from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import Statement, join_tokens
from service.grading.hint_files import hint_about_redefined_functions
from service.grading.hint_formats import describe_return_line, hint_about_answers
from service.grading.judging.message_parts import describe_fault, quote_text
from service.language import translatable
from sim.sentences import Sentence
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
        yield Sentence(
            "%(place)s defines %(name)s; expected a function called %(required)s",
            place=listing.locate(head.line),
            name=sanitise_name(head.tokens[1]),
            required=required_name,
        )


def hint_about_missing_responder(clues: Clues) -> Iterator[str]:
    """Yield a hint on a function that was probably meant as the responder, or that there is none."""
    if clues.missing == "responder" or not any(is_kind(fault, FaultKind.MISSING_RESPONDER) for fault in clues.faults):
        return
    if clues.idle_responder:
        yield Sentence(
            "the cell that begins with %(code)s is a Raw cell, which is not run. Change its type to Code",
            code=quote_text(clues.idle_responder),
        )
        return
    for listing in clues.programs:
        for head in listing.code.list_functions():
            if _RESPONDER.match(head.tokens[1]) and listing.part is None:
                yield Sentence(
                    "%(place)s defines %(name)s in the robot program, where nothing calls it. Move it to a "
                    "cell above, and add roboSim.pyresponder = %(name)s below it",
                    place=listing.locate(head.line),
                    name=head.tokens[1],
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
            yield Sentence(
                "%(place)s defines %(name)s; expected a function called %(required)s",
                place=listing.locate(head.line),
                name=sanitise_name(name),
                required="responder",
            )
        elif is_cell:
            yield Sentence(
                "%(place)s defines %(name)s, but nothing makes it the responder. Add the line "
                "roboSim.pyresponder = %(name)s below it",
                place=listing.locate(head.line),
                name=sanitise_name(name),
            )
        else:
            yield Sentence(
                "%(place)s defines %(name)s, but there is no function called responder. Begin the function that "
                "answers the robot with def responder(text):",
                place=listing.locate(head.line),
                name=sanitise_name(name),
            )
        return
    file = next((each.name for each in clues.responders if each.part is not None), "")
    template = (
        translatable('%(file)s defines no responder. Add a function that begins with "def responder(text):"')
        if file
        else translatable('no cell defines a responder. Add a function that begins with "def responder(text):"')
    )
    yield Sentence(template, file=file)


def hint_about_helper_as_responder(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``roboSim.pyresponder = focus``, if focus is a function that the responder itself calls."""
    if not clues.lost:
        return
    functions = {
        each.tokens[1]: (listing, each) for listing in clues.responders for each in listing.code.list_functions()
    }
    callers = {
        call.name: name
        for name, (listing, head) in functions.items()
        if _RESPONDER.match(name)
        for each in listing.code.list_body(head)
        for call in each.calls
    }
    assignments = [
        (listing, each)
        for listing in clues.responders
        for each in listing.code.statements
        if each.tokens[:4] == ("roboSim", ".", "pyresponder", "=") and len(each.tokens) == 5
    ]
    for listing, statement in assignments[-1:]:
        name = statement.tokens[4]
        if name in functions and name in callers and not _RESPONDER.match(name):
            yield Sentence(
                "%(place)s makes %(name)s the responder, a function that %(right)s calls. Write roboSim.pyresponder = "
                "%(right)s",
                place=listing.locate(statement.line),
                name=name,
                right=callers[name],
            )


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
                    yield Sentence(
                        "%(place)s: %(code)s expects %(count)s, but it is called with one text. Write def "
                        "%(name)s(text):",
                        place=listing.locate(statement.line),
                        code=join_tokens(statement.tokens)[4:-1],
                        count=_describe_parameters(statement),
                        name=statement.tokens[1],
                    )
                    return
                if not is_bad_call and statement.tokens[:4] == ("roboSim", ".", "pyresponder", "="):
                    yield Sentence(
                        "%(place)s assigns a text to roboSim.pyresponder; expected a function. Write it without "
                        "brackets: roboSim.pyresponder = %(name)s",
                        place=listing.locate(statement.line),
                        name=statement.tokens[4],
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
                yield Sentence(
                    "%(place)s, %(code)s, prints the answer, but no line returns it. Return the answer with return",
                    place=listing.locate(line),
                    code=quote_text(listing.lines[line - 1]),
                )
            elif not returns:
                yield Sentence(
                    "%(place)s: %(name)s has no return with an answer; expected one",
                    place=listing.locate(head.line),
                    name=head.tokens[1],
                )
            elif any(each.tokens == ("return",) for each in body):
                line = next(each.line for each in body if each.tokens == ("return",))
                yield Sentence(
                    "%(place)s: return without a value answers nothing. Write the answer after return",
                    place=listing.locate(line),
                )
            else:
                yield Sentence(
                    "%(place)s: %(name)s can end without a return, and then answers nothing. Add a return "
                    "with an answer as its last line",
                    place=listing.locate(head.line),
                    name=head.tokens[1],
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
            yield Sentence(
                "%(place)s: %(problem)s. %(advice)s",
                place=listing.locate(return_statement.line),
                problem=fault.message.rstrip("."),
                advice=Sentence("Write json.dumps(...) instead of str(...)") if str_returns else fault.hint,
                fault=describe_fault(fault),
            )
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
            yield Sentence(
                "%(place)s: the object is made JSON twice, so the robot gets a text and no object. Call "
                "json.dumps once",
                place=listing.locate(statement.line),
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
                    yield Sentence(
                        '%(place)s cuts the message at ":", so the rest still begins with a colon. The prefix '
                        "ends in two colons: write %(code)s",
                        place=listing.locate(statement.line),
                        code=split_call,
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
    redefinition = _describe_redefinition(clues)
    if redefinition:
        yield Sentence(
            "%(problem)s. It answers %(answer)s, without JSON::, so the queue stays empty. Delete it",
            problem=redefinition,
            answer=answer,
        )
        return
    location = describe_return_line(clues.answers[0], clues, _RETURN)
    yield Sentence(
        '%(place)s answers %(answer)s, without JSON:: at its start, so the queue stays empty. Write return "JSON::" + '
        "json.dumps(...)",
        place=location,
        answer=answer,
    )


def _describe_redefinition(clues: Clues) -> str:
    """Return where a responder replaces an earlier one; empty if none does."""
    if not any("responder again" in each for each in hint_about_redefined_functions(clues)):
        return ""
    definitions: dict[str, tuple[Listing, Statement]] = {}
    for listing in clues.responders:
        for head in listing.code.list_functions():
            name = head.tokens[1]
            if head.indent or not name.endswith("responder"):
                continue
            if name in definitions:
                earlier_listing, earlier_head = definitions[name]
                is_near = earlier_listing is listing
                earlier_line = Sentence("line %(line)s", line=earlier_head.line)
                return Sentence(
                    "%(place)s defines %(name)s again, instead of the function in %(other_place)s",
                    place=listing.locate(head.line),
                    name=name,
                    other_place=earlier_line if is_near else earlier_listing.locate(earlier_head.line),
                )
            definitions[name] = listing, head
    return ""


def hint_about_wrong_prefix(clues: Clues) -> Iterator[str]:
    """Yield a hint on an answer with the prefix PY::, which is for messages from the robot."""
    for text in clues.answers:
        if text.startswith("PY::") and clues.should_use_queue:
            location = clues.describe_matching_line("responder", re.compile(r"""["']PY::"""))
            yield Sentence(
                '%(place)s: the answer is %(text)s, which begins with PY::; expected "JSON::" at its start',
                place=location,
                text=quote_text(text),
            )
            return


def _is_dump_function(name: str) -> bool:
    return name.rpartition(".")[2] in ("dumps", "dump")


def _describe_parameters(head: Statement) -> str:
    count = head.tokens.count(",") + (1 if head.tokens[2:5] != ("(", ")", ":") else 0)
    named_counts = {0: Sentence("nothing"), 2: Sentence("two values"), 3: Sentence("three values")}
    return named_counts.get(count, Sentence("%(count)s values", count=count))


def _measure_similarity(first_name: str, second_name: str) -> float:
    return difflib.SequenceMatcher(None, first_name, second_name).ratio()
