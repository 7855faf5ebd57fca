"""Judging of consecutive words in what is said or printed: a count or a spelling.

``texts.py`` judges single texts.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from service.grading.grade import Measure, TrialResult
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.message_parts import quote_list, quote_text
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from service.grading.judging.stray_penalty import Strays, apply_stray_penalty
from service.grading.judging.text_tokens import compute_speech_ends, split_words
from sim.recording import Recording, TimedText
from sim.recording_values import get_pose_at
from submissions.criteria.sequence import WordSequence

_SPEECH_ROUNDING = 0.011  # a waiting program checks every 10 ms


@declare_judge(WordSequence)
def judge_word_sequence(criterion: WordSequence, trial: TrialResult) -> Outcome:
    """Judge consecutive words in what was said or printed. The best of several beginnings counts."""
    recording = trial.recording
    lines = recording.spoken if criterion.source == "speech" else recording.printed
    verb, past = ("say", "said") if criterion.source == "speech" else ("print", "printed")
    wanted = [[split_words(text) for text in texts] for texts in criterion.words]
    heard = [(word, line) for line in lines for word in split_words(line.text)]
    if not heard:
        return fail_with(f"Expected the robot to {verb} {_format_words(criterion)}, but it {past} nothing.")
    words = [word for word, _ in heard]
    begin, found, end = _find_best_run(criterion, wanted, words)
    outcome = _judge_best_run(criterion, recording, heard, found, end)
    asked = {word for alternatives in wanted for each in alternatives for word in each}
    again = sum(word in asked for word in (*words[:begin], *words[end:]))
    return apply_stray_penalty(
        outcome, criterion, len(wanted), Strays(f"it {past} these words {again} more times", again)
    )


def _judge_best_run(
    criterion: WordSequence, recording: Recording, heard: Sequence[tuple[str, TimedText]], found: int, end: int
) -> Outcome:
    """Return the outcome of the best run: ``found`` words came, and ``end`` is the place of the next word."""
    lines = recording.spoken if criterion.source == "speech" else recording.printed
    verb, past = ("say", "said") if criterion.source == "speech" else ("print", "printed")
    count, shown = len(criterion.words), _format_words(criterion)
    first = heard[end - 1][1] if found else heard[0][1]
    if found < count:
        instead = f"came {quote_text(heard[end][0])}" if end < len(heard) else "came nothing"
        after = (
            f"after {_format_alternatives(criterion.words[found - 1])} {instead}"
            if found
            else f"it began with {quote_text(heard[0][0])}"
        )
        return fail_with(
            f"Expected the robot to {verb} {shown}, but {after} instead of "
            f"{_format_alternatives(criterion.words[found])} "
            f"({found} of {count} in order).",
            first.t,
            get_pose_at(recording, first.t),
            Fraction(found, count),
        )
    if end < len(heard) and not criterion.more:
        word, line = heard[end]
        return fail_with(
            f"Expected the robot to {verb} {shown} and nothing after it, but it {past} {quote_text(word)} as well.",
            line.t,
            get_pose_at(recording, line.t),
            Fraction(count, count + len(heard) - end),
        )
    hurried = _find_hurried_line(lines) if criterion.waits else None
    if hurried is not None:
        return fail_with(
            f"Expected the robot to wait until each word is spoken, but it said {quote_text(hurried.text)} while "
            "it was "
            "still speaking.",
            hurried.t,
            get_pose_at(recording, hurried.t),
            Fraction(1, 2),
        )
    measures = (Measure("words", float(count)), Measure("last at", first.t, "s"))
    return pass_with(f"The robot {past} {shown}.", first.t, get_pose_at(recording, first.t), measures)


def _find_best_run(
    criterion: WordSequence, wanted: Sequence[Sequence[list[str]]], words: list[str]
) -> tuple[int, int, int]:
    """Return the start of the best run, how many wanted words it has, and the place of the next word.

    Among runs with equally many words, the one with the last end wins. If words are missing, or with ``more``, the one
    with the longest text from start to end wins.
    """

    def worth(run: tuple[int, int, int]) -> tuple[int, int]:
        begin, found, end = run
        return found, end - begin if criterion.more or found < len(wanted) else end

    starts = range(len(words)) if criterion.lead_in else range(1)
    runs = (
        (start, found, end) for start in starts for found, ends in [_measure_run(wanted, words, start)] for end in ends
    )
    return max(runs, key=worth)


def _measure_run(wanted: Sequence[Sequence[list[str]]], words: list[str], start: int) -> tuple[int, list[int]]:
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


def _find_hurried_line(lines: Sequence[TimedText]) -> TimedText | None:
    """Return the first text that was said before the previous one had been spoken to its end, or None."""
    for until, after in zip(compute_speech_ends(lines), lines[1:], strict=False):
        if after.t < until - _SPEECH_ROUNDING:
            return after
    return None


def _format_words(criterion: WordSequence) -> str:
    return quote_text(" ".join(texts[0] for texts in criterion.words))


def _format_alternatives(texts: tuple[str, ...]) -> str:
    return quote_list(texts, "or")
