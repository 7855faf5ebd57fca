"""Hints on what is accepted although it differs from the description: other words, missing keys, a called responder.

They apply with full marks as well.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from responders.message_format import JSON
from service.grading.hint_clues import MAX_TEXT_LENGTH, Clues, find_listing
from service.grading.hint_formats import RETURN_LINE, describe_return_line
from service.grading.hint_texts import ExpectedText, describe_quoting_line, is_near
from service.grading.judging.message_parts import quote_text
from service.language import translatable
from sim.sentences import Sentence, join_with_and
from submissions.submission import Part

_QUOTED = re.compile(r'"([^"]{6,60})"')
_KEY = re.compile(r'"(\w+)"\s*:')
_VARIABLE_TEXT = re.compile(r"\d|[{}<>:]")


def hint_about_other_words(clues: Clues) -> Iterator[str]:
    """Yield a hint on a text that has other words than the description quotes."""
    texts: Sequence[tuple[Part, str, Sequence[str]]] = (
        ("program", translatable("%(place)s says %(text)s; the assignment requires %(required)s"), clues.spoken),
        ("program", translatable("%(place)s prints %(text)s; the assignment requires %(required)s"), clues.printed),
        ("responder", translatable("%(place)s answers %(text)s; the assignment requires %(required)s"), clues.answers),
    )
    titles = {each.title for each in clues.definition.criteria} if clues.definition is not None else set()
    for quotation in _QUOTED.findall(_join_task_lines(clues)):
        opening = quotation.partition("...")[0].strip()
        if len(opening.split()) < 2 or _VARIABLE_TEXT.search(opening) or quotation in titles:
            continue
        expected = ExpectedText(opening, "contains")
        if any(expected.is_met_by(text, ignore_case=True) for _, _, found in texts for text in found):
            continue
        for part, template, part_texts in texts:
            similar_text = next((text for text in part_texts if is_near(expected, text)), None)
            if similar_text is not None:
                yield Sentence(
                    template,
                    place=describe_quoting_line(clues, part, similar_text),
                    text=quote_text(similar_text),
                    required=quote_text(opening),
                )
                return


def hint_about_missing_keys(clues: Clues) -> Iterator[str]:
    """Yield a hint on an answer without keys that the description shows."""
    required_keys = list(
        dict.fromkeys(key for form in _extract_json_objects(_join_task_lines(clues)) for key in _KEY.findall(form))
    )
    answers = [text for text in clues.answers if text.startswith(JSON) and len(text) < MAX_TEXT_LENGTH]
    answer_keys = {key for text in answers for key in _KEY.findall(text)}
    missing_keys = [key for key in required_keys if key not in answer_keys]
    if missing_keys and answer_keys:
        yield Sentence(
            "%(place)s: the answer is %(answer)s, without %(keys)s, which the assignment requires",
            place=describe_return_line(answers[0], clues, RETURN_LINE),
            answer=quote_text(answers[0]),
            keys=join_with_and([quote_text(key) for key in missing_keys[:3]]),
        )


def hint_about_called_responder(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``roboSim.pyresponder = responder()``, which failed in its cell."""
    for fault in clues.cell_errors:
        listing = find_listing(fault, clues)
        statement = listing.code.find_statement(fault.line) if listing is not None else None
        if listing is None or statement is None or statement.tokens[:4] != ("roboSim", ".", "pyresponder", "="):
            continue
        call = next((each for each in statement.calls if each.name == statement.tokens[4]), None)
        if call is not None:
            yield Sentence(
                "%(place)s calls %(name)s, which failed: %(failure)s. Write it without brackets: "
                "roboSim.pyresponder = %(name)s",
                place=listing.locate(statement.line),
                name=call.name,
                failure=fault.message.rstrip("."),
            )
            return


def _join_task_lines(clues: Clues) -> str:
    return " ".join(clues.task.split())


def _extract_json_objects(task: str) -> Iterator[str]:
    """Yield each object after ``JSON::``, up to its closing bracket."""
    for piece in task.split(JSON)[1:]:
        depth = 0
        for index, letter in enumerate(piece):
            depth += (letter == "{") - (letter == "}")
            if depth == 0:
                yield piece[: index + 1]
                break
