"""Hints on errors: the first error of each trial and of a notebook's cells, with advice.

The advice comes from the table in ``hint_error_advice.py``, or from the submission if the table is not enough.
"""

from __future__ import annotations

import difflib
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import PurePosixPath

from service.grading.fault_kinds import FaultKind, is_kind, read_values
from service.grading.hint_answers import advise_on_key_place
from service.grading.hint_clues import Clues, Listing, describe_fault_line, find_listing
from service.grading.hint_code import Statement, join_tokens
from service.grading.hint_error_advice import ADVICE
from service.grading.hint_formats import RETURN_LINE, describe_return_line
from service.grading.hint_names import (
    PRELOADED,
    advise_on_constant,
    advise_on_later_cell,
    advise_on_later_line,
    advise_on_other_process,
    advise_on_overwritten_name,
    advise_on_owner,
)
from service.grading.hint_operands import (
    advise_on_decimal_comma,
    advise_on_device,
    advise_on_keyword,
    advise_on_list_operand,
    advise_on_mean_axis,
    advise_on_missing_alias,
    advise_on_narrow_except,
    advise_on_parameter,
    advise_on_sample_count,
    advise_on_short_list,
    advise_on_text_operand,
    advise_on_whole_object,
)
from service.grading.hint_skipped_loops import describe_skipped_loops
from service.grading.hint_syntax import advise_on_syntax
from service.grading.hint_tables import PROPERTIES, UNAVAILABLE_MODULES, USAGE
from service.grading.hint_value_sources import (
    advise_on_last_index,
    advise_on_later_loop,
    advise_on_list_argument,
    advise_on_none,
    advise_on_percentage,
    advise_on_quoted_amount,
    advise_on_unsent_message,
)
from service.grading.judging.message_parts import describe_fault, quote_text
from service.language import translatable
from sim.recording import Fault, Verdict
from sim.recording_values import collect_faults
from sim.sentences import Sentence, join_sentences
from submissions.raw_files import sanitise_name

_NON_ERROR_VERDICTS = (Verdict.TIME_LIMIT, Verdict.CPU_LIMIT, Verdict.HOST_ERROR, Verdict.ASSIGNMENT_ERROR)
_MAX_ERRORS, _MAX_ERROR_LENGTH = 3, 300
_NULL = re.compile(r"^JSON::.*\bnull\b")
_LIBRARIES = ("joblib", "numpy", "pandas", "sklearn")
_LABELS = re.compile(r"label|target|\by\b|y_train", re.IGNORECASE)
#: Reasons why a message was lost for good. Waiting does not help.
_OUT_OF_REACH = {
    "out of range": translatable(
        "No answer came: %(message)s was lost, because the robot was out of range. Drive nearer before you send."
    ),
    "facing away": translatable(
        "No answer came: %(message)s was lost, because the robot faced away. Turn to the receiver before you send."
    ),
    "blocked": translatable(
        "No answer came: %(message)s was lost, because the robot was behind an obstacle. Drive around it before you "
        "send."
    ),
}
_TEXT = re.compile(r"""(["'])((?:(?!\1).){1,200})\1""")
#: Long values in error messages, which are removed.
_VALUES = re.compile(r"(?:, got 1D array instead)?:?\s*\n.*|array=.*|: line \d+ column \d+ \(char \d+\)", re.DOTALL)
_KEY = re.compile(r"""["'](\w{2,40})["']\s*:""")
#: A guess by Python that better advice replaces.
_COMMA_GUESS = re.compile(
    r"\. Perhaps you forgot a comma\?$|(?<=literal) here\. Maybe you meant '==' instead of '='\?$"
)
#: The list of available modules in a message about a missing module.
_MODULES = re.compile(r"(?<='): numpy, .* are there$")
_NEAR_KEY, _NEAR_MODULE = 0.6, 0.8


def hint_about_cell_errors(clues: Clues) -> Iterator[str]:
    """Yield a hint on the first notebook cell that failed, if there are also later errors."""
    if any(fault.verdict not in _NON_ERROR_VERDICTS for fault in clues.faults):
        yield from _hint_about_first_cell(clues)


def hint_about_failed_cell(clues: Clues) -> Iterator[str]:
    """Yield a hint on the first notebook cell that failed, if marks were lost."""
    if clues.lost:
        yield from _hint_about_first_cell(clues)


