"""Judging of reports: the right numbers and words, in the right order and place.

``texts.py`` judges how often a text comes, and ``sequence.py`` consecutive words.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from types import MappingProxyType

from service.grading.findings import MissingEntry
from service.grading.grade import Measure, TrialResult
from service.grading.judging.geometry import describe_zone, is_in_zone, locate_part, locate_part_at_time
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.message_parts import quote_list, quote_text
from service.grading.judging.outcome import Outcome, Strays, apply_stray_penalty, fail_with, pass_with
from service.grading.judging.report_places import describe_uncounted_report, select_counting_lines
from service.grading.judging.report_rows import Entry, ReportTokens, Row, can_match_row, is_equivalent_row, is_near
from service.grading.judging.report_sentences import (
    describe_expectation,
    describe_expected_entries,
    describe_missing_entry,
    describe_missing_report,
    describe_right_report,
    describe_wrong_report,
    format_entries,
    format_entry,
)
from service.grading.judging.sensor_readings import INSTRUMENTS, match_readings
from service.grading.judging.text_tokens import Token, find_words, split_words, tokenize_text
from service.language import translatable
from sim.floors import list_label_names
from sim.recording import Recording, TimedText
from sim.recording_values import get_pose_at, rebuild_floor
from sim.sentences import Sentence
from submissions.criteria.places import Zone
from submissions.criteria.reporting import EventAt, Events, Reports

_EXPECTED_EVENTS: Mapping[str, str] = MappingProxyType(
    {
        "print": translatable("Expected %(text)s to be printed with %(part)s at %(zone)s"),
        "speech": translatable("Expected %(text)s to be said with %(part)s at %(zone)s"),
        "either": translatable("Expected %(text)s to be reported with %(part)s at %(zone)s"),
    }
)
_PARTS: Mapping[str, Sentence] = MappingProxyType(
    {
        "left": Sentence("the left light sensor"),
        "right": Sentence("the right light sensor"),
        "middle": Sentence("the robot"),
    }
)
#: The label of a place that has none.
NO_LABEL = "nothing"


@declare_judge(Reports)
def judge_reports(criterion: Reports, trial: TrialResult) -> Outcome:
    """Judge a report by searching for the entries of the trial's pose, in order."""
    answer_row = _find_expected_row(criterion, trial)
    all_lines = _collect_texts(criterion, trial.recording)
    lines = select_counting_lines(criterion, all_lines, trial.recording)
    if all_lines and not lines:
        entries = describe_expected_entries(criterion, answer_row)
        return fail_with(describe_uncounted_report(criterion, describe_expectation(criterion, entries)))
    timed_tokens = [(token, line.t) for line in lines for token in tokenize_text(line.text)]
    rows = _collect_rows(criterion, trial.recording)
    outcome = _judge_report(
        criterion, answer_row, rows, [line.text for line in lines], [token for token, _ in timed_tokens]
    )
    guesses = _count_guesses(criterion, answer_row, timed_tokens, trial.recording)
    strays = Strays(Sentence("%(count)s other numbers were reported as well", count=guesses), others=guesses)
    return apply_stray_penalty(outcome, criterion, len(answer_row), strays)


def _judge_report(
    criterion: Reports, answer_row: Row, rows: frozenset[Row], texts: Sequence[str], tokens: Sequence[Token]
) -> Outcome:
    entries = describe_expected_entries(criterion, answer_row)
    expectation = describe_expectation(criterion, entries)
    if not texts:
        return fail_with(describe_missing_report(criterion, expectation))
    report = ReportTokens(tokens, rows, criterion.leeway)
    match = report.find(answer_row)
    measures = tuple(
        Measure(Sentence("reported %(number)s", number=place), value) for place, value in enumerate(match.values, 1)
    )
    report_text = quote_text(" | ".join(texts))
    problem = _describe_forbidden_text(criterion, answer_row, tokens) or _describe_other_label(
        criterion, answer_row, rows, report
    )
    if problem:
        return fail_with(describe_wrong_report(expectation, problem, report_text), measures=measures)
    is_guess = _is_guess(criterion, answer_row, report, match.count)
    if match.count < len(answer_row):
        problem = describe_missing_entry(answer_row, match.count, is_guess)
        return fail_with(
            describe_wrong_report(expectation, problem, report_text),
            score=Fraction(0 if is_guess else match.count, len(answer_row)),
            measures=measures,
            findings=(_build_missing_entry(answer_row, match.count, texts),),
        )
    if is_guess:
        exact_entries = Sentence("%(entries)s and no entries of other poses", entries=entries)
        exact_expectation = describe_expectation(criterion, exact_entries)
        problem = Sentence("it reported those as well")
        return fail_with(describe_wrong_report(exact_expectation, problem, report_text), measures=measures)
    return pass_with(describe_right_report(criterion, answer_row), measures=measures)


