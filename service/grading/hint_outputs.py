"""Hints on output that shows a mistake: an object in place of its value, or the texts of two branches at once.

The texts come from the visible trials.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from service.grading.hint_clues import Clues
from service.grading.hint_code import Statement, join_tokens
from service.grading.hint_operands import find_device
from service.grading.hint_structure import collect_statements
from service.grading.hint_tables import OUTPUT_FUNCTIONS
from service.grading.judging.message_parts import quote_text
from sim.sentences import Sentence
from submissions.criteria.reporting import Reports
from submissions.criteria.texts import TextSequence

#: Python's text for an object without one of its own.
_OBJECT = re.compile(r"<(?P<kind>function|bound method|class|[\w.]+) .*(?:object )?at 0x[0-9a-f]+>|<class '[\w.]+'>")


def hint_about_printed_object(clues: Clues) -> Iterator[str]:
    """Yield a hint on a text such as ``<function f at 0x7f>``, with the reading or the call to write."""
    for text in (*clues.spoken, *clues.printed, *clues.sent):
        match = _OBJECT.search(text)
        if match is None:
            continue
        for listing, statement in collect_statements(clues):
            if not _is_output(statement):
                continue
            device = find_device(listing, statement)
            if device is not None:
                name, reading = device
                yield Sentence(
                    "%(place)s writes the sensor itself and not what it reads. Write %(name)s.%(reading)s in "
                    "place of %(name)s",
                    place=listing.locate(statement.line),
                    name=name,
                    reading=reading,
                )
                return
            if match["kind"] in ("function", "bound method"):
                yield Sentence(
                    "%(place)s writes %(text)s: a function is named, but not called. Write () behind its name",
                    place=listing.locate(statement.line),
                    text=quote_text(match[0]),
                )
                return


def hint_about_missing_else(clues: Clues) -> Iterator[str]:
    """Yield a hint on a text that is written after an ``if`` that writes another, so that both come in one trial."""
    if not any(isinstance(each, Reports | TextSequence) for each in clues.lost):
        return
    for listing, statement in collect_statements(clues):
        following = listing.code.find_next_outside(statement) if statement.keyword in ("if", "elif") else None
        if following is None or following.indent != statement.indent or not _is_output(following):
            continue
        body = [each for each in listing.code.list_body(statement) if each.parent == statement.number]
        texts = [_get_literal(each) for each in (*body[-1:], following)]
        if len(texts) == 2 and all(texts) and texts[0] != texts[1] and _come_together(texts, clues):
            yield Sentence(
                "%(place)s runs after the if in line %(line)s as well, so both texts come. Write else: above "
                "line %(second)s, and indent line %(second)s",
                place=listing.locate(following.line),
                line=statement.line,
                second=following.line,
            )
            return


def _is_output(statement: Statement) -> bool:
    return any(call.name in OUTPUT_FUNCTIONS for call in statement.calls)


def _get_literal(statement: Statement) -> str:
    """Return the text that a statement writes, if it is only a text in quotes; otherwise empty."""
    call = next((each for each in statement.calls if each.name in OUTPUT_FUNCTIONS and each.arguments), None)
    token = join_tokens(call.arguments[0]) if call is not None else ""
    return token[1:-1] if token[:1] in ("'", '"') and token[-1:] == token[:1] else ""


def _come_together(texts: list[str], clues: Clues) -> bool:
    """Return whether one trial has both texts."""
    for recording in clues.recordings:
        lines = {line.text for line in (*recording.printed, *recording.spoken)}
        if set(texts) <= lines:
            return True
    return False


def hint_about_swapped_sides(clues: Clues) -> Iterator[str]:
    """Yield a hint on a function whose parameter for the left wheel goes to the right motor, and the reverse."""
    for listing, statement in collect_statements(clues):
        head = next((each for each in listing.code.list_enclosing(statement) if each.keyword == "def"), None)
        for call in statement.calls if head is not None else ():
            if not call.name.startswith("tank_drive.") or len(call.arguments) < 2 or head is None:
                continue
            left, right = (_find_parameter(each, head) for each in call.arguments[:2])
            if "right" in left.lower() and "left" in right.lower():
                yield Sentence(
                    "%(place)s gives %(left)s to the left motor and %(right)s to the right one. Exchange them: "
                    "the first speed is that of the left motor",
                    place=listing.locate(statement.line),
                    left=left,
                    right=right,
                )
                return


def _find_parameter(argument: tuple[str, ...], head: Statement) -> str:
    return next((token for token in argument if token in head.tokens[3:]), "")
