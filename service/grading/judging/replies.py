"""Judging of the responder's answers: to given texts, or to every message that reached it.

An answer counts even if it arrived after the program ended. The robot's use of it is judged elsewhere.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from fractions import Fraction

from responders.message_format import JSON
from service.grading.findings import OtherAnswer
from service.grading.grade import TrialResult
from service.grading.judging.agent_pairs import VALUE, AgentPair, build_pair
from service.grading.judging.answers import (
    MISSING,
    Answers,
    as_text,
    find_at_path,
    is_json_answer,
    is_same_value,
    parse_json_answer,
)
from service.grading.judging.channel_losses import describe_loss, is_lost_by_chance, is_out_of_reach
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.message_parts import quote_list, quote_text
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from service.grading.judging.text_conditions import describe_conditions, is_accepted_text, is_same_text
from sim.recording import Message
from sim.recording_values import get_pose_at
from submissions.criteria.replies import Replies, list_allowed_answers

#: Messages that were sent instead are quoted up to this number and length.
_MAX_QUOTED_MESSAGES, _MAX_QUOTED_LENGTH = 3, 60

_NOTHING_TO_ANSWER = "The channel lost every message on its way by chance, so there was nothing to answer."


@declare_judge(Replies)
def judge_replies(criterion: Replies, trial: TrialResult) -> Outcome:
    """Judge the answer to each expected text, or to each different question that arrived."""
    pair = build_pair(criterion, trial.recording)
    recording = pair.recording
    sent_messages = [message for message in recording.messages if message.sender == "robot"]
    received_messages = [
        (index, message)
        for index, message in enumerate(recording.messages)
        if message.sender == "robot" and message.delivered is not None
    ]
    if criterion.expect:
        return _judge_expected(criterion, received_messages, sent_messages, pair)
    if criterion.in_order:
        return _judge_order(criterion, received_messages, pair)
    # A repeated message asks nothing new.
    questions: dict[str, list[tuple[int, Message]]] = {}
    for index, message in received_messages:
        if _is_question(criterion, message.received):
            questions.setdefault(message.received, []).append((index, message))
    count = len(questions)
    unreceived_messages = [
        each for each in sent_messages if each.text not in questions and _is_question(criterion, each.text)
    ]
    excused_count = len({message.text for message in unreceived_messages if is_lost_by_chance(message)})
    if count + excused_count < criterion.at_least:
        count_clause = f"only {count} different reached it" if count else "none reached it"
        unreachable_message = next((message for message in unreceived_messages if is_out_of_reach(message)), None)
        reason = (
            f": the channel lost {quote_text(unreachable_message.text)} ({describe_loss(unreachable_message)})"
            if unreachable_message
            else ""
        )
        requirement = f"at least {criterion.at_least} of {_describe_messages(criterion, pair)}"
        return fail_with(
            f"Expected {pair.receiver_name} to be sent {requirement}, but {count_clause}{reason}.", score=Fraction(0)
        )
    if excused_count and not count:
        return pass_with(_NOTHING_TO_ANSWER)
    answers = Answers(recording)
    wrong_answers: list[tuple[Message, str, int]] = []
    for attempts in questions.values():
        mistakes = ((message, _describe_mistake(criterion, answers, index), index) for index, message in attempts)
        wrong_answers += itertools.islice((each for each in mistakes if each[1]), 1)
    if not wrong_answers:
        return pass_with(f"{pair.receiver_name.capitalize()} answered {count} of {count} messages as expected.")
    message, mistake, index = min(wrong_answers, key=lambda each: each[0].t)
    right_count = count - len(wrong_answers)
    return fail_with(
        f"Expected {pair.receiver_name} to answer {quote_text(message.received)} with "
        f"{_describe_expected(criterion)}, but {mistake} ({right_count} of {count} answered as expected).",
        message.t,
        get_pose_at(recording, message.t),
        Fraction(right_count, count),
        findings=_find_value(criterion, answers, index),
    )


def _judge_expected(
    criterion: Replies, received_messages: list[tuple[int, Message]], sent_messages: list[Message], pair: AgentPair
) -> Outcome:
    """Judge the expected texts, without those lost by chance, which the responder could not answer."""
    answers = Answers(pair.recording)
    right_count = count = 0
    first_failure: Outcome | None = None
    for text, answer in criterion.expect.items():
        matching_messages = [
            (index, each)
            for index, each in received_messages
            if is_same_text(each.received, text, criterion.ignore_case)
        ]
        allowed_answers = list_allowed_answers(answer)
        answer_texts = " or ".join(quote_text(as_text(each)) for each in allowed_answers)
        expected_answer = answer_texts + (f" at {criterion.path}" if criterion.path else "")
        if not matching_messages:
            tries = [message for message in sent_messages if is_same_text(message.text, text, criterion.ignore_case)]
            if tries and all(map(is_lost_by_chance, tries)):
                continue
            outcome = fail_with(
                f"Expected {pair.receiver_name} to be sent {quote_text(text)}, but "
                f"{_explain_unsent(tries, sent_messages)}."
            )
        else:
            mistakes = [
                _describe_wrong_answer(criterion, answers, index, allowed_answers) for index, _ in matching_messages
            ]
            wrong_index = next((i for i, mistake in enumerate(mistakes) if mistake), None)
            if wrong_index is None:
                right_count += 1
                count += 1
                continue
            index, message = matching_messages[wrong_index]
            outcome = fail_with(
                f"Expected {pair.receiver_name} to answer {quote_text(text)} with {expected_answer}, but "
                f"{mistakes[wrong_index]}.",
                message.t,
                get_pose_at(pair.recording, message.t),
                findings=_find_value(criterion, answers, index),
            )
        first_failure = first_failure or outcome
        count += 1
    if first_failure is None and not count:
        return pass_with(_NOTHING_TO_ANSWER)
    if first_failure is None:
        return pass_with(f"{pair.receiver_name.capitalize()} answered {count} of {count} messages as expected.")
    return fail_with(
        f"{first_failure.message[:-1]} ({right_count} of {count} right).",
        first_failure.t,
        first_failure.pose,
        Fraction(right_count, count),
        findings=first_failure.findings,
    )


def _judge_order(criterion: Replies, received_messages: list[tuple[int, Message]], pair: AgentPair) -> Outcome:
    """Judge the answers to all questions, in order, against the list."""
    answers = Answers(pair.recording)
    questions = [(index, each) for index, each in received_messages if _is_question(criterion, each.received)]
    wrong_answers = [
        (message, wanted, mistake)
        for (index, message), wanted in zip(questions, criterion.in_order, strict=False)
        if (mistake := _describe_mismatch(criterion, answers, index, wanted))
    ]
    count = len(criterion.in_order)
    right_count = max(0, min(count, len(questions)) - len(wrong_answers) - max(0, len(questions) - count))
    score = Fraction(right_count, count)
    if wrong_answers:
        message, expected_answer, mistake = wrong_answers[0]
        return fail_with(
            f"Expected {pair.receiver_name} to answer {quote_text(message.received)} with "
            f"{quote_text(expected_answer)}, but {mistake} ({right_count} of {count} right).",
            message.t,
            get_pose_at(pair.recording, message.t),
            score,
        )
    if len(questions) != count:
        count_clause = f"{len(questions)} reached it" if questions else "none reached it"
        return fail_with(f"Expected {pair.receiver_name} to answer {count} messages, but {count_clause}.", score=score)
    return pass_with(f"{pair.receiver_name.capitalize()} answered {count} of {count} messages as expected.")


def _explain_unsent(tries: Sequence[Message], sent_messages: Sequence[Message]) -> str:
    """Return why a text never reached the responder, and what was sent instead."""
    unreachable_message = next((message for message in tries if is_out_of_reach(message)), None)
    if unreachable_message:
        return f"the channel lost it ({describe_loss(unreachable_message)})"
    texts = tuple(dict.fromkeys(message.text for message in sent_messages if len(message.text) <= _MAX_QUOTED_LENGTH))
    return f"it was not; it was sent {quote_list(texts[:_MAX_QUOTED_MESSAGES])}" if texts else "it was not"


def _describe_wrong_answer(criterion: Replies, answers: Answers, index: int, allowed_answers: Sequence[object]) -> str:
    """Return the problem with the answer to the message at ``index``; empty if it is one of the correct ones."""
    mistakes = [_describe_mismatch(criterion, answers, index, each) for each in allowed_answers]
    return "" if "" in mistakes else mistakes[0] if mistakes else "no answer is correct"


def _describe_mismatch(criterion: Replies, answers: Answers, index: int, answer: object) -> str:
    """Return how the answer to the message at ``index`` differs from this one; empty if it does not."""
    reply = answers.find_answer(index)
    if reply is None:
        return answers.describe_silence(index)
    if criterion.is_json and not is_json_answer(reply.text):
        return f"it answered {quote_text(reply.text)}, which is not JSON:: and well-formed JSON"
    if criterion.agents:
        value = parse_json_answer(JSON + reply.text) if reply.note == VALUE else reply.text
        mistake = "it answered " + ("the text " if isinstance(value, str) else "") + quote_text(reply.text)
        return "" if is_same_value(value, answer) else mistake
    if criterion.path is None:
        is_same = is_same_text(reply.text, str(answer), criterion.ignore_case)
        return "" if is_same else f"it answered {quote_text(reply.text)}"
    actual = find_at_path(parse_json_answer(reply.text), criterion.path)
    if actual is MISSING:
        return f"there is nothing at {criterion.path} in its answer {quote_text(reply.text)}"
    if isinstance(actual, str) and isinstance(answer, str):
        is_same = is_same_text(actual, answer, criterion.ignore_case)
    else:
        is_same = is_same_value(actual, answer)
    return "" if is_same else f"it has {quote_text(as_text(actual))} at {criterion.path}"


def _describe_mistake(criterion: Replies, answers: Answers, index: int) -> str:
    """Return how the answer to the message at ``index`` violates the conditions; empty if it does not."""
    reply = answers.find_answer(index)
    if reply is None:
        return answers.describe_silence(index)
    if criterion.is_json and not is_json_answer(reply.text):
        return f"it answered {quote_text(reply.text)}, which is not JSON:: and well-formed JSON"
    text = reply.text
    if criterion.path is not None:
        actual = find_at_path(parse_json_answer(reply.text), criterion.path)
        if actual is MISSING:
            return f"there is nothing at {criterion.path} in its answer {quote_text(reply.text)}"
        if criterion.value is not None and not is_same_value(actual, criterion.value):
            return f"it has {quote_text(as_text(actual))} at {criterion.path}"
        text = as_text(actual)
    return "" if is_accepted_text(criterion, text) else f"it answered {quote_text(text)}"


def _find_value(criterion: Replies, answers: Answers, index: int) -> tuple[OtherAnswer, ...]:
    """Return the value at the criterion's path of the answer to the message at ``index``, if it has one."""
    reply = answers.find_answer(index)
    if reply is None or criterion.path is None:
        return ()
    value = find_at_path(parse_json_answer(reply.text), criterion.path)
    return () if value is MISSING else (OtherAnswer(as_text(value)),)


def _is_question(criterion: Replies, text: str) -> bool:
    if criterion.to and not any(is_same_text(text, wanted, criterion.ignore_case) for wanted in criterion.to):
        return False
    return not criterion.to_starts_with or text.startswith(criterion.to_starts_with)


def _describe_messages(criterion: Replies, pair: AgentPair) -> str:
    if criterion.to:
        return f"the texts {quote_list(criterion.to, 'or')}"
    if criterion.to_starts_with:
        return f"the texts that start with {quote_list(criterion.to_starts_with, 'or')}"
    return f"{pair.sender_name}'s messages"


def _describe_expected(criterion: Replies) -> str:
    clauses = ["JSON"] if criterion.is_json else []
    path_clause = f" at {criterion.path}" if criterion.path else ""
    if criterion.value is not None:
        clauses.append(f"{quote_text(as_text(criterion.value))}{path_clause}")
    elif criterion.has_conditions:
        clauses.append(f"{describe_conditions(criterion)}{path_clause}")
    elif path_clause:
        clauses.append(f"something{path_clause}")
    return " and ".join(clauses) or "a text"
