"""Sentences on a report: what was expected, and what is wrong with it.

``reporting.py`` decides which of them are true.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from service.grading.judging.message_parts import quote_list
from service.grading.judging.report_rows import Entry, Row
from service.language import translatable
from sim.sentences import Sentence
from submissions.criteria.reporting import Reports

_EXPECTATIONS: Mapping[str, str] = MappingProxyType(
    {
        "print": translatable("Expected the program to print %(texts)s"),
        "speech": translatable("Expected the program to say %(texts)s"),
        "either": translatable("Expected the program to report %(texts)s"),
        "reply": translatable("Expected the responder to answer %(texts)s"),
    }
)
_SILENCES: Mapping[str, Sentence] = MappingProxyType(
    {
        "print": Sentence("it did not print anything"),
        "speech": Sentence("it did not say anything"),
        "either": Sentence("it did not report anything"),
        "reply": Sentence("it did not answer anything"),
    }
)


def describe_expectation(criterion: Reports, entries: str) -> str:
    """Return a clause on the entries that must be reported."""
    return Sentence(_EXPECTATIONS[criterion.source], texts=entries)


def describe_missing_report(criterion: Reports, expectation: str) -> str:
    """Return the sentence for a trial without a report."""
    return Sentence("%(expected)s, but %(actual)s.", expected=expectation, actual=_SILENCES[criterion.source])


def describe_wrong_report(expectation: str, problem: str, report_text: str) -> str:
    """Return the sentence on a report that has a problem."""
    return Sentence(
        "%(expected)s, but %(problem)s: %(report)s.", expected=expectation, problem=problem, report=report_text
    )


def describe_right_report(criterion: Reports, answer_row: Row) -> str:
    """Return the sentence on a correct report."""
    entries = format_entries(answer_row)
    if criterion.source == "reply":
        return Sentence("The responder reported %(entries)s.", entries=entries)
    return Sentence("The program reported %(entries)s.", entries=entries)


def describe_missing_entry(answer_row: Row, number: int, is_guess: bool) -> str:
    """Return a clause on entry ``number`` of a row, which was not reported; ``is_guess`` for a guessed report."""
    missing_entry = format_entries(answer_row[number : number + 1])
    problem = (
        Sentence(
            "%(text)s did not come after %(previous)s",
            text=missing_entry,
            previous=format_entries(answer_row[number - 1 : number]),
        )
        if number
        else Sentence("%(text)s did not come", text=missing_entry)
    )
    if not is_guess:
        return problem
    return Sentence("%(problem)s, and it reported as many entries of most other poses", problem=problem)


def describe_expected_entries(criterion: Reports, answer_row: Row) -> str:
    """Return the entries with the allowed difference of numbers, if it is large enough to matter."""
    entries = format_entries(answer_row)
    has_numbers = any(not isinstance(entry, str) for entry in answer_row)
    if not has_numbers or criterion.leeway < 1:
        return entries
    return Sentence("%(entries)s (within %(tolerance)g)", entries=entries, tolerance=criterion.leeway)


def format_entries(entries: Sequence[Entry]) -> str:
    """Return the entries as a list of quotes."""
    return quote_list(tuple(map(format_entry, entries)))


def format_entry(entry: Entry) -> str:
    """Return an entry as a report would contain it."""
    return entry if isinstance(entry, str) else f"{entry:g}"
