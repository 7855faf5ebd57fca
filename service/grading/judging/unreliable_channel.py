"""Judging of a program on a lossy channel: its resends, where it sends from, and which answers it uses.

Random losses are never held against it. Messages sent from out of reach are.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from service.grading.findings import Finding, LateResend, MissingAnswer
from service.grading.grade import Measure, TrialResult
from service.grading.judging.answers import MISSING, as_text, find_at_path, parse_json_answer
from service.grading.judging.channel_losses import describe_loss, is_lost_by_chance, is_out_of_reach
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.message_parts import quote_text
from service.grading.judging.outcome import Outcome, fail_with, find_ending_fault, pass_with
from service.grading.judging.text_conditions import describe_conditions, is_accepted_text
from service.grading.judging.text_tokens import split_words
from sim.recording import Message, Recording, TimedText, Verdict
from sim.recording_values import get_pose_at
from submissions.criteria.texts import TextConditions
from submissions.criteria.unreliable_channel import FreshAnswers, InReach, Resends

#: Programs check, wait and print with a resolution of 10 ms.
_ROUNDING = 0.011
_MAX_WORDS = 50  # of an answer, for comparisons


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
        received_count = sum(message.delivered is not None and message.arrived_as is None for message in self.tries)
        is_lost = all(map(is_lost_by_chance, self.replies)) and len(self.replies) >= received_count
        return not self.answers and is_lost and not any(map(is_out_of_reach, self.tries))


@declare_judge(Resends)
def judge_resends(criterion: Resends, trial: TrialResult) -> Outcome:
    """Judge how each different text was sent again."""
    recording = trial.recording
    questions = [each for each in _collect_questions(recording) if is_accepted_text(criterion, each.text)]
    message_kind = _describe_messages(criterion)
    if len(questions) < criterion.at_least:
        return fail_with(
            f"Expected the robot to send at least {criterion.at_least} of {message_kind}, but it "
            f"{_describe_few_questions(questions)}."
        )
    mistakes = [(each, found) for each in questions if (found := _find_mistake(criterion, each, recording))]
    tries = sum(len(each.tries) for each in questions)
    measures = (Measure("different messages", len(questions)), Measure("tries", tries))
    count = len(questions)
    if not mistakes:
        resend_clause = f", {tries - count} of them again" if tries > count else ""
        last_time = max(message.t for each in questions for message in each.tries)
        return pass_with(
            f"The robot sent {tries} messages{resend_clause}, until each of {count} was answered or the robot gave up.",
            last_time,
            get_pose_at(recording, last_time),
            measures,
        )
    question, (t, mistake, findings) = mistakes[0]
    right_count = count - len(mistakes)
    return fail_with(
        f"Expected the robot to send {quote_text(question.text)} again until its answer "
        f"comes{_describe_bounds(criterion)}, but {mistake} ({right_count} of {count} messages right).",
        t,
        get_pose_at(recording, t),
        Fraction(right_count, count),
        measures,
        findings=findings,
    )


@declare_judge(InReach)
def judge_in_reach(criterion: InReach, trial: TrialResult) -> Outcome:
    """Judge the robot's position at each message."""
    recording = trial.recording
    sent_messages = [
        each for each in recording.messages if each.sender == "robot" and is_accepted_text(criterion, each.text)
    ]
    unreachable_messages = [message for message in sent_messages if is_out_of_reach(message)]
    reach_count = len(sent_messages) - len(unreachable_messages)
    measures = (Measure("sent in reach", reach_count), Measure("sent out of reach", len(unreachable_messages)))
    summary = f"{reach_count} of {len(sent_messages)} sent in reach"
    if len(unreachable_messages) > criterion.misses:
        first_message = unreachable_messages[0]
        exception_clause = f" but {criterion.misses}" if criterion.misses else ""
        return fail_with(
            f"Expected the robot to send all{exception_clause} of {_describe_messages(criterion)} in reach of the "
            "receiver, "
            f"but the channel lost {quote_text(first_message.text)}: {describe_loss(first_message)} ({summary}).",
            first_message.t,
            get_pose_at(recording, first_message.t),
            Fraction(reach_count, len(sent_messages)),
            measures,
        )
    if reach_count < criterion.at_least:
        return fail_with(
            f"Expected the robot to send at least {criterion.at_least} of {_describe_messages(criterion)} in reach of "
            f"the receiver, but it sent {reach_count or 'none'}.",
            score=Fraction(reach_count, criterion.at_least),
            measures=measures,
        )
    last_message = sent_messages[-1]
    return pass_with(
        f"The robot was in reach: {summary}.", last_message.t, get_pose_at(recording, last_message.t), measures
    )


