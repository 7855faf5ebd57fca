"""Judging of reports: the right numbers and words, in the right order and place.

``texts.py`` judges how often a text comes, and ``sequence.py`` consecutive words.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from service.grading.grade import Measure, TrialResult
from service.grading.judging.entries import Entry, Report, Row, are_alike, is_near, suits
from service.grading.judging.geometry import in_zone, part_at, part_at_time, zone_words
from service.grading.judging.judges import judges
from service.grading.judging.message_parts import listed, quoted
from service.grading.judging.outcome import Outcome, failed, passed
from service.grading.judging.precision import Strays, tempered
from service.grading.judging.readings import INSTRUMENTS, were_read
from service.grading.judging.text_tokens import Token, find_words, tokens_of, words_of
from sim.floors import label_names
from sim.recorded import floor_of, pose_at
from sim.recording import Line, Recording
from submissions.criteria.places import Zone
from submissions.criteria.reporting import EventAt, Events, Reports

_DEEDS = {"print": "print", "speech": "say", "either": "report", "reply": "answer"}
#: The label of a place that has none.
NO_LABEL = "nothing"


@judges(Reports)
def judge_reports(criterion: Reports, trial: TrialResult) -> Outcome:
    """Judge a report by searching for the entries of the trial's pose, in order."""
    wanted = _expected_entries(criterion, trial)
    lines = _texts(criterion, trial.recording)
    told = [(token, line.t) for line in lines for token in tokens_of(line.text)]
    rows = _rows(criterion, trial.recording)
    outcome = _reported(criterion, wanted, rows, [line.text for line in lines], [token for token, _ in told])
    guesses = _guesses(criterion, wanted, told, trial.recording)
    return tempered(
        outcome, criterion, len(wanted), Strays(f"{guesses} other numbers were reported as well", others=guesses)
    )


def _reported(
    criterion: Reports, wanted: Row, rows: frozenset[Row], texts: Sequence[str], tokens: Sequence[Token]
) -> Outcome:
    who = "the responder" if criterion.source == "reply" else "the program"
    deed = _DEEDS[criterion.source]
    asked = f"Expected {who} to {deed} {_entries(wanted)}{_leeway(criterion, wanted)}"
    if not texts:
        return failed(f"{asked}, but it did not {deed} anything.")
    report = Report(tokens, rows, criterion.leeway)
    found = report.find(wanted)
    measures = tuple(Measure(f"reported {place}", value) for place, value in enumerate(found.values, 1))
    heard = quoted(" | ".join(texts))
    foreign = _foreign(criterion, wanted, tokens) or _other_label(criterion, wanted, rows, report)
    if foreign:
        return failed(f"{asked}, but {foreign}: {heard}.", measures=measures)
    guessed = _is_guess(criterion, wanted, report, found.count)
    if found.count < len(wanted):
        missing = _entries(wanted[found.count : found.count + 1])
        where = f" after {_entries(wanted[found.count - 1 : found.count])}" if found.count else ""
        beside = ", and it reported as many entries of most other poses" if guessed else ""
        return failed(
            f"{asked}, but {missing} did not come{where}{beside}: {heard}.",
            score=Fraction(0 if guessed else found.count, len(wanted)),
            measures=measures,
        )
    if guessed:
        return failed(
            f"{asked} and no entries of other poses, but it reported those as well: {heard}.", measures=measures
        )
    return passed(f"{who.capitalize()} reported {_entries(wanted)}.", measures=measures)


def _expected_entries(criterion: Reports, trial: TrialResult) -> Row:
    if criterion.expected != "label":
        rows = criterion.expected
        return rows[min(trial.place, len(rows) - 1)]
    return row_of_label(label_at_start(trial.recording))


def row_of_label(label: str) -> Row:
    """Return the row that must be reported on a floor with this label."""
    return (float(label) if label.isdecimal() else label,)


def _rows(criterion: Reports, recording: Recording) -> frozenset[Row]:
    """Return the rows of all poses; for labels, one row for each label that the floor can have."""
    if criterion.expected != "label":
        return frozenset(criterion.expected)
    return frozenset(map(row_of_label, (*label_names(recording.background), NO_LABEL)))


def label_at_start(recording: Recording) -> str:
    """Return the floor's label under the left light sensor at the start, or ``NO_LABEL``."""
    floor = floor_of(recording)
    label = floor.label_at(*part_at(recording, "left", recording.start)) if floor else None
    return label or NO_LABEL


