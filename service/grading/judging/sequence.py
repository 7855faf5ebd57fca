"""Judging of consecutive words in what is said or printed: a count or a spelling.

``texts.py`` judges single texts.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from service.grading.grade import Measure, TrialResult
from service.grading.judging.judges import judges
from service.grading.judging.message_parts import listed, quoted
from service.grading.judging.outcome import Outcome, failed, passed
from service.grading.judging.precision import Strays, tempered
from service.grading.judging.text_tokens import spoken_until, words_of
from sim.recorded import pose_at
from sim.recording import Line, Recording
from submissions.criteria.sequence import WordSequence

_SPEECH_ROUNDING = 0.011  # a waiting program checks every 10 ms


@judges(WordSequence)
def judge_word_sequence(criterion: WordSequence, trial: TrialResult) -> Outcome:
    """Judge consecutive words in what was said or printed. The best of several beginnings counts."""
    recording = trial.recording
    lines = recording.spoken if criterion.source == "speech" else recording.printed
    verb, past = ("say", "said") if criterion.source == "speech" else ("print", "printed")
    wanted = [[words_of(text) for text in texts] for texts in criterion.words]
    heard = [(word, line) for line in lines for word in words_of(line.text)]
    if not heard:
        return failed(f"Expected the robot to {verb} {_shown(criterion)}, but it {past} nothing.")
    words = [word for word, _ in heard]
    begin, found, end = _best_run(criterion, wanted, words)
    outcome = _in_sequence(criterion, recording, heard, found, end)
    asked = {word for alternatives in wanted for each in alternatives for word in each}
    again = sum(word in asked for word in (*words[:begin], *words[end:]))
    return tempered(outcome, criterion, len(wanted), Strays(f"it {past} these words {again} more times", again))


def _in_sequence(
    criterion: WordSequence, recording: Recording, heard: Sequence[tuple[str, Line]], found: int, end: int
) -> Outcome:
    """Return the outcome of the best run: ``found`` words came, and ``end`` is the place of the next word."""
    lines = recording.spoken if criterion.source == "speech" else recording.printed
    verb, past = ("say", "said") if criterion.source == "speech" else ("print", "printed")
    count, shown = len(criterion.words), _shown(criterion)
    first = heard[end - 1][1] if found else heard[0][1]
    if found < count:
        instead = f"came {quoted(heard[end][0])}" if end < len(heard) else "came nothing"
        after = (
            f"after {_alternatives(criterion.words[found - 1])} {instead}"
            if found
            else f"it began with {quoted(heard[0][0])}"
        )
        return failed(
            f"Expected the robot to {verb} {shown}, but {after} instead of {_alternatives(criterion.words[found])} "
            f"({found} of {count} in order).",
            first.t,
            pose_at(recording, first.t),
            Fraction(found, count),
        )
    if end < len(heard) and not criterion.more:
        word, line = heard[end]
        return failed(
            f"Expected the robot to {verb} {shown} and nothing after it, but it {past} {quoted(word)} as well.",
            line.t,
            pose_at(recording, line.t),
            Fraction(count, count + len(heard) - end),
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
    measures = (Measure("words", float(count)), Measure("last at", first.t, "s"))
    return passed(f"The robot {past} {shown}.", first.t, pose_at(recording, first.t), measures)


def _best_run(criterion: WordSequence, wanted: Sequence[Sequence[list[str]]], words: list[str]) -> tuple[int, int, int]:
    """Return the start of the best run, how many wanted words it has, and the place of the next word.

    Among runs with equally many words, the one with the last end wins. If words are missing, or with ``more``, the one
    with the longest text from start to end wins.
    """

    def worth(run: tuple[int, int, int]) -> tuple[int, int]:
        begin, found, end = run
        return found, end - begin if criterion.more or found < len(wanted) else end

    starts = range(len(words)) if criterion.lead_in else range(1)
    runs = ((start, found, end) for start in starts for found, ends in [_run(wanted, words, start)] for end in ends)
    return max(runs, key=worth)


def _run(wanted: Sequence[Sequence[list[str]]], words: list[str], start: int) -> tuple[int, list[int]]:
    """Return how many wanted words follow without a gap from ``start``, and the possible places of the next word."""
    places = [start]
    for count, alternatives in enumerate(wanted):
        after = {
            place + len(each) for place in places for each in alternatives if words[place : place + len(each)] == each
        }
        if not after:
            return count, places
        places = sorted(after)
    return len(wanted), places


def _hurried(lines: Sequence[Line]) -> Line | None:
    """Return the first text that was said before the previous one had been spoken to its end, or None."""
    for until, after in zip(spoken_until(lines), lines[1:], strict=False):
        if after.t < until - _SPEECH_ROUNDING:
            return after
    return None


def _shown(criterion: WordSequence) -> str:
    return quoted(" ".join(texts[0] for texts in criterion.words))


def _alternatives(texts: tuple[str, ...]) -> str:
    return listed(texts, "or")