def _build_missing_entry(answer_row: Row, number: int, texts: Sequence[str]) -> MissingEntry:
    previous = format_entry(answer_row[number - 1]) if number else ""
    return MissingEntry(format_entry(answer_row[number]), previous, tuple(texts))


def _find_expected_row(criterion: Reports, trial: TrialResult) -> Row:
    if criterion.expected != "label":
        rows = criterion.expected
        return rows[min(trial.place, len(rows) - 1)]
    return build_label_row(find_start_label(trial.recording))


def build_label_row(label: str) -> Row:
    """Return the row that must be reported on a floor with this label."""
    return (float(label) if label.isdecimal() else label,)


def _collect_rows(criterion: Reports, recording: Recording) -> frozenset[Row]:
    """Return the rows of all poses; for labels, one row for each label that the floor can have."""
    if criterion.expected != "label":
        return frozenset(criterion.expected)
    return frozenset(map(build_label_row, (*list_label_names(recording.background), NO_LABEL)))


def find_start_label(recording: Recording) -> str:
    """Return the floor's label under the left light sensor at the start, or ``NO_LABEL``."""
    floor = rebuild_floor(recording)
    label = floor.find_label(*locate_part(recording, "left", recording.start)) if floor else None
    return label or NO_LABEL


def _collect_texts(criterion: Reports, recording: Recording) -> list[TimedText]:
    if criterion.source == "reply":
        return [
            TimedText(m.t, m.text) for m in recording.messages if m.sender == "responder" and m.note != "duplicated"
        ]
    printed_lines = recording.printed if criterion.source != "speech" else ()
    # Text from say() is also printed, and would be counted twice.
    spoken_lines = recording.spoken if criterion.source == "speech" else ()
    if criterion.source == "either":
        printed_keys = {(line.t, line.text) for line in printed_lines}
        spoken_lines = tuple(line for line in recording.spoken if (line.t, line.text) not in printed_keys)
    return sorted([*printed_lines, *spoken_lines], key=lambda line: line.t)


def _count_guesses(
    criterion: Reports, answer_row: Sequence[Entry], timed_tokens: Sequence[tuple[Token, float]], recording: Recording
) -> int:
    """Return how many numbers were neither required nor read, allowing one (its time or count) for each reading."""
    other_numbers = [
        (token.value, t)
        for token, t in timed_tokens
        if token.value is not None and not _is_one_of(token.value, answer_row, criterion.leeway)
    ]
    values, times = [value for value, _ in other_numbers], [t for _, t in other_numbers]
    read_count = int(match_readings(values, times, INSTRUMENTS, recording).sum())
    return max(len(other_numbers) - 2 * read_count, 0)


def _is_one_of(value: float, entries: Sequence[Entry], tolerance: float) -> bool:
    return any(is_near(value, entry, tolerance) for entry in entries if not isinstance(entry, str))


def _is_guess(criterion: Reports, answer_row: Row, report: ReportTokens, count: int) -> bool:
    """Return whether the report contains the first ``count`` entries of more than half of the poses.

    It is a guess only if the answers of these poses differ. Once all entries of ``answer_row`` are found, only complete
    rows of other poses count. Poses are counted, not rows, because a row shared by many poses is easier to guess.
    """
    if criterion.expected == "label" or not count:
        return False
    is_complete = count == len(answer_row)
    reported_rows = {
        row
        for row in frozenset(criterion.expected)
        if report.find(row).count >= (len(row) if is_complete else min(count, len(row)))
    }
    is_same = can_match_row if is_complete else is_equivalent_row
    if all(is_same(row, answer_row, criterion.tolerance) for row in reported_rows):
        return False
    return 2 * sum(row in reported_rows for row in criterion.expected) > len(criterion.expected)


