"""Search for a row of numbers and words in a report, used for expected and unexpected rows.

``reporting.py`` decides the consequences of a match.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile

from service.grading.judging.text_tokens import Token, split_words, tokenize_text

Entry = float | str
Row = tuple[Entry, ...]
Values = tuple[float, ...]
#: Half of the last binary digit does not make two decimal numbers different.
_SLACK = 1e-9


@dataclass(frozen=True, slots=True)
class RowMatch:
    """The number of entries of a row found in order, and the numbers among them."""

    count: int
    values: Values


class ReportTokens:
    """The tokens of a report, searchable for rows.

    Entries of a row must come in order, with anything between them. After a text, however, the next entry must be among
    the first of its kind: "rows 7 columns 9" has 7 rows, and not 9. The kinds are numbers, and the texts in ``rows``.
    """

    def __init__(self, tokens: Sequence[Token], rows: Collection[Row], tolerance: float) -> None:
        self._words = [token.word for token in tokens]
        self._numbers = [token.value for token in tokens]
        self._tolerance = tolerance
        self._by_word: dict[str, list[int]] = {}
        self._by_number: dict[float, list[int]] = {}
        for index, token in enumerate(tokens):
            self._by_word.setdefault(token.word, []).append(index)
            if token.value is not None:
                self._by_number.setdefault(token.value, []).append(index)
        self._sorted_numbers = sorted(self._by_number)
        text_mask = self._mark_text_tokens({entry for row in rows for entry in row if isinstance(entry, str)})
        self._before_text = _find_ends_before_runs(text_mask)
        self._before_number = _find_ends_before_runs([number is not None for number in self._numbers])

    def find(self, row: Row) -> RowMatch:
        """Return the longest beginning of ``row`` in the report."""
        states: Mapping[int, Values] = {0: ()}
        for count, entry in enumerate(row):
            after_text = count > 0 and isinstance(row[count - 1], str)
            states, previous_ends = self._advance_states(entry, states, after_text), states
            if not states:
                return RowMatch(count, previous_ends[min(previous_ends)])
        return RowMatch(len(row), states[min(states)])

    def has(self, row: Row) -> bool:
        """Return whether all entries of ``row`` are in the report."""
        return self.find(row).count == len(row)

    def _advance_states(self, entry: Entry, states: Mapping[int, Values], after_text: bool) -> Mapping[int, Values]:
        """Return where ``entry`` can end after one of the places ``states``, each with the numbers up to there."""
        places = self._find_places(entry)
        length = len(split_words(entry)) if isinstance(entry, str) else 1
        starts = sorted(states)
        before_run = self._before_text if isinstance(entry, str) else self._before_number
        ends: dict[int, Values] = {}
        for index in places[bisect_left(places, starts[0]) :]:
            # After a text, only the nearest place counts: nothing of the entry's kind is between it and the entry's
            # run.
            start = starts[bisect_right(starts, index) - 1] if after_text else starts[0]
            if after_text and start <= before_run[index]:
                continue
            number = self._numbers[index]
            ends[index + length] = states[start] if number is None else (*states[start], number)
            if not isinstance(entry, str):
                break  # After a number, any later place is allowed, so the first is enough.
        return ends

    def _find_places(self, entry: Entry) -> list[int]:
        """Return the places where ``entry`` begins, in order."""
        if isinstance(entry, str):
            parts = split_words(entry)
            return [
                place for place in self._by_word.get(parts[0], ()) if self._words[place : place + len(parts)] == parts
            ]
        start_index = bisect_left(self._sorted_numbers, entry - self._tolerance - _SLACK)
        matching_numbers = takewhile(
            lambda number: number <= entry + self._tolerance + _SLACK, self._sorted_numbers[start_index:]
        )
        return sorted(place for number in matching_numbers for place in self._by_number[number])

    def _mark_text_tokens(self, texts: Iterable[str]) -> list[bool]:
        """Return for each token whether it is part of one of the texts."""
        is_covered = [False] * len(self._words)
        for text in texts:
            length = len(split_words(text))
            for index in self._find_places(text):
                is_covered[index : index + length] = [True] * length
        return is_covered


def _find_ends_before_runs(fit_mask: Sequence[bool]) -> list[int]:
    """Return for each place the last fit before the run of the place; -1 if there is none."""
    ends: list[int] = []
    last_fit, fit_before_run = -1, -1
    for index, is_fit in enumerate(fit_mask):
        if is_fit:
            if last_fit != index - 1:
                fit_before_run = last_fit
            last_fit = index
        ends.append(fit_before_run)
    return ends


def can_match_row(row: Row, answer_row: Row, tolerance: float) -> bool:
    """Return whether a correct report of ``answer_row`` may also be one of ``row``."""
    tokens = [token for entry in answer_row for token in _tokenize_entry(entry)]
    return ReportTokens(tokens, (row, answer_row), 2 * tolerance).has(row)


def is_equivalent_row(row: Row, other_row: Row, tolerance: float) -> bool:
    """Return whether every report is right for both rows or wrong for both."""
    return can_match_row(row, other_row, tolerance) and can_match_row(other_row, row, tolerance)


def is_near(value: float | None, expected: float, tolerance: float) -> bool:
    """Return whether a token's value equals the expected number, within the tolerance."""
    return value is not None and abs(value - expected) <= tolerance + _SLACK


def _tokenize_entry(entry: Entry) -> list[Token]:
    return tokenize_text(entry) if isinstance(entry, str) else [Token(f"{entry:g}", entry)]
