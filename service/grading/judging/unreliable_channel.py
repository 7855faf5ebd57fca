"""Judging of a program on a lossy channel: its resends, where it sends from, and which answers it uses.

Random losses are never held against it. Messages sent from out of reach are.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from service.grading.grade import Measure, TrialResult
from service.grading.judging.answers import MISSING, as_text, find_at_path, parse_json_answer
from service.grading.judging.channel_losses import describe_loss, is_lost_by_chance, is_out_of_reach
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.message_parts import quote_text
from service.grading.judging.outcome import Outcome, fail_with, find_ending_fault, pass_with
from service.grading.judging.text_tokens import split_words
from service.grading.judging.texts import describe_conditions, is_accepted_text
from sim.recording import Message, Recording, TimedText, Verdict
from sim.recording_values import get_pose_at
from submissions.criteria.texts import TextConditions
from submissions.criteria.unreliable_channel import FreshAnswers, InReach, Resends

#: Programs check, wait and print with a resolution of 10 ms.
_ROUNDING = 0.011
_MOST_WORDS = 50  # of an answer, for comparisons


@dataclass(frozen=True, slots=True)
class _Question:
    """A text that the robot sent: its tries, all answers to it, and the answers that arrived unchanged."""

    text: str
    tries: tuple[Message, ...]
    replies: tuple[Message, ...]
    answers: tuple[Message, ...]

    @property
    def answered_at(self) -> float | None:
        """The time at which its first answer arrived, in seconds."""
        return min((message.delivered or 0.0 for message in self.answers), default=None)

    @property
    def excused(self) -> bool:
        """Return whether only random losses prevented an answer."""
        heard = sum(message.delivered is not None and message.arrived_as is None for message in self.tries)
        lost = all(map(is_lost_by_chance, self.replies)) and len(self.replies) >= heard
        return not self.answers and lost and not any(map(is_out_of_reach, self.tries))


@declare_judge(Resends)
def judge_resends(criterion: Resends, trial: TrialResult) -> Outcome:
    """Judge how each different text was sent again."""
    recording = trial.recording
    questions = [each for each in _collect_questions(recording) if is_accepted_text(criterion, each.text)]
    what = _describe_messages(criterion)
    if len(questions) < criterion.at_least:
        return fail_with(
            f"Expected the robot to send at least {criterion.at_least} of {what}, but it "
            f"{_describe_few_questions(questions)}."
        )
    mistakes = [(each, found) for each in questions if (found := _find_mistake(criterion, each, recording))]
    tries = sum(len(each.tries) for each in questions)
    measures = (Measure("different messages", len(questions)), Measure("tries", tries))
    count = len(questions)
    if not mistakes:
        again = f", {tries - count} of them again" if tries > count else ""
        last = max(message.t for each in questions for message in each.tries)
        return pass_with(
            f"The robot sent {tries} messages{again}, until each of {count} was answered or the robot gave up.",
            last,
            get_pose_at(recording, last),
            measures,
        )
    question, (t, mistake) = mistakes[0]
    right = count - len(mistakes)
    return fail_with(
        f"Expected the robot to send {quote_text(question.text)} again until its answer "
        f"comes{_describe_bounds(criterion)}, "
        f"but {mistake} ({right} of {count} messages right).",
        t,
        get_pose_at(recording, t),
        Fraction(right, count),
        measures,
    )


@declare_judge(InReach)
def judge_in_reach(criterion: InReach, trial: TrialResult) -> Outcome:
    """Judge the robot's position at each message."""
    recording = trial.recording
    sent = [each for each in recording.messages if each.sender == "robot" and is_accepted_text(criterion, each.text)]
    astray = [message for message in sent if is_out_of_reach(message)]
    near = len(sent) - len(astray)
    measures = (Measure("sent in reach", near), Measure("sent out of reach", len(astray)))
    told = f"{near} of {len(sent)} sent in reach"
    if len(astray) > criterion.misses:
        first = astray[0]
        leeway = f" but {criterion.misses}" if criterion.misses else ""
        return fail_with(
            f"Expected the robot to send all{leeway} of {_describe_messages(criterion)} in reach of the receiver, "
            f"but the channel lost {quote_text(first.text)}: {describe_loss(first)} ({told}).",
            first.t,
            get_pose_at(recording, first.t),
            Fraction(near, len(sent)),
            measures,
        )
    if near < criterion.at_least:
        return fail_with(
            f"Expected the robot to send at least {criterion.at_least} of {_describe_messages(criterion)} in "
            "reach of the receiver, "
            f"but it sent {near or 'none'}.",
            score=Fraction(near, criterion.at_least),
            measures=measures,
        )
    last = sent[-1]
    return pass_with(f"The robot was in reach: {told}.", last.t, get_pose_at(recording, last.t), measures)


