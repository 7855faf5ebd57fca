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
from service.grading.judging.answers import (
    MISSING,
    VALUE,
    AgentPair,
    Answers,
    as_text,
    build_pair,
    find_at_path,
    is_json_answer,
    is_same_value,
    parse_json_answer,
)
from service.grading.judging.channel_losses import describe_loss, is_lost_by_chance, is_out_of_reach
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.message_parts import join_with_or, quote_list, quote_text
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from service.grading.judging.text_conditions import describe_conditions, is_accepted_text, is_same_text
from sim.recording import Message
from sim.recording_values import get_pose_at
from sim.sentences import Sentence, join_with_and
from submissions.criteria.replies import Replies, list_allowed_answers

#: Messages that were sent instead are quoted up to this number and length.
_MAX_QUOTED_MESSAGES, _MAX_QUOTED_LENGTH = 3, 60

_NOTHING_TO_ANSWER = Sentence("The channel lost every message on its way by chance, so there was nothing to answer.")


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
        return fail_with(_describe_few_questions(criterion, pair, count, unreceived_messages))
    if excused_count and not count:
        return pass_with(_NOTHING_TO_ANSWER)
    answers = Answers(recording)
    wrong_answers: list[tuple[Message, str, int]] = []
    for attempts in questions.values():
        mistakes = ((message, _describe_mistake(criterion, answers, index), index) for index, message in attempts)
        wrong_answers += itertools.islice((each for each in mistakes if each[1]), 1)
    if not wrong_answers:
        return _pass_all(pair, count)
    message, mistake, index = min(wrong_answers, key=lambda each: each[0].t)
    right_count = count - len(wrong_answers)
    return fail_with(
        Sentence(
            "%(problem)s (%(right)s of %(count)s answered as expected).",
            problem=_describe_problem(pair, message.received, _describe_expected(criterion), mistake),
            right=right_count,
            count=count,
        ),
        message.t,
        get_pose_at(recording, message.t),
        Fraction(right_count, count),
        findings=_find_value(criterion, answers, index),
    )


def _describe_few_questions(
    criterion: Replies, pair: AgentPair, count: int, unreceived_messages: Sequence[Message]
) -> str:
    """Return that too few messages reached the responder, with the reason if they were sent from out of reach."""
    problem = Sentence("only %(count)s different reached it", count=count) if count else Sentence("none reached it")
    lost_message = next((message for message in unreceived_messages if is_out_of_reach(message)), None)
    if lost_message is not None:
        problem = Sentence(
            "%(problem)s: the channel lost %(text)s (%(loss)s)",
            problem=problem,
            text=quote_text(lost_message.text),
            loss=describe_loss(lost_message),
        )
    return Sentence(
        "Expected %(receiver)s to be sent at least %(count)s of %(messages)s, but %(problem)s.",
        receiver=pair.receiver_name,
        count=criterion.at_least,
        messages=_describe_messages(criterion, pair),
        problem=problem,
    )


def _describe_problem(pair: AgentPair, question: str, expected_answer: str, mistake: str) -> str:
    """Return a clause on a wrong answer."""
    return Sentence(
        "Expected %(receiver)s to answer %(question)s with %(answer)s, but %(mistake)s",
        receiver=pair.receiver_name,
        question=quote_text(question),
        answer=expected_answer,
        mistake=mistake,
    )


def _add_score(problem: str, right_count: int, count: int) -> str:
    """Return the sentence on a problem, with the number of right answers."""
    return Sentence("%(problem)s (%(right)s of %(count)s right).", problem=problem, right=right_count, count=count)


