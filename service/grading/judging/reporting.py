"""Judging what a program reports: the right figures and words, in the right order, at the right place.

How often a single text comes is judged in ``texts.py``, words one after the other in ``sequence.py``.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from service.grading.grade import Measure, TrialResult
from service.grading.judging.geometry import in_zone, part_at, part_at_time, zone_words
from service.grading.judging.judges import judges
from service.grading.judging.outcome import Outcome, failed, passed
from service.grading.judging.precision import Strays, tempered
from service.grading.judging.readings import INSTRUMENTS, were_read
from service.grading.judging.words import Token, find_words, listed, quoted, tokens_of, words_of
from sim.recorded import floor_of, pose_at
from sim.recording import Line, Recording
from submissions.criteria.places import Zone
from submissions.criteria.reporting import EventAt, Events, Reports

Entry = float | str

_DEEDS = {"print": "print", "speech": "say", "either": "report", "reply": "answer"}


@judges(Reports)
def judge_reports(criterion: Reports, trial: TrialResult) -> Outcome:
    """The figures and words that belong to the trial's pose, looked for in order in what was told."""
    wanted = _expected_entries(criterion, trial)
    lines = _texts(criterion, trial.recording)
    told = [(token, line.t) for line in lines for token in tokens_of(line.text)]
    outcome = _reported(criterion, wanted, [line.text for line in lines], [token for token, _ in told])
    guesses = _guesses(criterion, wanted, told, trial.recording)
    return tempered(outcome, criterion, len(wanted), Strays(f"{guesses} other numbers came as well", others=guesses))


def _reported(criterion: Reports, wanted: Sequence[Entry], texts: Sequence[str], tokens: Sequence[Token]) -> Outcome:
    who = "the responder" if criterion.source == "reply" else "the program"
    deed = _DEEDS[criterion.source]
    asked = f"Expected {who} to {deed} {_entries(wanted)}{_leeway(criterion, wanted)}"
    if not texts:
        return failed(f"{asked}, but it did not {deed} anything.")
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


def _expected_entries(criterion: Reports, trial: TrialResult) -> tuple[Entry, ...]:
    if criterion.expected != "label":
        rows = criterion.expected
        return rows[min(trial.place, len(rows) - 1)]
    label = label_at_start(trial.recording)
    return (float(label) if label.isdecimal() else label,)


def label_at_start(recording: Recording) -> str:
    """What the floor has under the left light sensor at the start; ``nothing`` where it has no label."""
    floor = floor_of(recording)
    label = floor.label_at(*part_at(recording, "left", recording.start)) if floor else None
    return label or "nothing"


def _texts(criterion: Reports, recording: Recording) -> list[Line]:
    if criterion.source == "reply":
        return [Line(m.t, m.text) for m in recording.messages if m.sender == "responder" and m.note != "duplicated"]
    printed = recording.printed if criterion.source != "speech" else ()
    # What say() prints as well would be there twice.
    spoken = recording.spoken if criterion.source == "speech" else ()
    if criterion.source == "either":
        shown = {(line.t, line.text) for line in printed}
        spoken = tuple(line for line in recording.spoken if (line.t, line.text) not in shown)
    return sorted([*printed, *spoken], key=lambda line: line.t)


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


def _guesses(
    criterion: Reports, wanted: Sequence[Entry], told: Sequence[tuple[Token, float]], recording: Recording
) -> int:
    """How many numbers nobody asked for and no sensor read; beside each reading one is its time, or its count."""
    others = [
        (token.value, t)
        for token, t in told
        if token.value is not None and not _is_one_of(token.value, wanted, criterion.tolerance)
    ]
    values, at = [value for value, _ in others], [t for _, t in others]
    read = int(were_read(values, at, INSTRUMENTS, recording).sum())
    return max(len(others) - 2 * read, 0)


def _is_one_of(value: float, wanted: Sequence[Entry], tolerance: float) -> bool:
    return any(_is_near(value, entry, tolerance) for entry in wanted if not isinstance(entry, str))


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
    """Whether the entries come from there on, one right after the other; of the numbers after a word any will do."""
    after_word = False
    for entry in row:
        if isinstance(entry, str):
            parts = words_of(entry)
            if [token.word for token in tokens[place : place + len(parts)]] != parts:
                return False
            place += len(parts)
        else:
            while after_word and place < len(tokens) and tokens[place].value is not None:
                if _is_near(tokens[place].value, entry, tolerance):
                    break
                place += 1
            if place >= len(tokens) or not _is_near(tokens[place].value, entry, tolerance):
                return False
            place += 1
        after_word = isinstance(entry, str)
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
    if criterion.only:
        others = (each for each in tokens if each.value is not None)
        foreign = next(
            (each for each in others if not _is_one_of(each.value or 0.0, wanted, criterion.tolerance)), None
        )
        if foreign is not None:
            return f"it reported {quoted(foreign.word)[1:-1]} as well"
    return ""


def _leeway(criterion: Reports, wanted: Sequence[Entry]) -> str:
    """How far off a number may be, where it is far enough to matter to whoever compares."""
    numbers = any(not isinstance(entry, str) for entry in wanted)
    return f" (within {criterion.tolerance:g})" if numbers and criterion.tolerance >= 1 else ""


