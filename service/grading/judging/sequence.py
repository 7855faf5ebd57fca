"""Judging of consecutive words in what is said or printed: a count or a spelling.

``texts.py`` judges single texts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from types import MappingProxyType

from service.grading.findings import ExtraText, HurriedSpeech, OtherWord
from service.grading.grade import Measure, TrialResult
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.message_parts import quote_list, quote_text
from service.grading.judging.outcome import Outcome, Strays, apply_stray_penalty, fail_with, pass_with
from service.grading.judging.text_tokens import compute_speech_ends, split_words
from service.language import translatable
from sim.recording import Recording, TimedText
from sim.recording_values import get_pose_at
from sim.sentences import Sentence
from submissions.criteria.sequence import WordSequence

_SPEECH_ROUNDING = 0.011  # a waiting program checks every 10 ms


@dataclass(frozen=True, slots=True)
class _Wording:
    """Templates of messages about what was said, or about what was printed."""

    expected: str
    nothing: str
    extra: str
    success: str
    repeats: str


_WORDINGS: Mapping[str, _Wording] = MappingProxyType(
    {
        "speech": _Wording(
            translatable("Expected the robot to say %(words)s"),
            translatable("Expected the robot to say %(words)s, but it said nothing."),
            translatable("Expected the robot to say %(words)s and nothing after it, but it said %(extra)s as well."),
            translatable("The robot said %(words)s."),
            translatable("it said these words %(count)s more times"),
        ),
        "print": _Wording(
            translatable("Expected the robot to print %(words)s"),
            translatable("Expected the robot to print %(words)s, but it printed nothing."),
            translatable(
                "Expected the robot to print %(words)s and nothing after it, but it printed %(extra)s as well."
            ),
            translatable("The robot printed %(words)s."),
            translatable("it printed these words %(count)s more times"),
        ),
    }
)


@declare_judge(WordSequence)
def judge_word_sequence(criterion: WordSequence, trial: TrialResult) -> Outcome:
    """Judge consecutive words in what was said or printed. The best of several beginnings counts."""
    recording = trial.recording
    lines = recording.spoken if criterion.source == "speech" else recording.printed
    wording = _WORDINGS[criterion.source]
    expected_words = [[split_words(text) for text in texts] for texts in criterion.words]
    timed_words = [(word, line) for line in lines for word in split_words(line.text)]
    if not timed_words:
        return fail_with(Sentence(wording.nothing, words=_format_words(criterion)))
    words = [word for word, _ in timed_words]
    start, found_count, end = _find_best_run(criterion, expected_words, words)
    outcome = _judge_best_run(criterion, recording, timed_words, found_count, end)
    counted_words = {word for alternatives in expected_words for each in alternatives for word in each}
    repeat_count = sum(word in counted_words for word in (*words[:start], *words[end:]))
    return apply_stray_penalty(
        outcome,
        criterion,
        len(expected_words),
        Strays(Sentence(wording.repeats, count=repeat_count), repeat_count),
    )


def _judge_best_run(
    criterion: WordSequence,
    recording: Recording,
    timed_words: Sequence[tuple[str, TimedText]],
    found_count: int,
    end: int,
) -> Outcome:
    """Return the outcome of the best run: ``found_count`` words came, and ``end`` is the place of the next word."""
    lines = recording.spoken if criterion.source == "speech" else recording.printed
    wording = _WORDINGS[criterion.source]
    count, expected_text = len(criterion.words), _format_words(criterion)
    reference_line = timed_words[end - 1][1] if found_count else timed_words[0][1]
    if found_count < count:
        next_word = timed_words[end][0] if end < len(timed_words) else ""
        template = translatable(
            "%(expectation)s, but it began with %(actual)s instead of %(expected)s (%(found)s of %(count)s in order)."
        )
        if found_count:
            template = translatable(
                "%(expectation)s, but after %(previous)s came %(actual)s instead of %(expected)s (%(found)s of "
                "%(count)s in order)."
            )
        if not next_word:
            template = translatable(
                "%(expectation)s, but after %(previous)s came nothing instead of %(expected)s (%(found)s of %(count)s "
                "in order)."
            )
        return fail_with(
            Sentence(
                template,
                expectation=Sentence(wording.expected, words=expected_text),
                previous=quote_list(criterion.words[found_count - 1], "or") if found_count else "",
                actual=quote_text(next_word),
                expected=quote_list(criterion.words[found_count], "or"),
                found=found_count,
                count=count,
            ),
            reference_line.t,
            get_pose_at(recording, reference_line.t),
            Fraction(found_count, count),
            findings=(_build_other_word(criterion, timed_words, found_count, end),),
        )
    if end < len(timed_words) and not criterion.more:
        word, line = timed_words[end]
        return fail_with(
            Sentence(wording.extra, words=expected_text, extra=quote_text(word)),
            line.t,
            get_pose_at(recording, line.t),
            Fraction(count, count + len(timed_words) - end),
            findings=(ExtraText(word),),
        )
    hurried_line = _find_hurried_line(lines) if criterion.waits else None
    if hurried_line is not None:
        return fail_with(
            Sentence(
                "Expected the robot to wait until each word is spoken, but it said %(text)s while it was still "
                "speaking.",
                text=quote_text(hurried_line.text),
            ),
            hurried_line.t,
            get_pose_at(recording, hurried_line.t),
            Fraction(1, 2),
            findings=(HurriedSpeech(),),
        )
    measures = (Measure(Sentence("words"), float(count)), Measure(Sentence("last at"), reference_line.t, "s"))
    message = Sentence(wording.success, words=expected_text)
    return pass_with(message, reference_line.t, get_pose_at(recording, reference_line.t), measures)


def _build_other_word(
    criterion: WordSequence, timed_words: Sequence[tuple[str, TimedText]], found_count: int, end: int
) -> OtherWord:
    previous_words = criterion.words[found_count - 1] if found_count else ()
    actual_word = timed_words[end][0] if end < len(timed_words) else ""
    return OtherWord(previous_words, actual_word, criterion.words[found_count])


def _find_best_run(
    criterion: WordSequence, expected_words: Sequence[Sequence[list[str]]], words: list[str]
) -> tuple[int, int, int]:
    """Return the start of the best run, how many wanted words it has, and the place of the next word.

    Among runs with equally many words, the one with the last end wins. If words are missing, or with ``more``, the one
    with the longest text from start to end wins.
    """

    def rank_run(run: tuple[int, int, int]) -> tuple[int, int]:
        start, found_count, end = run
        return found_count, end - start if criterion.more or found_count < len(expected_words) else end

    starts = range(len(words)) if criterion.lead_in else range(1)
    runs = (
        (start, found, end)
        for start in starts
        for found, ends in [_measure_run(expected_words, words, start)]
        for end in ends
    )
    return max(runs, key=rank_run)


def _measure_run(expected_words: Sequence[Sequence[list[str]]], words: list[str], start: int) -> tuple[int, list[int]]:
    """Return how many wanted words follow without a gap from ``start``, and the possible places of the next word."""
    places = [start]
    for count, alternatives in enumerate(expected_words):
        ends = {
            place + len(each) for place in places for each in alternatives if words[place : place + len(each)] == each
        }
        if not ends:
            return count, places
        places = sorted(ends)
    return len(expected_words), places


def _find_hurried_line(lines: Sequence[TimedText]) -> TimedText | None:
    """Return the first text that was said before the previous one had been spoken to its end, or None."""
    for speech_end, following in zip(compute_speech_ends(lines), lines[1:], strict=False):
        if following.t < speech_end - _SPEECH_ROUNDING:
            return following
    return None


def _format_words(criterion: WordSequence) -> str:
    return quote_text(" ".join(texts[0] for texts in criterion.words))