@declare_judge(FreshAnswers)
def judge_fresh_answers(criterion: FreshAnswers, trial: TrialResult) -> Outcome:
    """Judge each report against the answers to the text sent last before it, and against all other answers."""
    recording = trial.recording
    questions = _collect_questions(recording)
    expected = "Expected the robot to report only answers to the message that it sent last"
    if len(questions) < criterion.at_least:
        return fail_with(f"{expected}, but it {_describe_few_questions(questions)}.")
    answers = _AnswerTimes(criterion, questions)
    fresh: set[str] = set()
    stale: dict[str, tuple[TimedText, str]] = {}
    for line in _collect_reports(criterion, recording):
        asked = answers.find_last_sent(line.t)
        for text in answers.list_named_texts(line, asked):
            if text == asked:
                fresh.add(text)
            else:
                stale.setdefault(asked, (line, text))
    wanted = {each.text: each for each in questions if not each.excused}
    right = len(fresh - stale.keys())
    judged = len(wanted.keys() | fresh | stale.keys())
    told = f"({right} of {judged} answers right)"
    if stale:
        asked, (line, earlier) = next(iter(stale.items()))
        return fail_with(
            f"{expected}, but after {quote_text(asked)} it reported {quote_text(line.text)}, which is the answer to "
            f"{quote_text(earlier)} {told}.",
            line.t,
            get_pose_at(recording, line.t),
            Fraction(right, judged),
        )
    missing = next((each for text, each in wanted.items() if text not in fresh), None)
    if missing is not None:
        at = missing.tries[-1].t if missing.answered_at is None else missing.answered_at
        what = (
            _describe_missing_answer(missing)
            if missing.answered_at is None
            else (
                f"the answer to {quote_text(missing.text)} came at {at:.2f} s and no line that begins with "
                f"{quote_text(criterion.after)} has it"
            )
        )
        return fail_with(f"{expected}, but {what} {told}.", at, get_pose_at(recording, at), Fraction(right, judged))
    if not judged:
        return pass_with(
            "The channel lost every message or its answer by chance, and the robot reported no wrong answer."
        )
    return pass_with(f"{right} of {judged} answers were reported, each for the message sent last.")


def _describe_missing_answer(question: _Question) -> str:
    """Return a sentence that no answer came, with the reason if it was not a random loss."""
    astray = next(filter(is_out_of_reach, (*question.tries, *question.replies)), None)
    why = f": the channel lost {quote_text(astray.text)} ({describe_loss(astray)})" if astray else ""
    return f"no answer to {quote_text(question.text)} came{why}"


class _AnswerTimes:
    """The arrival times of answers, indexed by their words, because a run may contain thousands of them."""

    def __init__(self, criterion: FreshAnswers, questions: Sequence[_Question]) -> None:
        sent = sorted((message.t, each.text) for each in questions for message in each.tries)
        self._times, self._texts = [t for t, _ in sent], [text for _, text in sent]
        #: For the words of an answer: the texts that had this answer, with the first time of each, the earliest first.
        self._by_words: dict[tuple[str, ...], dict[str, float]] = {}
        came = ((message.delivered or 0.0, each.text, message) for each in questions for message in each.answers)
        for t, text, message in sorted(came, key=lambda each: each[0]):
            words = tuple(split_words(_extract_value(criterion, message))[:_MOST_WORDS])
            if words:
                self._by_words.setdefault(words, {}).setdefault(text, t)
        self._lengths = sorted({len(words) for words in self._by_words})

    def find_last_sent(self, t: float) -> str:
        """Return the last text sent before the time; empty if there is none."""
        place = bisect_left(self._times, t - 1e-9)
        return self._texts[place - 1] if place else ""

    def list_named_texts(self, line: TimedText, asked: str) -> Iterator[str]:
        """Yield the text that each answer in the line replies to; ``asked`` if the answer fits it.

        Only answers that had arrived by the time of the line count.
        """
        words = split_words(line.text)
        for length in self._lengths:
            for place in range(len(words) - length + 1):
                answers = self._by_words.get(tuple(words[place : place + length]), {})
                if answers.get(asked, math.inf) <= line.t:
                    yield asked
                elif answers and next(iter(answers.values())) <= line.t:
                    yield next(iter(answers))