def _describe_other_label(criterion: Reports, answer_row: Row, rows: frozenset[Row], report: ReportTokens) -> str:
    """Return a description of the other floor label that was reported; empty if none was."""
    if criterion.expected != "label":
        return ""
    other_labels = sorted(
        format_entries(row) for row in rows if report.has(row) and not can_match_row(row, answer_row, criterion.leeway)
    )
    return Sentence("it named %(text)s", text=other_labels[0]) if other_labels else ""


def _describe_forbidden_text(criterion: Reports, answer_row: Sequence[Entry], tokens: Sequence[Token]) -> str:
    """Return a description of a forbidden text that was reported; empty if there is none."""
    expected_texts = [split_words(entry) for entry in answer_row if isinstance(entry, str)]
    words = [token.word for token in tokens]
    for text in criterion.among:
        parts = split_words(text)
        is_expected = any(find_words(entry, parts) is not None for entry in expected_texts)
        if not is_expected and find_words(words, parts) is not None:
            return Sentence("it named %(text)s", text=quote_text(text))
    if criterion.only:
        numbers = (each for each in tokens if each.value is not None)
        foreign_number = next(
            (each for each in numbers if not _is_one_of(each.value or 0.0, answer_row, criterion.leeway)), None
        )
        if foreign_number is not None:
            return Sentence("it reported %(number)s as well", number=quote_text(foreign_number.word)[1:-1])
    return ""


@dataclass(frozen=True, slots=True)
class _Mention:
    """A line that names texts of events, and the position of the sensor at that time."""

    line: TimedText
    texts: frozenset[str]
    place: tuple[float, float]


@declare_judge(Events)
def judge_events(criterion: Events, trial: TrialResult) -> Outcome:
    """Judge the events, each after the previous one. The first mention at the right place counts.

    A mention at a place where another event also belongs does not distinguish the places, and does not count.
    """
    mentions = _collect_mentions(criterion, trial.recording)
    outcome = _judge_mentions(criterion, mentions, trial.recording)
    misplaced_count = _count_misplaced(criterion, mentions)
    description = Sentence("these texts came %(count)s times at wrong places", count=misplaced_count)
    strays = Strays(description, misplaced_count)
    return apply_stray_penalty(outcome, criterion, len(criterion.events), strays)


def _collect_mentions(criterion: Events, recording: Recording) -> list[_Mention]:
    """Return the lines that name texts of events, by time."""
    printed_lines = recording.printed if criterion.source != "speech" else ()
    spoken_lines = recording.spoken if criterion.source != "print" else ()
    lines = sorted(
        {(line.t, line.text): line for line in (*printed_lines, *spoken_lines)}.values(), key=lambda line: line.t
    )
    phrases = {text: _pad_words(text) for event in criterion.events for text in event.text}
    mentions = []
    for line in lines:
        padded_line = _pad_words(line.text)
        texts = frozenset(text for text, phrase in phrases.items() if phrase in padded_line)
        if texts:
            mentions.append(_Mention(line, texts, locate_part_at_time(recording, criterion.sensor, line.t)))
    return mentions


def _pad_words(text: str) -> str:
    """Return the words with a space around each, so that ``in`` finds whole words only."""
    return " ".join(("", *split_words(text), ""))


