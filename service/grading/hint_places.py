"""Hints with the line that caused a criterion's result, used if no other rule knows the cause.

A line is named only if it is the only candidate.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from service.grading.hint_advice import MOVES_FOR, PROPERTIES
from service.grading.hint_clues import Clues, finding_of
from service.grading.hint_functions import of_wrong_values
from service.grading.hint_motion import STOPPED
from service.grading.hint_structure import DRIVEN, moves, statements_of
from service.grading.hint_texts import where_written
from submissions.criteria import Criterion
from submissions.criteria.code import Functions
from submissions.criteria.logged import Datalog
from submissions.criteria.reporting import Events, Reports
from submissions.criteria.sequence import WordSequence
from submissions.criteria.texts import TextSequence

_SAYING = frozenset({"say", "speak"})
_PRINTING = frozenset({"print"})
_TEXTUAL = (Reports, Events, WordSequence, TextSequence, Datalog)
_LABEL = re.compile(r'did not come after "([^"]{1,40})"')
_EXPECTED = re.compile(r"Expected ")


def of_places(clues: Clues) -> Iterator[str]:
    """Yield the result of the criterion that lost most, prefixed with its line."""
    for criterion in clues.dearest[:1]:
        found = finding_of(clues, criterion)
        if isinstance(criterion, Functions) and _EXPECTED.match(found):
            yield of_wrong_values(criterion.function, found)
            return
        where = _place(criterion, found, clues) if _EXPECTED.match(found) else ""
        if where:
            yield f"{where}: {found[0].lower()}{found[1:].rstrip('.')}"


def _place(criterion: Criterion, told: str, clues: Clues) -> str:
    """Return the position of the cause; empty if it is unknown or ambiguous."""
    if isinstance(criterion, Reports) and criterion.source == "reply":
        key = _LABEL.search(told)
        found = [clues.where("responder", re.compile(rf"""["']{re.escape(key[1])}["']""")) if key else ""]
    elif isinstance(criterion, _TEXTUAL):
        says = getattr(criterion, "source", "") == "speech" or criterion.check == "says"
        names = _SAYING if says else _PRINTING | _SAYING
        found = [
            listing.at(each.line)
            for listing, each in statements_of(clues)
            if any(call.name.rpartition(".")[2] in names for call in each.calls)
        ]
        texts = [text for text in (*clues.printed, *clues.spoken) if len(text) > 2 and text in told]
        if len(found) > 1 and texts:
            found = [where_written(clues, "program", texts[-1])]
    elif isinstance(criterion, DRIVEN + STOPPED):
        driving = [
            (listing, each)
            for listing, each in statements_of(clues)
            if moves(each, MOVES_FOR) and not any(one.keyword == "def" for one in listing.code.around(each))
        ]
        loops = [
            (listing, each)
            for listing, each in statements_of(clues)
            if each.keyword == "while" and any(token in PROPERTIES for token in each.condition)
        ]
        found = [listing.at(each.line) for listing, each in (loops if isinstance(criterion, STOPPED) else driving)]
    else:
        return ""
    return found[0] if len(found) == 1 and found[0].startswith("line ") else ""