def _collect_questions(recording: Recording) -> list[_Question]:
    """Return the different texts that the robot sent, in order of first sending."""
    tries: dict[str, list[Message]] = {}
    replies: dict[str, list[Message]] = {}
    for message in recording.messages:
        if message.sender == "robot":
            tries.setdefault(message.text, []).append(message)
        elif message.reply_to is not None:
            asked = recording.messages[message.reply_to]
            # An answer to a corrupted text is not an answer to the text that was sent.
            if asked.arrived_as is None:
                replies.setdefault(asked.text, []).append(message)
    return [
        _Question(
            text,
            tuple(sent),
            tuple(replies.get(text, ())),
            tuple(reply for reply in replies.get(text, ()) if _is_intact(reply)),
        )
        for text, sent in tries.items()
    ]


def _is_intact(reply: Message) -> bool:
    return reply.delivered is not None and reply.arrived_as is None and reply.note != "malformed"


def _find_mistake(criterion: Resends, question: _Question, recording: Recording) -> tuple[float, str] | None:
    """Return the time and description of the first wrong resend of a text; None if all are right."""
    least, most = criterion.every
    answered = question.answered_at
    until = recording.end_t if answered is None else answered
    times = [message.t for message in question.tries]
    for number, (t, following) in enumerate(zip(times, [*times[1:], None], strict=True), 1):
        if answered is not None and t > answered + 1e-9:
            return t, f"it sent the message again at {t:.2f} s, after its answer had come at {answered:.2f} s"
        if criterion.at_most is not None and number > criterion.at_most:
            return t, f"it sent the message {len(times)} times"
        if following is not None and following - t < least - _ROUNDING:
            return (
                following,
                f"it did not wait for the answer: it sent the message at {t:.2f} s and again at {following:.2f} s",
            )
        if following is not None and following - t > most + _ROUNDING:
            return t, f"it sent the message at {t:.2f} s and again only at {following:.2f} s"
        gave_up = following is None and (criterion.at_most is None or number < criterion.at_most)
        if gave_up and answered is None and _has_stopped_trying(t, most, recording):
            return t, f"it sent the message {_format_times(number)}, last at {t:.2f} s, and no answer came"
        if gave_up and answered is not None and until - t > most + _ROUNDING:
            return t, f"it sent the message {_format_times(number)}, and its answer came only at {until:.2f} s"
    return None


def _has_stopped_trying(last: float, most: float, recording: Recording) -> bool:
    """Return whether the program ended, or continued past its longest wait, after its last try."""
    fault = find_ending_fault(recording)
    timed_out = fault is not None and fault.verdict is Verdict.TIME_LIMIT
    return not timed_out or recording.end_t - last > most + _ROUNDING


def _collect_reports(criterion: FreshAnswers, recording: Recording) -> Iterator[TimedText]:
    """Yield the text after ``after`` in the lines that begin with it, in order of time."""
    printed = recording.printed if criterion.source != "speech" else ()
    spoken = recording.spoken if criterion.source != "print" else ()
    begin = criterion.after.strip()
    for line in sorted((*printed, *spoken), key=lambda each: each.t):
        if line.text.strip().startswith(begin):
            yield TimedText(line.t, line.text.strip().removeprefix(begin))


def _extract_value(criterion: FreshAnswers, answer: Message) -> str:
    """Return the part of an answer that a report must contain; empty if the answer does not have it."""
    if criterion.path is None:
        return answer.text
    found = find_at_path(parse_json_answer(answer.text), criterion.path)
    return "" if found is MISSING else as_text(found)


def _describe_messages(criterion: TextConditions) -> str:
    asked = describe_conditions(criterion)
    return f"the messages: {asked}" if asked else "its messages"


def _describe_few_questions(questions: Sequence[_Question]) -> str:
    return f"sent only {len(questions)} different" if questions else "sent nothing"


def _describe_bounds(criterion: Resends) -> str:
    return f", at most {criterion.at_most} times in all" if criterion.at_most is not None else ""


def _format_times(number: int) -> str:
    return "once" if number == 1 else f"{number} times"
