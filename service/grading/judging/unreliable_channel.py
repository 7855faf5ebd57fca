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
from service.language import translatable
from sim.recording import Message, Recording, TimedText, Verdict
from sim.recording_values import get_pose_at
from sim.sentences import Sentence
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
    if len(questions) < criterion.at_least:
        expected = Sentence(
            "Expected the robot to send at least %(count)s of %(messages)s",
            count=criterion.at_least,
            messages=_describe_messages(criterion),
        )
        return fail_with(_describe_few_questions(expected, questions))
    mistakes = [(each, found) for each in questions if (found := _find_mistake(criterion, each, recording))]
    tries = sum(len(each.tries) for each in questions)
    measures = (Measure(Sentence("different messages"), len(questions)), Measure(Sentence("tries"), tries))
    count = len(questions)
    if not mistakes:
        template = (
            translatable(
                "The robot sent %(tries)s messages, %(resent)s of them again, until each of %(count)s was answered or "
                "the robot gave up."
            )
            if tries > count
            else translatable(
                "The robot sent %(tries)s messages, until each of %(count)s was answered or the robot gave up."
            )
        )
        message = Sentence(template, tries=tries, resent=tries - count, count=count)
        last_time = max(message.t for each in questions for message in each.tries)
        return pass_with(message, last_time, get_pose_at(recording, last_time), measures)
    question, (t, mistake, findings) = mistakes[0]
    right_count = count - len(mistakes)
    return fail_with(
        Sentence(
            "%(expected)s, but %(mistake)s (%(right)s of %(count)s messages right).",
            expected=_describe_expected_resends(criterion, question),
            mistake=mistake,
            right=right_count,
            count=count,
        ),
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
    measures = (
        Measure(Sentence("sent in reach"), reach_count),
        Measure(Sentence("sent out of reach"), len(unreachable_messages)),
    )
    summary = Sentence("%(reach)s of %(count)s sent in reach", reach=reach_count, count=len(sent_messages))
    if len(unreachable_messages) > criterion.misses:
        first_message = unreachable_messages[0]
        template = (
            translatable(
                "Expected the robot to send all but %(misses)s of %(messages)s in reach of the receiver, but the "
                "channel lost %(text)s: %(loss)s (%(summary)s)."
            )
            if criterion.misses
            else translatable(
                "Expected the robot to send all of %(messages)s in reach of the receiver, but the channel lost "
                "%(text)s: %(loss)s (%(summary)s)."
            )
        )
        return fail_with(
            Sentence(
                template,
                misses=criterion.misses,
                messages=_describe_messages(criterion),
                text=quote_text(first_message.text),
                loss=describe_loss(first_message),
                summary=summary,
            ),
            first_message.t,
            get_pose_at(recording, first_message.t),
            Fraction(reach_count, len(sent_messages)),
            measures,
        )
    if reach_count < criterion.at_least:
        expected = Sentence(
            "Expected the robot to send at least %(count)s of %(messages)s in reach of the receiver",
            count=criterion.at_least,
            messages=_describe_messages(criterion),
        )
        actual = Sentence("it sent %(count)s", count=reach_count) if reach_count else Sentence("it sent none")
        return fail_with(
            Sentence("%(expected)s, but %(actual)s.", expected=expected, actual=actual),
            score=Fraction(reach_count, criterion.at_least),
            measures=measures,
        )
    last_message = sent_messages[-1]
    message = Sentence("The robot was in reach: %(summary)s.", summary=summary)
    return pass_with(message, last_message.t, get_pose_at(recording, last_message.t), measures)


@declare_judge(FreshAnswers)
def judge_fresh_answers(criterion: FreshAnswers, trial: TrialResult) -> Outcome:
    """Judge each report against the answers to the text sent last before it, and against all other answers."""
    recording = trial.recording
    questions = _collect_questions(recording)
    expected = Sentence("Expected the robot to report only answers to the message that it sent last")
    if len(questions) < criterion.at_least:
        return fail_with(_describe_few_questions(expected, questions))
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

    def fail_at(time: float, problem: str) -> Outcome:
        message = Sentence(
            "%(expected)s, but %(problem)s (%(right)s of %(count)s answers right).",
            expected=expected,
            problem=problem,
            right=right_count,
            count=judged_count,
        )
        return fail_with(message, time, get_pose_at(recording, time), Fraction(right_count, judged_count))

    if stale_reports:
        last_question, (line, stale_text) = next(iter(stale_reports.items()))
        problem = Sentence(
            "after %(question)s it reported %(report)s, which is the answer to %(other)s",
            question=quote_text(last_question),
            report=quote_text(line.text),
            other=quote_text(stale_text),
        )
        return fail_at(line.t, problem)
    missing_question = next((each for text, each in expected_questions.items() if text not in fresh_texts), None)
    if missing_question is not None:
        if missing_question.answered_at is None:
            return fail_at(missing_question.tries[-1].t, _describe_missing_answer(missing_question))
        problem = Sentence(
            "the answer to %(text)s came at %(seconds).2f s and no line that begins with %(start)s has it",
            text=quote_text(missing_question.text),
            seconds=missing_question.answered_at,
            start=quote_text(criterion.after),
        )
        return fail_at(missing_question.answered_at, problem)
    if not judged_count:
        return pass_with(
            Sentence("The channel lost every message or its answer by chance, and the robot reported no wrong answer.")
        )
    return pass_with(
        Sentence(
            "%(right)s of %(count)s answers were reported, each for the message sent last.",
            right=right_count,
            count=judged_count,
        )
    )


def _describe_missing_answer(question: _Question) -> str:
    """Return a clause that no answer came, with the reason if it was not a random loss."""
    problem = Sentence("no answer to %(text)s came", text=quote_text(question.text))
    lost_message = next(filter(is_out_of_reach, (*question.tries, *question.replies)), None)
    if lost_message is None:
        return problem
    return Sentence(
        "%(problem)s: the channel lost %(text)s (%(loss)s)",
        problem=problem,
        text=quote_text(lost_message.text),
        loss=describe_loss(lost_message),
    )


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
            description = Sentence(
                "it sent the message again at %(time).2f s, after its answer had come at %(answer).2f s",
                time=t,
                answer=answer_time,
            )
            return t, description, (LateResend(),)
        if criterion.at_most is not None and number > criterion.at_most:
            return t, Sentence("it sent the message %(count)s times", count=len(times)), ()
        if next_time is not None and next_time - t < minimum - _ROUNDING:
            description = Sentence(
                "it did not wait for the answer: it sent the message at %(time).2f s and again at %(next).2f s",
                time=t,
                next=next_time,
            )
            return next_time, description, ()
        if next_time is not None and next_time - t > maximum + _ROUNDING:
            description = Sentence(
                "it sent the message at %(time).2f s and again only at %(next).2f s", time=t, next=next_time
            )
            return t, description, ()
        is_last_try = next_time is None and (criterion.at_most is None or number < criterion.at_most)
        if is_last_try and answer_time is None and _has_stopped_trying(t, maximum, recording):
            description = Sentence(
                "it sent the message %(times)s, last at %(time).2f s, and no answer came",
                times=_format_times(number),
                time=t,
            )
            return t, description, (MissingAnswer(),)
        if is_last_try and answer_time is not None and end_time - t > maximum + _ROUNDING:
            description = Sentence(
                "it sent the message %(times)s, and its answer came only at %(time).2f s",
                times=_format_times(number),
                time=end_time,
            )
            return t, description, ()
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
    return Sentence("the messages: %(conditions)s", conditions=conditions) if conditions else Sentence("its messages")


def _describe_few_questions(expected: str, questions: Sequence[_Question]) -> str:
    if not questions:
        return Sentence("%(expected)s, but it sent nothing.", expected=expected)
    return Sentence("%(expected)s, but it sent only %(count)s different.", expected=expected, count=len(questions))


def _describe_expected_resends(criterion: Resends, question: _Question) -> str:
    template = (
        translatable("Expected the robot to send %(text)s again until its answer comes")
        if criterion.at_most is None
        else translatable(
            "Expected the robot to send %(text)s again until its answer comes, at most %(count)s times in all"
        )
    )
    return Sentence(template, text=quote_text(question.text), count=criterion.at_most)


def _format_times(number: int) -> str:
    return Sentence("once") if number == 1 else Sentence("%(count)s times", count=number)