@declare_judge(FreshAnswers)
def judge_fresh_answers(criterion: FreshAnswers, trial: TrialResult) -> Outcome:
    """Judge each report against the answers to the text sent last before it, and against all other answers."""
    recording = trial.recording
    questions = _collect_questions(recording)
    expected = "Expected the robot to report only answers to the message that it sent last"
    if len(questions) < criterion.at_least:
        return fail_with(f"{expected}, but it {_describe_few_questions(questions)}.")
    answers = _AnswerTimes(criterion, questions)
    fresh_texts: set[str] = set()
    stale_reports: dict[str, tuple[TimedText, str]] = {}
    for line in _collect_reports(criterion, recording):
        last_question = answers.find_last_sent(line.t)
        for text in answers.list_named_texts(line, last_question):
            if text == last_question:
                fresh_texts.add(text)
            else:
                stale_reports.setdefault(last_question, (line, text))
    expected_questions = {each.text: each for each in questions if not each.excused}
    right_count = len(fresh_texts - stale_reports.keys())
    judged_count = len(expected_questions.keys() | fresh_texts | stale_reports.keys())
    summary = f"({right_count} of {judged_count} answers right)"
    if stale_reports:
        last_question, (line, stale_text) = next(iter(stale_reports.items()))
        return fail_with(
            f"{expected}, but after {quote_text(last_question)} it reported {quote_text(line.text)}, which is the "
            f"answer to {quote_text(stale_text)} {summary}.",
            line.t,
            get_pose_at(recording, line.t),
            Fraction(right_count, judged_count),
        )
    missing_question = next((each for text, each in expected_questions.items() if text not in fresh_texts), None)
    if missing_question is not None:
        time = missing_question.tries[-1].t if missing_question.answered_at is None else missing_question.answered_at
        problem = (
            _describe_missing_answer(missing_question)
            if missing_question.answered_at is None
            else (
                f"the answer to {quote_text(missing_question.text)} came at {time:.2f} s and no line that begins with "
                f"{quote_text(criterion.after)} has it"
            )
        )
        return fail_with(
            f"{expected}, but {problem} {summary}.",
            time,
            get_pose_at(recording, time),
            Fraction(right_count, judged_count),
        )
    if not judged_count:
        return pass_with(
            "The channel lost every message or its answer by chance, and the robot reported no wrong answer."
        )
    return pass_with(f"{right_count} of {judged_count} answers were reported, each for the message sent last.")


def _describe_missing_answer(question: _Question) -> str:
    """Return a sentence that no answer came, with the reason if it was not a random loss."""
    lost_message = next(filter(is_out_of_reach, (*question.tries, *question.replies)), None)
    reason = (
        f": the channel lost {quote_text(lost_message.text)} ({describe_loss(lost_message)})" if lost_message else ""
    )
    return f"no answer to {quote_text(question.text)} came{reason}"


class _AnswerTimes:
    """The arrival times of answers, indexed by their words, because a run may contain thousands of them."""

    def __init__(self, criterion: FreshAnswers, questions: Sequence[_Question]) -> None:
        sent_texts = sorted((message.t, each.text) for each in questions for message in each.tries)
        self._times, self._texts = [t for t, _ in sent_texts], [text for _, text in sent_texts]
        #: For the words of an answer: the texts that had this answer, with the first time of each, the earliest first.
        self._by_words: dict[tuple[str, ...], dict[str, float]] = {}
        arrivals = ((message.delivered or 0.0, each.text, message) for each in questions for message in each.answers)
        for t, text, message in sorted(arrivals, key=lambda each: each[0]):
            words = tuple(split_words(_extract_value(criterion, message))[:_MAX_WORDS])
            if words:
                self._by_words.setdefault(words, {}).setdefault(text, t)
        self._lengths = sorted({len(words) for words in self._by_words})

    def find_last_sent(self, t: float) -> str:
        """Return the last text sent before the time; empty if there is none."""
        index = bisect_left(self._times, t - 1e-9)
        return self._texts[index - 1] if index else ""

    def list_named_texts(self, line: TimedText, last_question: str) -> Iterator[str]:
        """Yield the text that each answer in the line replies to; ``last_question`` if the answer fits it.

        Only answers that had arrived by the time of the line count.
        """
        words = split_words(line.text)
        for length in self._lengths:
            for index in range(len(words) - length + 1):
                answers = self._by_words.get(tuple(words[index : index + length]), {})
                if answers.get(last_question, math.inf) <= line.t:
                    yield last_question
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
            question = recording.messages[message.reply_to]
            # An answer to a corrupted text is not an answer to the text that was sent.
            if question.arrived_as is None:
                replies.setdefault(question.text, []).append(message)
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