def _entries(entries: Sequence[Entry]) -> str:
    return listed(tuple(entry if isinstance(entry, str) else f"{entry:g}" for entry in entries))


@judges(Events)
def judge_events(criterion: Events, trial: TrialResult) -> Outcome:
    """Each event is looked for after the one before it; the first mention at the right place counts.

    What is said where another event belongs as well does not tell the places apart, and does not count.
    """
    lines = _lines(criterion, trial.recording)
    outcome = _told_in_places(criterion, lines, trial.recording)
    elsewhere = _elsewhere(criterion, lines, trial.recording)
    beside = Strays(f"these texts came {elsewhere} times where they do not belong", elsewhere)
    return tempered(outcome, criterion, len(criterion.events), beside)


def _told_in_places(criterion: Events, lines: Sequence[Line], recording: Recording) -> Outcome:
    found: list[Line] = []
    start = 0
    strays = _strays(criterion, lines, recording)
    for event in criterion.events:
        if event in strays:
            return _stray(criterion, event, strays[event], found, recording)
        place = next((i for i in range(start, len(lines)) if _happens(criterion, event, lines[i], recording)), None)
        if place is None:
            return _missed(criterion, event, found, lines[start:], recording)
        found.append(lines[place])
        start = place + 1
    places = [part_at_time(recording, criterion.sensor, line.t) for line in found]
    names = tuple(event.text[0] for event in criterion.events)
    measures = tuple(Measure(f"x at {name}", x, "mm") for name, (x, _) in zip(names, places, strict=True))
    texts = listed(names)
    end = found[-1]
    return passed(f"{texts} came in order, each at its place.", end.t, pose_at(recording, end.t), measures)


def _lines(criterion: Events, recording: Recording) -> list[Line]:
    printed = recording.printed if criterion.source != "speech" else ()
    spoken = recording.spoken if criterion.source != "print" else ()
    return sorted({(line.t, line.text): line for line in (*printed, *spoken)}.values(), key=lambda line: line.t)


def _mentions(texts: Sequence[str], line: Line) -> bool:
    words = words_of(line.text)
    return any(find_words(words, words_of(text)) is not None for text in texts)


def _happens(criterion: Events, event: EventAt, line: Line, recording: Recording) -> bool:
    return _mentions(event.text, line) and in_zone(
        part_at_time(recording, criterion.sensor, line.t), event.zone, criterion.margin
    )


def _elsewhere(criterion: Events, lines: Sequence[Line], recording: Recording) -> int:
    """How many texts of events came outside of every place that they belong to."""
    own: dict[tuple[str, ...], list[Zone]] = {}
    for event in criterion.events:
        own.setdefault(event.text, []).append(event.zone)
    count = 0
    for line in lines:
        told = [zones for texts, zones in own.items() if _mentions(texts, line)]
        if told:
            place = part_at_time(recording, criterion.sensor, line.t)
            count += sum(not any(in_zone(place, zone, criterion.margin) for zone in zones) for zones in told)
    return count


def _strays(criterion: Events, lines: Sequence[Line], recording: Recording) -> dict[EventAt, Line]:
    """For each event that was mentioned at the place of one with other words the first such line."""
    strays: dict[EventAt, Line] = {}
    for line in lines:
        mentioned = [event for event in criterion.events if event not in strays and _mentions(event.text, line)]
        if not mentioned:
            continue
        place = part_at_time(recording, criterion.sensor, line.t)
        for event in mentioned:
            others = (other for other in criterion.events if set(event.text).isdisjoint(other.text))
            own = (other for other in criterion.events if not set(event.text).isdisjoint(other.text))
            if any(in_zone(place, each.zone, criterion.margin) for each in own):
                continue
            if any(in_zone(place, other.zone, criterion.margin) for other in others):
                strays[event] = line
    return strays


def _stray(criterion: Events, event: EventAt, line: Line, found: list[Line], recording: Recording) -> Outcome:
    x, y = part_at_time(recording, criterion.sensor, line.t)
    return failed(
        f"{_expected(criterion, event)} and not where another belongs, but it came at ({x:.1f}, {y:.1f}) as well.",
        line.t,
        pose_at(recording, line.t),
        Fraction(len(found), len(criterion.events)),
    )


def _expected(criterion: Events, event: EventAt) -> str:
    what = "the robot" if criterion.sensor == "middle" else f"the {criterion.sensor} light sensor"
    deed = {"speech": "said", "print": "printed", "either": "reported"}[criterion.source]
    return f"Expected {quoted(event.text[0])} to be {deed} with {what} at {zone_words(event.zone)}"


def _missed(
    criterion: Events, event: EventAt, found: list[Line], after: Sequence[Line], recording: Recording
) -> Outcome:
    expected = _expected(criterion, event)
    score = Fraction(len(found), len(criterion.events))
    elsewhere = next((line for line in after if _mentions(event.text, line)), None)
    if elsewhere is None:
        behind = f" after {quoted(found[-1].text)}" if found else ""
        t = found[-1].t if found else None
        pose = None if t is None else pose_at(recording, t)
        return failed(f"{expected}, but it did not come{behind}.", t, pose, score)
    x, y = part_at_time(recording, criterion.sensor, elsewhere.t)
    return failed(
        f"{expected}, but it came with it at ({x:.1f}, {y:.1f}).", elsewhere.t, pose_at(recording, elsewhere.t), score
    )
