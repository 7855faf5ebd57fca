"""Judging words that come one after the other, and events that must happen at a place.

Words are compared without case and punctuation; where the robot was is read from the recording.
"""

from __future__ import annotations

from collections.abc import Sequence as SequenceOf
from fractions import Fraction

from service.grading.grade import Measure, TrialResult
from service.grading.judging.outcome import Outcome, failed, listed, passed, pose_at, quoted
from service.grading.judging.places import in_zone, part_at_time, zone_words
from service.grading.judging.words import find_words, spoken_until, words_of
from sim.recording import Line, Recording
from submissions.criteria.reporting import EventAt, Events, Sequence

_SPEECH_ROUNDING = 0.011  # a waiting program looks every 10 ms


def judge_word_sequence(criterion: Sequence, trial: TrialResult) -> Outcome:
    recording = trial.recording
    lines = recording.spoken if criterion.source == "speech" else recording.printed
    verb, past = ("say", "said") if criterion.source == "speech" else ("print", "printed")
    wanted = [[words_of(text) for text in texts] for texts in criterion.words]
    shown = _shown(criterion)
    heard = [(word, line) for line in lines for word in words_of(line.text)]
    if not heard:
        return failed(f"Expected the robot to {verb} {shown}, but it {past} nothing.")
    words = [word for word, _ in heard]
    starts = range(len(words)) if criterion.lead_in else range(1)
    runs = [_run(wanted, words, start) for start in starts]
    found, end = max(runs, key=lambda run: run[0])
    first = heard[end - 1][1] if found else heard[0][1]
    if found < len(wanted):
        instead = f"came {quoted(heard[end][0])}" if end < len(heard) else "came nothing"
        after = f"after {_alternatives(criterion.words[found - 1])} {instead}" if found else f"it began {_began(words)}"
        return failed(
            f"Expected the robot to {verb} {shown}, but {after} instead of {_alternatives(criterion.words[found])} "
            f"({found} of {len(wanted)} in order).",
            first.t,
            pose_at(recording, first.t),
            Fraction(found, len(wanted)),
        )
    if end < len(words) and not criterion.more:
        word, line = heard[end]
        return failed(
            f"Expected the robot to {verb} {shown} and nothing after it, but it {past} {quoted(word)} as well.",
            line.t,
            pose_at(recording, line.t),
            Fraction(len(wanted), len(wanted) + len(words) - end),
        )
    hurried = _hurried(lines) if criterion.waits else None
    if hurried is not None:
        return failed(
            f"Expected the robot to wait until each word is spoken, but it said {quoted(hurried.text)} while it was "
            "still speaking.",
            hurried.t,
            pose_at(recording, hurried.t),
            Fraction(1, 2),
        )
    measures = (Measure("words", float(len(wanted))), Measure("last at", first.t, "s"))
    return passed(f"The robot {past} {shown}.", first.t, pose_at(recording, first.t), measures)


def judge_events(criterion: Events, trial: TrialResult) -> Outcome:
    """Each event is looked for after the one before it; the first mention at the right place counts.

    What is said where another event belongs as well does not tell the places apart, and does not count.
    """
    recording = trial.recording
    lines = _lines(criterion, recording)
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


def _run(wanted: SequenceOf[SequenceOf[list[str]]], words: list[str], start: int) -> tuple[int, int]:
    """How many of the wanted words come without a gap from ``start`` on, and where the next word is."""
    place = start
    for count, alternatives in enumerate(wanted):
        length = next((len(each) for each in alternatives if words[place : place + len(each)] == each), None)
        if length is None:
            return count, place
        place += length
    return len(wanted), place


def _hurried(lines: SequenceOf[Line]) -> Line | None:
    """The first text that was said before the one before it had been spoken to its end."""
    for until, after in zip(spoken_until(lines), lines[1:], strict=False):
        if after.t < until - _SPEECH_ROUNDING:
            return after
    return None


def _shown(criterion: Sequence) -> str:
    return quoted(" ".join(texts[0] for texts in criterion.words))


def _began(words: SequenceOf[str]) -> str:
    return f"with {quoted(words[0])}"


def _alternatives(texts: tuple[str, ...]) -> str:
    return listed(texts, "or")


def _lines(criterion: Events, recording: Recording) -> list[Line]:
    printed = recording.printed if criterion.source != "speech" else ()
    spoken = recording.spoken if criterion.source != "print" else ()
    return sorted({(line.t, line.text): line for line in (*printed, *spoken)}.values(), key=lambda line: line.t)


def _mentions(event: EventAt, line: Line) -> bool:
    words = words_of(line.text)
    return any(find_words(words, words_of(text)) is not None for text in event.text)


def _happens(criterion: Events, event: EventAt, line: Line, recording: Recording) -> bool:
    return _mentions(event, line) and in_zone(
        part_at_time(recording, criterion.sensor, line.t), event.zone, criterion.margin
    )


def _strays(criterion: Events, lines: SequenceOf[Line], recording: Recording) -> dict[EventAt, Line]:
    """For each event that was mentioned at the place of one with other words the first such line."""
    strays: dict[EventAt, Line] = {}
    for line in lines:
        mentioned = [event for event in criterion.events if event not in strays and _mentions(event, line)]
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
    criterion: Events, event: EventAt, found: list[Line], after: SequenceOf[Line], recording: Recording
) -> Outcome:
    expected = _expected(criterion, event)
    score = Fraction(len(found), len(criterion.events))
    elsewhere = next((line for line in after if _mentions(event, line)), None)
    if elsewhere is None:
        behind = f" after {quoted(found[-1].text)}" if found else ""
        t = found[-1].t if found else None
        pose = None if t is None else pose_at(recording, t)
        return failed(f"{expected}, but it did not come{behind}.", t, pose, score)
    x, y = part_at_time(recording, criterion.sensor, elsewhere.t)
    return failed(
        f"{expected}, but it came with it at ({x:.1f}, {y:.1f}).", elsewhere.t, pose_at(recording, elsewhere.t), score
    )