def _find_mistake(
    criterion: Resends, question: _Question, recording: Recording
) -> tuple[float, str, tuple[Finding, ...]] | None:
    """Return the time, description and findings of the first wrong resend of a text; None if all are right."""
    minimum, maximum = criterion.every
    answer_time = question.answered_at
    end_time = recording.end_t if answer_time is None else answer_time
    times = [message.t for message in question.tries]
    for number, (t, next_time) in enumerate(zip(times, [*times[1:], None], strict=True), 1):
        if answer_time is not None and t > answer_time + 1e-9:
            description = f"it sent the message again at {t:.2f} s, after its answer had come at {answer_time:.2f} s"
            return t, description, (LateResend(),)
        if criterion.at_most is not None and number > criterion.at_most:
            return t, f"it sent the message {len(times)} times", ()
        if next_time is not None and next_time - t < minimum - _ROUNDING:
            return (
                next_time,
                f"it did not wait for the answer: it sent the message at {t:.2f} s and again at {next_time:.2f} s",
                (),
            )
        if next_time is not None and next_time - t > maximum + _ROUNDING:
            return t, f"it sent the message at {t:.2f} s and again only at {next_time:.2f} s", ()
        is_last_try = next_time is None and (criterion.at_most is None or number < criterion.at_most)
        if is_last_try and answer_time is None and _has_stopped_trying(t, maximum, recording):
            description = f"it sent the message {_format_times(number)}, last at {t:.2f} s, and no answer came"
            return t, description, (MissingAnswer(),)
        if is_last_try and answer_time is not None and end_time - t > maximum + _ROUNDING:
            return t, f"it sent the message {_format_times(number)}, and its answer came only at {end_time:.2f} s", ()
    return None


def _has_stopped_trying(last_time: float, max_wait: float, recording: Recording) -> bool:
    """Return whether the program ended, or continued past its longest wait, after its last try."""
    fault = find_ending_fault(recording)
    has_timed_out = fault is not None and fault.verdict is Verdict.TIME_LIMIT
    return not has_timed_out or recording.end_t - last_time > max_wait + _ROUNDING


def _collect_reports(criterion: FreshAnswers, recording: Recording) -> Iterator[TimedText]:
    """Yield the text after ``after`` in the lines that begin with it, in order of time."""
    printed_lines = recording.printed if criterion.source != "speech" else ()
    spoken_lines = recording.spoken if criterion.source != "print" else ()
    prefix = criterion.after.strip()
    for line in sorted((*printed_lines, *spoken_lines), key=lambda each: each.t):
        if line.text.strip().startswith(prefix):
            yield TimedText(line.t, line.text.strip().removeprefix(prefix))


def _extract_value(criterion: FreshAnswers, answer: Message) -> str:
    """Return the part of an answer that a report must contain; empty if the answer does not have it."""
    if criterion.path is None:
        return answer.text
    value = find_at_path(parse_json_answer(answer.text), criterion.path)
    return "" if value is MISSING else as_text(value)


def _describe_messages(criterion: TextConditions) -> str:
    conditions = describe_conditions(criterion)
    return f"the messages: {conditions}" if conditions else "its messages"


def _describe_few_questions(questions: Sequence[_Question]) -> str:
    return f"sent only {len(questions)} different" if questions else "sent nothing"


def _describe_bounds(criterion: Resends) -> str:
    return f", at most {criterion.at_most} times in all" if criterion.at_most is not None else ""


def _format_times(number: int) -> str:
    return "once" if number == 1 else f"{number} times"
