"""Hints with the line that caused a criterion's result, used if no other rule knows the cause.

A line is named only if it is the only candidate.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from service.grading.findings import MissingEntry, StrayItems
from service.grading.hint_clues import Clues, describe_first_failure
from service.grading.hint_functions import hint_about_wrong_values
from service.grading.hint_motion import STOPPING_CRITERIA
from service.grading.hint_structure import DRIVING_CRITERIA, collect_statements, has_motor_call
from service.grading.hint_tables import LIMITED_MOVES, PROPERTIES
from service.grading.hint_texts import describe_quoting_line
from service.grading.judging.message_parts import find_line
from sim.sentences import Sentence, iterate_values, make_clause
from submissions.criteria import Criterion
from submissions.criteria.code import Functions
from submissions.criteria.logs import Datalog
from submissions.criteria.reporting import Events, Reports
from submissions.criteria.sequence import WordSequence
from submissions.criteria.texts import TextSequence

_SPEECH_FUNCTIONS = frozenset({"say", "speak"})
_PRINT_FUNCTIONS = frozenset({"print"})
_TEXT_CRITERIA = (Reports, Events, WordSequence, TextSequence, Datalog)


def hint_about_cause_line(clues: Clues) -> Iterator[str]:
    """Yield the result of the criterion that lost most, prefixed with its line."""
    for criterion in clues.costliest_criteria[:1]:
        message, strays = describe_first_failure(clues, criterion), clues.find_finding(criterion, StrayItems)
        if not message or (strays is not None and strays.is_only_problem):
            continue
        if isinstance(criterion, Functions):
            yield hint_about_wrong_values(criterion, message, clues)
            return
        location = _describe_cause_line(criterion, message, clues)
        if location:
            yield Sentence("%(place)s: %(problem)s", place=location, problem=make_clause(message))


def _describe_cause_line(criterion: Criterion, message: str, clues: Clues) -> str:
    """Return the position of the cause; empty if it is unknown or ambiguous."""
    if isinstance(criterion, Reports) and criterion.source == "reply":
        missing = clues.find_finding(criterion, MissingEntry)
        key = missing.previous if missing else ""
        locations = [
            clues.describe_matching_line("responder", re.compile(rf"""["']{re.escape(key)}["']""")) if key else ""
        ]
    elif isinstance(criterion, _TEXT_CRITERIA):
        is_speech = getattr(criterion, "source", "") == "speech" or criterion.check == "says"
        names = _SPEECH_FUNCTIONS if is_speech else _PRINT_FUNCTIONS | _SPEECH_FUNCTIONS
        locations = [
            listing.locate(each.line)
            for listing, each in collect_statements(clues)
            if any(call.name.rpartition(".")[2] in names for call in each.calls)
        ]
        # A text may be quoted together with others.
        quotes = [str(value) for _, value in iterate_values(message) if not isinstance(value, Sentence)]
        texts = (text for text in (*clues.printed, *clues.spoken) if len(text) > 2)
        quoted_texts = [text for text in texts if any(text in quote for quote in quotes)]
        if len(locations) > 1 and quoted_texts:
            locations = [describe_quoting_line(clues, "program", quoted_texts[-1])]
    elif isinstance(criterion, DRIVING_CRITERIA + STOPPING_CRITERIA):
        drive_statements = [
            (listing, each)
            for listing, each in collect_statements(clues)
            if has_motor_call(each, LIMITED_MOVES)
            and not any(one.keyword == "def" for one in listing.code.list_enclosing(each))
        ]
        loops = [
            (listing, each)
            for listing, each in collect_statements(clues)
            if each.keyword == "while" and any(token in PROPERTIES for token in each.condition)
        ]
        locations = [
            listing.locate(each.line)
            for listing, each in (loops if isinstance(criterion, STOPPING_CRITERIA) else drive_statements)
        ]
    else:
        return ""
    return locations[0] if len(locations) == 1 and find_line(locations[0]) is not None else ""