def _pass_all(pair: AgentPair, count: int) -> Outcome:
    return pass_with(
        Sentence(
            "%(receiver)s answered %(count)s of %(count)s messages as expected.", receiver=pair.first_words, count=count
        )
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
        expected_answer = _add_path(criterion, join_with_or([quote_text(as_text(each)) for each in allowed_answers]))
        if not matching_messages:
            tries = [message for message in sent_messages if is_same_text(message.text, text, criterion.ignore_case)]
            if tries and all(map(is_lost_by_chance, tries)):
                continue
            outcome = fail_with(
                Sentence(
                    "Expected %(receiver)s to be sent %(text)s, but %(problem)s",
                    receiver=pair.receiver_name,
                    text=quote_text(text),
                    problem=_explain_unsent(tries, sent_messages),
                )
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
                _describe_problem(pair, text, expected_answer, mistakes[wrong_index]),
                message.t,
                get_pose_at(pair.recording, message.t),
                findings=_find_value(criterion, answers, index),
            )
        first_failure = first_failure or outcome
        count += 1
    if first_failure is None and not count:
        return pass_with(_NOTHING_TO_ANSWER)
    if first_failure is None:
        return _pass_all(pair, count)
    return fail_with(
        _add_score(first_failure.message, right_count, count),
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
        problem = _describe_problem(pair, message.received, quote_text(expected_answer), mistake)
        return fail_with(
            _add_score(problem, right_count, count), message.t, get_pose_at(pair.recording, message.t), score
        )
    if len(questions) != count:
        actual = Sentence("%(count)s reached it", count=len(questions)) if questions else Sentence("none reached it")
        problem = Sentence(
            "Expected %(receiver)s to answer %(count)s messages, but %(actual)s.",
            receiver=pair.receiver_name,
            count=count,
            actual=actual,
        )
        return fail_with(problem, score=score)
    return _pass_all(pair, count)


def _explain_unsent(tries: Sequence[Message], sent_messages: Sequence[Message]) -> str:
    """Return why a text never reached the responder, and what was sent instead."""
    unreachable_message = next((message for message in tries if is_out_of_reach(message)), None)
    if unreachable_message:
        return Sentence("the channel lost it (%(loss)s)", loss=describe_loss(unreachable_message))
    texts = tuple(dict.fromkeys(message.text for message in sent_messages if len(message.text) <= _MAX_QUOTED_LENGTH))
    if not texts:
        return Sentence("it was not")
    return Sentence("it was not; it was sent %(texts)s", texts=quote_list(texts[:_MAX_QUOTED_MESSAGES]))


def _describe_wrong_answer(criterion: Replies, answers: Answers, index: int, allowed_answers: Sequence[object]) -> str:
    """Return the problem with the answer to the message at ``index``; empty if it is one of the correct ones."""
    mistakes = [_describe_mismatch(criterion, answers, index, each) for each in allowed_answers]
    return "" if "" in mistakes else mistakes[0] if mistakes else Sentence("no answer is correct")


def _describe_mismatch(criterion: Replies, answers: Answers, index: int, answer: object) -> str:
    """Return how the answer to the message at ``index`` differs from this one; empty if it does not."""
    reply = answers.find_answer(index)
    if reply is None:
        return answers.describe_silence(index)
    answer_text = quote_text(reply.text)
    if criterion.is_json and not is_json_answer(reply.text):
        return Sentence("it answered %(answer)s, which is not JSON:: and well-formed JSON", answer=answer_text)
    if criterion.agents:
        value = parse_json_answer(JSON + reply.text) if reply.note == VALUE else reply.text
        if is_same_value(value, answer):
            return ""
        if isinstance(value, str):
            return Sentence("it answered the text %(answer)s", answer=answer_text)
        return Sentence("it answered %(answer)s", answer=answer_text)
    if criterion.path is None:
        is_same = is_same_text(reply.text, str(answer), criterion.ignore_case)
        return "" if is_same else Sentence("it answered %(answer)s", answer=answer_text)
    actual = find_at_path(parse_json_answer(reply.text), criterion.path)
    if actual is MISSING:
        return _describe_missing_value(criterion.path, answer_text)
    if isinstance(actual, str) and isinstance(answer, str):
        is_same = is_same_text(actual, answer, criterion.ignore_case)
    else:
        is_same = is_same_value(actual, answer)
    return "" if is_same else _describe_other_value(actual, criterion.path)


def _describe_missing_value(path: str, answer_text: str) -> str:
    return Sentence("there is nothing at %(path)s in its answer %(answer)s", path=path, answer=answer_text)


def _describe_other_value(value: object, path: str) -> str:
    return Sentence("it has %(value)s at %(path)s", value=quote_text(as_text(value)), path=path)


def _describe_mistake(criterion: Replies, answers: Answers, index: int) -> str:
    """Return how the answer to the message at ``index`` violates the conditions; empty if it does not."""
    reply = answers.find_answer(index)
    if reply is None:
        return answers.describe_silence(index)
    answer_text = quote_text(reply.text)
    if criterion.is_json and not is_json_answer(reply.text):
        return Sentence("it answered %(answer)s, which is not JSON:: and well-formed JSON", answer=answer_text)
    text = reply.text
    if criterion.path is not None:
        actual = find_at_path(parse_json_answer(reply.text), criterion.path)
        if actual is MISSING:
            return _describe_missing_value(criterion.path, answer_text)
        if criterion.value is not None and not is_same_value(actual, criterion.value):
            return _describe_other_value(actual, criterion.path)
        text = as_text(actual)
    return "" if is_accepted_text(criterion, text) else Sentence("it answered %(answer)s", answer=quote_text(text))


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
        return Sentence("the texts %(texts)s", texts=quote_list(criterion.to, "or"))
    if criterion.to_starts_with:
        return Sentence("the texts that start with %(texts)s", texts=quote_list(criterion.to_starts_with, "or"))
    return Sentence("%(sender)s's messages", sender=pair.sender_name)


def _describe_expected(criterion: Replies) -> str:
    clauses = ["JSON"] if criterion.is_json else []
    if criterion.value is not None:
        clauses.append(_add_path(criterion, quote_text(as_text(criterion.value))))
    elif criterion.has_conditions:
        clauses.append(_add_path(criterion, describe_conditions(criterion)))
    elif criterion.path:
        clauses.append(_add_path(criterion, Sentence("something")))
    return join_with_and(clauses) or Sentence("a text")


def _add_path(criterion: Replies, value: str) -> str:
    """Return a value in words, with the criterion's path to it, if it has one."""
    return Sentence("%(value)s at %(path)s", value=value, path=criterion.path) if criterion.path else value