def hint_about_errors(clues: Clues) -> Iterator[str]:
    """Yield the first error of each trial, with advice."""
    first_faults = (faults[0] for recording in clues.recordings if (faults := collect_faults(recording)))
    for fault in list(dict.fromkeys(replace(each, t=0.0) for each in first_faults))[:_MAX_ERRORS]:
        if fault.verdict not in _NON_ERROR_VERDICTS:
            yield from _hint_about_error(fault, clues)


def _hint_about_first_cell(clues: Clues) -> Iterator[str]:
    for fault in clues.cell_errors[:1]:
        yield from _hint_about_error(fault, clues)


def _hint_about_error(fault: Fault, clues: Clues) -> Iterator[str]:
    location = describe_fault_line(fault, clues)
    if not location:
        return
    values = read_values(fault, FaultKind.UNDEFINED_NAME)
    if values and fault.who == "program" and clues.preamble != "preloaded" and values[0] in PRELOADED:
        yield Sentence(
            "%(place)s uses %(name)s, which %%%%sim_magic_preloaded brings; expected that magic in the first line, or "
            "the name to be defined",
            place=location,
            name=values[0],
            fault=describe_fault(fault),
        )
        return
    problem = describe_error(fault, clues)
    yield Sentence("%(place)s: %(problem)s", place=location, problem=problem, fault=describe_fault(fault))


def describe_error(fault: Fault, clues: Clues) -> str:
    """Return the error message followed by advice."""
    sentence = _VALUES.sub("", fault.message)[:_MAX_ERROR_LENGTH].rstrip(".")
    advice = advise_on_error(fault, clues)
    if not advice:
        return sentence
    sentence = _MODULES.sub("", _COMMA_GUESS.sub("", sentence))
    if sentence.endswith("?"):
        return join_sentences(sentence, advice)
    return Sentence("%(problem)s. %(advice)s", problem=sentence, advice=advice)


def advise_on_error(fault: Fault, clues: Clues) -> str:
    """Return advice on an error; empty if there is none."""
    listing = find_listing(fault, clues)
    statement = None if listing is None else listing.code.find_statement(fault.line)
    for adviser in _ADVISERS:
        advice = adviser(fault, clues, listing, statement)
        if advice:
            return advice
    return ""


def _advise_on_null(fault: Fault, clues: Clues, *_: object) -> str:
    """Return advice on an error caused by a null value from the responder."""
    answer = next((text for text in clues.answers if _NULL.search(text)), None)
    if fault.who != "program" or not is_kind(fault, FaultKind.NONE_OBJECT) or answer is None:
        return ""
    return Sentence(
        "The responder answered %(answer)s: check why %(place)s is reached, and its condition.",
        answer=quote_text(answer),
        place=describe_return_line(answer, clues, RETURN_LINE),
    )


def _advise_on_lost_message(fault: Fault, clues: Clues, _: Listing | None, statement: Statement | None) -> str:
    """Return advice on an answer that never came because the channel lost the message."""
    is_queue_empty = (
        is_kind(fault, FaultKind.INDEX_ERROR) and statement is not None and statement.has_token("pyState", "messages")
    )
    lost_message = next((each for each in clues.messages if each.lost in _OUT_OF_REACH), None)
    if fault.who != "program" or not is_queue_empty or lost_message is None or clues.answers:
        return ""
    advice = Sentence(_OUT_OF_REACH[lost_message.lost], message=quote_text(lost_message.text))
    skipped_loop = next((found for found, _ in describe_skipped_loops(clues)), "") if clues.is_stationary else ""
    if not skipped_loop:
        return advice
    return Sentence("%(advice)s It never moved. In %(loop)s", advice=advice, loop=skipped_loop)


def _advise_on_module(fault: Fault, clues: Clues, *_: object) -> str:
    """Return advice on an import of an agent, of a robot-only module, or of an unavailable module."""
    values = read_values(fault, FaultKind.NO_MODULE)
    if values is None:
        return ""
    name = values[0].partition(".")[0]
    if name in clues.agents:
        return Sentence(
            "%(agent)s.py is an agent, and agents are not imported: delete this line and call %(agent)s(...).",
            agent=name,
        )
    if name.startswith("ev3dev2") and fault.who == "responder":
        return Sentence("Only a robot program can import %(module)s: delete this line.", module=name)
    if name in UNAVAILABLE_MODULES:
        return Sentence("%(module)s is not available here: delete this line and all lines that use it.", module=name)
    similar_modules = difflib.get_close_matches(name.lower(), [*_LIBRARIES, *sys.stdlib_module_names], 1, _NEAR_MODULE)
    return Sentence("Did you mean %(name)s?", name=similar_modules[0]) if similar_modules and not fault.hint else ""