def _texts(criterion: Reports, recording: Recording) -> list[Line]:
    if criterion.source == "reply":
        return [Line(m.t, m.text) for m in recording.messages if m.sender == "responder" and m.note != "duplicated"]
    printed = recording.printed if criterion.source != "speech" else ()
    # Text from say() is also printed, and would be counted twice.
    spoken = recording.spoken if criterion.source == "speech" else ()
    if criterion.source == "either":
        shown = {(line.t, line.text) for line in printed}
        spoken = tuple(line for line in recording.spoken if (line.t, line.text) not in shown)
    return sorted([*printed, *spoken], key=lambda line: line.t)


def _guesses(
    criterion: Reports, wanted: Sequence[Entry], told: Sequence[tuple[Token, float]], recording: Recording
) -> int:
    """Return how many numbers were neither required nor read, allowing one (its time or count) for each reading."""
    others = [
        (token.value, t)
        for token, t in told
        if token.value is not None and not _is_one_of(token.value, wanted, criterion.leeway)
    ]
    values, at = [value for value, _ in others], [t for _, t in others]
    read = int(were_read(values, at, INSTRUMENTS, recording).sum())
    return max(len(others) - 2 * read, 0)


def _is_one_of(value: float, wanted: Sequence[Entry], tolerance: float) -> bool:
    return any(is_near(value, entry, tolerance) for entry in wanted if not isinstance(entry, str))


def _is_guess(criterion: Reports, wanted: Row, report: Report, count: int) -> bool:
    """Return whether the report contains the first ``count`` entries of more than half of the poses.

    It is a guess only if the answers of these poses differ. Once all entries of ``wanted`` are found, only complete
    rows of other poses count. Poses are counted, not rows, because a row shared by many poses is easier to guess.
    """
    if criterion.expected == "label" or not count:
        return False
    whole = count == len(wanted)
    reported = {
        row
        for row in frozenset(criterion.expected)
        if report.find(row).count >= (len(row) if whole else min(count, len(row)))
    }
    is_same = suits if whole else are_alike
    if all(is_same(row, wanted, criterion.tolerance) for row in reported):
        return False
    return 2 * sum(row in reported for row in criterion.expected) > len(criterion.expected)


def _other_label(criterion: Reports, wanted: Row, rows: frozenset[Row], report: Report) -> str:
    """Return a description of the other floor label that was reported; empty if none was."""
    if criterion.expected != "label":
        return ""
    others = sorted(_entries(row) for row in rows if report.has(row) and not suits(row, wanted, criterion.leeway))
    return f"it named {others[0]}" if others else ""


def _foreign(criterion: Reports, wanted: Sequence[Entry], tokens: Sequence[Token]) -> str:
    """Return a description of a forbidden text that was reported; empty if there is none."""
    expected = [words_of(entry) for entry in wanted if isinstance(entry, str)]
    words = [token.word for token in tokens]
    for text in criterion.among:
        parts = words_of(text)
        inside = any(find_words(entry, parts) is not None for entry in expected)
        if not inside and find_words(words, parts) is not None:
            return f"it named {quoted(text)}"
    if criterion.only:
        others = (each for each in tokens if each.value is not None)
        foreign = next((each for each in others if not _is_one_of(each.value or 0.0, wanted, criterion.leeway)), None)
        if foreign is not None:
            return f"it reported {quoted(foreign.word)[1:-1]} as well"
    return ""


def _leeway(criterion: Reports, wanted: Sequence[Entry]) -> str:
    """Return the allowed difference of numbers in words, if it is large enough to matter."""
    numbers = any(not isinstance(entry, str) for entry in wanted)
    return f" (within {criterion.leeway:g})" if numbers and criterion.leeway >= 1 else ""


def _entries(entries: Sequence[Entry]) -> str:
    return listed(tuple(entry if isinstance(entry, str) else f"{entry:g}" for entry in entries))


@dataclass(frozen=True, slots=True)
class _Mention:
    """A line that names texts of events, and the position of the sensor at that time."""

    line: Line
    texts: frozenset[str]
    place: tuple[float, float]


@judges(Events)
def judge_events(criterion: Events, trial: TrialResult) -> Outcome:
    """Judge the events, each after the previous one. The first mention at the right place counts.

    A mention at a place where another event also belongs does not distinguish the places, and does not count.
    """
    mentions = _mentions(criterion, trial.recording)
    outcome = _found_in_places(criterion, mentions, trial.recording)
    elsewhere = _elsewhere(criterion, mentions)
    beside = Strays(f"these texts came {elsewhere} times at wrong places", elsewhere)
    return tempered(outcome, criterion, len(criterion.events), beside)