def _judge_mentions(criterion: Events, mentions: Sequence[_Mention], recording: Recording) -> Outcome:
    matched_mentions: list[_Mention] = []
    start = 0
    strays = _find_strays(criterion, mentions)
    for event in criterion.events:
        if event in strays:
            return _fail_for_stray(criterion, event, strays[event], matched_mentions, recording)
        index = next((i for i in range(start, len(mentions)) if _is_event(criterion, event, mentions[i])), None)
        if index is None:
            return _fail_for_missed_event(criterion, event, matched_mentions, mentions[start:], recording)
        matched_mentions.append(mentions[index])
        start = index + 1
    names = tuple(event.text[0] for event in criterion.events)
    measures = tuple(
        Measure(Sentence("x at %(name)s", name=name), each.place[0], "mm")
        for name, each in zip(names, matched_mentions, strict=True)
    )
    end = matched_mentions[-1].line.t
    return pass_with(
        Sentence("%(texts)s came in order, each at its place.", texts=quote_list(names)),
        end,
        get_pose_at(recording, end),
        measures,
    )


def _has_event_text(mention: _Mention, event: EventAt) -> bool:
    return not mention.texts.isdisjoint(event.text)


def _is_at(criterion: Events, event: EventAt, mention: _Mention) -> bool:
    return is_in_zone(mention.place, event.zone, criterion.margin)


def _is_event(criterion: Events, event: EventAt, mention: _Mention) -> bool:
    return _has_event_text(mention, event) and _is_at(criterion, event, mention)


def _count_misplaced(criterion: Events, mentions: Sequence[_Mention]) -> int:
    """Return how many texts of events came outside all places that they belong to."""
    zones_by_text: dict[tuple[str, ...], list[Zone]] = {}
    for event in criterion.events:
        zones_by_text.setdefault(event.text, []).append(event.zone)
    return sum(
        not mention.texts.isdisjoint(texts)
        and not any(is_in_zone(mention.place, zone, criterion.margin) for zone in zones)
        for mention in mentions
        for texts, zones in zones_by_text.items()
    )


def _find_strays(criterion: Events, mentions: Sequence[_Mention]) -> dict[EventAt, _Mention]:
    """Return the first mention of each event at the place of an event with different words."""
    strays: dict[EventAt, _Mention] = {}
    for mention in mentions:
        local_events = [other for other in criterion.events if _is_at(criterion, other, mention)]
        for event in criterion.events:
            if event in strays or not _has_event_text(mention, event):
                continue
            # At the place of an event with the same words, the mention is right.
            if local_events and all(set(event.text).isdisjoint(other.text) for other in local_events):
                strays[event] = mention
    return strays


def _fail_for_stray(
    criterion: Events, event: EventAt, mention: _Mention, matched_mentions: Sequence[_Mention], recording: Recording
) -> Outcome:
    (x, y), t = mention.place, mention.line.t
    return fail_with(
        Sentence(
            "%(expected)s and not at the place of another text, but it came at (%(x).1f, %(y).1f) as well.",
            expected=_describe_expected(criterion, event),
            x=x,
            y=y,
        ),
        t,
        get_pose_at(recording, t),
        Fraction(len(matched_mentions), len(criterion.events)),
    )


def _describe_expected(criterion: Events, event: EventAt) -> str:
    return Sentence(
        _EXPECTED_EVENTS[criterion.source],
        text=quote_text(event.text[0]),
        part=_PARTS[criterion.sensor],
        zone=describe_zone(event.zone),
    )


def _fail_for_missed_event(
    criterion: Events,
    event: EventAt,
    matched_mentions: Sequence[_Mention],
    later_mentions: Sequence[_Mention],
    recording: Recording,
) -> Outcome:
    expected = _describe_expected(criterion, event)
    score = Fraction(len(matched_mentions), len(criterion.events))
    misplaced_mention = next((mention for mention in later_mentions if _has_event_text(mention, event)), None)
    if misplaced_mention is None:
        if not matched_mentions:
            return fail_with(Sentence("%(expected)s, but it did not come.", expected=expected), score=score)
        last_line = matched_mentions[-1].line
        message = Sentence(
            "%(expected)s, but it did not come after %(text)s.", expected=expected, text=quote_text(last_line.text)
        )
        return fail_with(message, last_line.t, get_pose_at(recording, last_line.t), score)
    (x, y), t = misplaced_mention.place, misplaced_mention.line.t
    message = Sentence("%(expected)s, but the text came at (%(x).1f, %(y).1f).", expected=expected, x=x, y=y)
    return fail_with(message, t, get_pose_at(recording, t), score)