def _advise_on_message_text(fault: Fault, _: Clues, listing: Listing | None, statement: Statement | None) -> str:
    """Return advice on a message that the responder uses as an object without decoding it."""
    if fault.who != "responder" or listing is None or statement is None:
        return ""
    if not is_kind(fault, FaultKind.TEXT_INDEX) or any(
        each.has_token("loads", "literal_eval") for each in listing.code.statements
    ):
        return ""
    return Sentence("The message is still a text: write json.loads(...) around the text after IMG_DATA:: or PY::.")


def _advise_on_unpacking(fault: Fault, _: Clues, __: Listing | None, statement: Statement | None) -> str:
    """Return advice on a property with three values that is unpacked into fewer names."""
    if statement is None or not is_kind(fault, FaultKind.WRONG_UNPACKING) or "=" not in statement.tokens:
        return ""
    equals_index = statement.tokens.index("=")
    value = statement.tokens[-1]
    if value == "rgb":
        code = join_tokens(statement.tokens[equals_index + 1 :])
        return Sentence("rgb has three values: write red, green, blue = %(code)s.", code=code)
    names = sum(token == "," for token in statement.tokens[:equals_index]) + 1
    return Sentence("There are %(count)s names to the left of =: write as many names as there are values.", count=names)


def _advise_on_fit(fault: Fault, _: Clues, __: Listing | None, statement: Statement | None) -> str:
    """Return advice on ``fit`` called with labels and images in the wrong order."""
    if statement is None or not is_kind(fault, FaultKind.NO_NUMBER):
        return ""
    for call in statement.calls:
        arguments = [join_tokens(each) for each in call.arguments if "=" not in each]
        if (
            call.name.endswith(".fit")
            and len(arguments) == 2
            and _LABELS.search(arguments[0])
            and not _LABELS.search(arguments[1])
        ):
            fixed_call = f"{call.name}({arguments[1]}, {arguments[0]})"
            return Sentence("fit takes the images first and then the labels: write %(code)s.", code=fixed_call)
    return ""


def _advise_on_labels(fault: Fault, *_: object) -> str:
    """Return advice on a network for numbers that is trained with texts as labels."""
    if not is_kind(fault, FaultKind.TEXT_LABELS):
        return ""
    return Sentence("The labels are texts: use a classifier, such as MLPClassifier, and no regressor.")


def _advise_on_steering(fault: Fault, _: Clues, __: Listing | None, statement: Statement | None) -> str:
    """Return advice on a speed given in the position of the steering."""
    calls = () if statement is None or not is_kind(fault, FaultKind.NO_SPEED) else statement.calls
    usage = next((USAGE[call.name] for call in calls if call.name.startswith("tank_turn.") and call.name in USAGE), "")
    return Sentence("The arguments are in the wrong order: write %(usage)s.", usage=Sentence(usage)) if usage else ""


def _advise_on_missing_file(fault: Fault, clues: Clues, listing: Listing | None, _: Statement | None) -> str:
    """Return advice on a file that was not submitted, or is named with a folder."""
    values = read_values(fault, FaultKind.NO_FILE)
    if values:
        file = PurePosixPath(values[0].replace("\\", "/")).name
        if file in clues.files or file != values[0]:
            return Sentence(
                'Files lie beside your program: submit %(file)s with it and write "%(file)s", no folder.',
                file=sanitise_name(file),
            )
        if fault.hint:
            advice = Sentence("Submit %(file)s with your program if that is the right name.", file=sanitise_name(file))
            return join_sentences(fault.hint, advice)
        return Sentence("There is no such file. Submit %(file)s with your program.", file=sanitise_name(file))
    if not is_kind(fault, FaultKind.NO_ACCESS) or listing is None or fault.line is None:
        return ""
    for text in _TEXT.finditer("".join(listing.lines[fault.line - 1 : fault.line])):
        if "/" in text[2] or "\\" in text[2]:
            file = PurePosixPath(text[2].replace("\\", "/")).name
            return Sentence(
                'Only files beside your program can be opened: write "%(file)s", without folders.',
                file=sanitise_name(file),
            )
    return ""