def _mentions(criterion: Events, recording: Recording) -> list[_Mention]:
    """Return the lines that name texts of events, by time."""
    printed = recording.printed if criterion.source != "speech" else ()
    spoken = recording.spoken if criterion.source != "print" else ()
    lines = sorted({(line.t, line.text): line for line in (*printed, *spoken)}.values(), key=lambda line: line.t)
    phrases = {text: _phrase(text) for event in criterion.events for text in event.text}
    mentions = []
    for line in lines:
        said = _phrase(line.text)
        texts = frozenset(text for text, phrase in phrases.items() if phrase in said)
        if texts:
            mentions.append(_Mention(line, texts, part_at_time(recording, criterion.sensor, line.t)))
    return mentions


def _phrase(text: str) -> str:
    """Return the words with a space around each, so that ``in`` finds whole words only."""
    return " ".join(("", *words_of(text), ""))


def _found_in_places(criterion: Events, mentions: Sequence[_Mention], recording: Recording) -> Outcome:
    found: list[_Mention] = []
    start = 0
    strays = _strays(criterion, mentions)
    for event in criterion.events:
        if event in strays:
            return _stray(criterion, event, strays[event], found, recording)
        place = next((i for i in range(start, len(mentions)) if _happens(criterion, event, mentions[i])), None)
        if place is None:
            return _missed(criterion, event, found, mentions[start:], recording)
        found.append(mentions[place])
        start = place + 1
    names = tuple(event.text[0] for event in criterion.events)
    measures = tuple(Measure(f"x at {name}", each.place[0], "mm") for name, each in zip(names, found, strict=True))
    end = found[-1].line.t
    return passed(f"{listed(names)} came in order, each at its place.", end, pose_at(recording, end), measures)


def _names(mention: _Mention, event: EventAt) -> bool:
    return not mention.texts.isdisjoint(event.text)


def _is_at(criterion: Events, event: EventAt, mention: _Mention) -> bool:
    return in_zone(mention.place, event.zone, criterion.margin)


def _happens(criterion: Events, event: EventAt, mention: _Mention) -> bool:
    return _names(mention, event) and _is_at(criterion, event, mention)


def _elsewhere(criterion: Events, mentions: Sequence[_Mention]) -> int:
    """Return how many texts of events came outside all places that they belong to."""
    own: dict[tuple[str, ...], list[Zone]] = {}
    for event in criterion.events:
        own.setdefault(event.text, []).append(event.zone)
    return sum(
        not mention.texts.isdisjoint(texts)
        and not any(in_zone(mention.place, zone, criterion.margin) for zone in zones)
        for mention in mentions
        for texts, zones in own.items()
    )


def _strays(criterion: Events, mentions: Sequence[_Mention]) -> dict[EventAt, _Mention]:
    """Return the first mention of each event at the place of an event with different words."""
    strays: dict[EventAt, _Mention] = {}
    for mention in mentions:
        here = [other for other in criterion.events if _is_at(criterion, other, mention)]
        for event in criterion.events:
            if event in strays or not _names(mention, event):
                continue
            # At the place of an event with the same words, the mention is right.
            if here and all(set(event.text).isdisjoint(other.text) for other in here):
                strays[event] = mention
    return strays


def _stray(
    criterion: Events, event: EventAt, mention: _Mention, found: Sequence[_Mention], recording: Recording
) -> Outcome:
    (x, y), t = mention.place, mention.line.t
    return failed(
        f"{_expected(criterion, event)} and not at the place of another text, but it came at ({x:.1f}, {y:.1f}) as "
        "well.",
        t,
        pose_at(recording, t),
        Fraction(len(found), len(criterion.events)),
    )


def _expected(criterion: Events, event: EventAt) -> str:
    what = "the robot" if criterion.sensor == "middle" else f"the {criterion.sensor} light sensor"
    deed = {"speech": "said", "print": "printed", "either": "reported"}[criterion.source]
    return f"Expected {quoted(event.text[0])} to be {deed} with {what} at {zone_words(event.zone)}"


def _missed(
    criterion: Events,
    event: EventAt,
    found: Sequence[_Mention],
    after: Sequence[_Mention],
    recording: Recording,
) -> Outcome:
    expected = _expected(criterion, event)
    score = Fraction(len(found), len(criterion.events))
    elsewhere = next((mention for mention in after if _names(mention, event)), None)
    if elsewhere is None:
        last = found[-1].line if found else None
        behind = f" after {quoted(last.text)}" if last else ""
        t = last.t if last else None
        pose = None if t is None else pose_at(recording, t)
        return failed(f"{expected}, but it did not come{behind}.", t, pose, score)
    (x, y), t = elsewhere.place, elsewhere.line.t
    return failed(f"{expected}, but the text came at ({x:.1f}, {y:.1f}).", t, pose_at(recording, t), score)
