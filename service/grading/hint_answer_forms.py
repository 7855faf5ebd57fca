"""Hints on the form of the responder's answers: an object that is missing around a key, a variable in quotes.

They compare the answers with the criteria that lost marks.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from service.grading.findings import FailedCall
from service.grading.hint_answers import describe_key_line, parse_answer
from service.grading.hint_clues import Clues
from service.grading.judging.message_parts import quote_text
from sim.sentences import Sentence
from submissions.criteria.code import Functions
from submissions.criteria.replies import Replies
from submissions.criteria.reporting import Reports


def hint_about_missing_frame(clues: Clues) -> Iterator[str]:
    """Yield a hint on an answer that has the last key of the required path, but not the keys around it."""
    for criterion in clues.lost:
        if not isinstance(criterion, Replies | Functions):
            continue
        answers = clues.answers if isinstance(criterion, Replies) else _list_returned_answers(criterion, clues)
        *frame, key = (criterion.path or "").split(".")
        for answer in answers:
            value = parse_answer(answer)
            location = describe_key_line([key], clues)
            if frame and isinstance(value, dict) and key in value and frame[0] not in value and location:
                inner = f'"{key}": ...'
                for each in reversed(frame):
                    inner = f'"{each}": {{{inner}}}'
                yield Sentence(
                    "%(place)s: the answer has %(key)s outside of %(frame)s. Write {%(code)s}",
                    place=location,
                    key=quote_text(key),
                    frame=quote_text(frame[0]),
                    code=inner,
                )
                return


def _list_returned_answers(criterion: Functions, clues: Clues) -> tuple[str, ...]:
    """Return the text that a called function returned in place of one with the criterion's path."""
    failed = clues.find_finding(criterion, FailedCall)
    return (failed.returned,) if failed is not None and isinstance(failed.returned, str) else ()


def hint_about_quoted_values(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``{"typ": "kind"}`` in a responder where kind is a variable, and the answer has the word."""
    if not any(isinstance(each, Replies | Reports) for each in clues.lost):
        return
    for listing in clues.responder_process_listings:
        names = {name for each in listing.code.statements for name in each.bound_names}
        names |= {token for each in listing.code.list_functions() for token in each.tokens[3:]}
        for statement in listing.code.statements:
            for key, colon, text in zip(statement.tokens, statement.tokens[1:], statement.tokens[2:], strict=False):
                is_value = colon == ":" and key[:1] in "\"'" and text[:1] in "\"'" and text[1:-1] != key[1:-1]
                name = text[1:-1]
                word = re.compile(rf""": ?\\?["']{re.escape(name)}\\?["']""")
                if is_value and name in names and any(word.search(each) for each in clues.answers):
                    yield Sentence(
                        "%(place)s answers the word %(text)s and not the value of %(name)s, because it is in quotes. "
                        "Write %(key)s: %(name)s",
                        place=listing.locate(statement.line),
                        text=text,
                        name=name,
                        key=key,
                    )
                    return