def _advise_on_key(fault: Fault, clues: Clues, *_: object) -> str:
    """Return advice on a key that is similar to one in the messages or the submission."""
    values = read_values(fault, FaultKind.NO_KEY)
    if not values:
        return ""
    (missing_key,) = values
    texts = (*clues.answers, *clues.sent, *(line for each in clues.listings for line in each.lines))
    code_keys = (key for text in texts for key in _KEY.findall(text))
    keys = list(dict.fromkeys(key for key in (*clues.table_columns, *code_keys) if key != missing_key))[:200]
    similar_keys = difflib.get_close_matches(missing_key, keys, 1, _NEAR_KEY)
    if similar_keys:
        return Sentence('Did you mean "%(key)s"?', key=similar_keys[0])
    answer = next((text for text in reversed(clues.answers) if text.startswith("JSON::")), "")
    if fault.who == "program" and answer:
        place_advice = advise_on_key_place(missing_key, answer, clues)
        if place_advice:
            return place_advice
        return Sentence(
            "Nothing is stored under this key. The responder answered %(answer)s: use one of its keys.",
            answer=quote_text(answer),
        )
    return Sentence("Nothing is stored under this key. Print the object to see its keys.")


def _advise_on_call(fault: Fault, clues: Clues, listing: Listing | None, statement: Statement | None) -> str:
    """Return advice on a call of something that is not callable: a property, or an overwritten name."""
    if not is_kind(fault, FaultKind.NOT_CALLABLE) or statement is None or listing is None:
        return ""
    for call in statement.calls:
        name = call.name.rpartition(".")[2]
        if name in PROPERTIES and "." in call.name:
            return Sentence(
                "%(property)s is a property: write it without brackets, %(code)s.", property=name, code=call.name
            )
        assignment = next((each for each in listing.code.statements if each.target == call.name), None)
        if assignment is not None:
            return Sentence(
                "Line %(line)s gives %(name)s another value: %(code)s. Choose another name there.",
                line=assignment.line,
                name=call.name,
                code=join_tokens(assignment.tokens),
            )
    return Sentence("A sign such as * or a comma is missing before the bracket, or the name stands for a value.")


def _advise_on_usage(fault: Fault, _: Clues, __: Listing | None, statement: Statement | None) -> str:
    """Return the usage of a call that has too few values."""
    values = read_values(fault, FaultKind.WRONG_ARGUMENTS)
    if values is None or statement is None:
        return ""
    call = next((each for each in statement.calls if each.name.rpartition(".")[2] == values[1]), None)
    usage = USAGE.get(call.name) if call is not None else None
    return Sentence("Write %(usage)s.", usage=Sentence(usage)) if usage else ""


def _advise_from_hint(fault: Fault, *_: object) -> str:
    """Return the hint that the child process found: a similar name."""
    return fault.hint


def _advise_from_table(fault: Fault, _: Clues, listing: Listing | None, statement: Statement | None) -> str:
    code = "" if listing is None else "".join(listing.lines[(fault.line or 0) - 1 : fault.line])
    text = f"{fault.message}\n{code}"
    matches = ((error.search(text), advice) for error, advice in ADVICE)
    return next((Sentence(advice, **match.groupdict("")) for match, advice in matches if match), "")


_Adviser = Callable[[Fault, Clues, Listing | None, Statement | None], str]
#: The first adviser with a result is used.
_ADVISERS: Sequence[_Adviser] = (
    advise_on_syntax,
    advise_on_constant,
    advise_on_owner,
    advise_on_later_cell,
    advise_on_other_process,
    advise_on_later_line,
    advise_on_later_loop,
    advise_on_overwritten_name,
    _advise_on_lost_message,
    _advise_on_null,
    _advise_on_module,
    _advise_on_message_text,
    _advise_on_missing_file,
    _advise_on_key,
    _advise_on_call,
    advise_on_decimal_comma,
    _advise_on_usage,
    _advise_on_unpacking,
    _advise_on_steering,
    _advise_on_fit,
    advise_on_keyword,
    advise_on_short_list,
    advise_on_last_index,
    advise_on_parameter,
    advise_on_mean_axis,
    advise_on_missing_alias,
    advise_on_sample_count,
    advise_on_unsent_message,
    advise_on_text_operand,
    advise_on_quoted_amount,
    advise_on_list_operand,
    advise_on_list_argument,
    advise_on_none,
    advise_on_percentage,
    advise_on_device,
    advise_on_whole_object,
    _advise_on_labels,
    _advise_from_hint,
    _advise_from_table,
    advise_on_narrow_except,
)
