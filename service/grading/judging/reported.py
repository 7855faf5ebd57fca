"""Judging what a program reports: the figures and words that belong to the pose it started from.

What is expected is the instructor's table or the floor's label; nothing a student prints is trusted further.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from service.grading.grade import Measure, TrialResult
from service.grading.judging.outcome import Outcome, failed, listed, passed, quoted
from service.grading.judging.places import part_at
from service.grading.judging.words import Token, find_words, tokens_of, words_of
from sim.floors import floor, names
from sim.recording import Recording
from submissions.criteria.reporting import Reports

Entry = float | str

_DEEDS = {"print": "print", "speech": "say", "either": "report", "reply": "answer"}


def judge_reports(criterion: Reports, trial: TrialResult) -> Outcome:
    wanted = _expected(criterion, trial)
    who = "the responder" if criterion.source == "reply" else "the program"
    deed = _DEEDS[criterion.source]
    asked = f"Expected {who} to {deed} {_entries(wanted)}{_leeway(criterion, wanted)}"
    texts = _texts(criterion, trial.recording)
    if not texts:
        return failed(f"{asked}, but it did not {deed} anything.")
    tokens = [token for text in texts for token in tokens_of(text)]
    found, values = _found(wanted, tokens, criterion.tolerance)
    measures = tuple(Measure(f"reported {place}", value) for place, value in enumerate(values, 1))
    heard = quoted(" | ".join(texts))
    foreign = _foreign(criterion, wanted, tokens)
    if foreign:
        return failed(f"{asked}, but {foreign}: {heard}.", measures=measures)
    if found < len(wanted):
        missing = _entries(wanted[found : found + 1])
        where = f" after {_entries(wanted[found - 1 : found])}" if found else ""
        return failed(
            f"{asked}, but {missing} did not come{where}: {heard}.",
            score=Fraction(found, len(wanted)),
            measures=measures,
        )
    if _suits_others(criterion, wanted, tokens):
        return failed(
            f"{asked} and not what belongs to other poses, but that came as well: {heard}.", measures=measures
        )
    return passed(f"{who.capitalize()} reported {_entries(wanted)}.", measures=measures)


def _expected(criterion: Reports, trial: TrialResult) -> tuple[Entry, ...]:
    if criterion.expected != "label":
        rows = criterion.expected
        return rows[min(trial.place, len(rows) - 1)]
    label = label_at_start(trial.recording)
    return (float(label) if label.isdecimal() else label,)


def label_at_start(recording: Recording) -> str:
    """What the floor has under the left light sensor at the start; ``nothing`` where it has no label."""
    if recording.background not in names():
        return "nothing"
    ground = floor(recording.background, labels=recording.label_patches, seed=recording.sheet)
    return ground.label_at(*part_at(recording, "left", recording.start)) or "nothing"


def _texts(criterion: Reports, recording: Recording) -> list[str]:
    if criterion.source == "reply":
        return [m.text for m in recording.messages if m.sender == "responder" and m.note != "duplicated"]
    printed = recording.printed if criterion.source != "speech" else ()
    # What say() prints as well would be there twice.
    spoken = recording.spoken if criterion.source == "speech" else ()
    if criterion.source == "either":
        shown = {(line.t, line.text) for line in printed}
        spoken = tuple(line for line in recording.spoken if (line.t, line.text) not in shown)
    return [line.text for line in sorted([*printed, *spoken], key=lambda line: line.t)]


def _found(wanted: Sequence[Entry], tokens: Sequence[Token], tolerance: float) -> tuple[int, list[float]]:
    """How many of the wanted entries come in order, and the numbers that stand for them."""
    words = [token.word for token in tokens]
    start = 0
    values: list[float] = []
    for count, entry in enumerate(wanted):
        if isinstance(entry, str):
            parts = words_of(entry)
            place = find_words(words, parts, start)
            length = len(parts)
        else:
            near = (i for i in range(start, len(tokens)) if _is_near(tokens[i].value, entry, tolerance))
            place, length = next(near, None), 1
        if place is None:
            return count, values
        value = tokens[place].value
        if value is not None:
            values.append(value)
        start = place + length
    return len(wanted), values


def _is_near(value: float | None, wanted: float, tolerance: float) -> bool:
    return value is not None and abs(value - wanted) <= tolerance + 1e-9


def _suits_others(criterion: Reports, wanted: Sequence[Entry], tokens: Sequence[Token]) -> bool:
    """Whether what belongs to half of the other poses or more was reported as well: then nothing was read off."""
    rows = set(criterion.expected) if criterion.expected != "label" else set()
    others = [row for row in rows if not _alike(row, wanted, 2 * criterion.tolerance)]
    told = sum(
        any(_stands_at(place, row, tokens, criterion.tolerance) for place in range(len(tokens))) for row in others
    )
    return bool(others) and 2 * told >= len(others)


def _alike(row: Sequence[Entry], other: Sequence[Entry], tolerance: float) -> bool:
    """Whether one report may suit both."""
    return len(row) == len(other) and all(
        one == two or (not isinstance(one, str) and not isinstance(two, str) and _is_near(one, two, tolerance))
        for one, two in zip(row, other, strict=True)
    )


def _stands_at(place: int, row: Sequence[Entry], tokens: Sequence[Token], tolerance: float) -> bool:
    """Whether the entries come from there on, one right after the other."""
    for entry in row:
        if isinstance(entry, str):
            parts = words_of(entry)
            if [token.word for token in tokens[place : place + len(parts)]] != parts:
                return False
            place += len(parts)
        elif place < len(tokens) and _is_near(tokens[place].value, entry, tolerance):
            place += 1
        else:
            return False
    return True


def _foreign(criterion: Reports, wanted: Sequence[Entry], tokens: Sequence[Token]) -> str:
    """What was reported that must not be, in words; empty if nothing was."""
    expected = [words_of(entry) for entry in wanted if isinstance(entry, str)]
    words = [token.word for token in tokens]
    for text in criterion.among:
        parts = words_of(text)
        inside = any(find_words(entry, parts) is not None for entry in expected)
        if not inside and find_words(words, parts) is not None:
            return f"it named {quoted(text)}"
    numbers = [entry for entry in wanted if not isinstance(entry, str)]
    others = [
        token
        for token in tokens
        if token.value is not None and not any(_is_near(token.value, number, criterion.tolerance) for number in numbers)
    ]
    if criterion.only and others:
        return f"it reported {quoted(others[0].word)[1:-1]} as well"
    return ""


def _leeway(criterion: Reports, wanted: Sequence[Entry]) -> str:
    """How far off a number may be, where it is far enough to matter to whoever compares."""
    numbers = any(not isinstance(entry, str) for entry in wanted)
    return f" (within {criterion.tolerance:g})" if numbers and criterion.tolerance >= 1 else ""


def _entries(entries: Sequence[Entry]) -> str:
    return listed(tuple(entry if isinstance(entry, str) else f"{entry:g}" for entry in entries))
