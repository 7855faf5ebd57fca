"""Judging of the responder's answers: to given texts, or to every message that reached it.

An answer counts even if it arrived after the program ended. The robot's use of it is judged elsewhere.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from fractions import Fraction

from responders.message_format import JSON
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
from service.grading.judging.texts import describe_conditions, is_accepted_text, is_same_text
from sim.recording import Message
from sim.recording_values import get_pose_at
from submissions.criteria.replies import Replies, list_allowed_answers

#: Messages that were sent instead are quoted up to this number and length.
_MOST_SENT, _LONGEST_SENT = 3, 60

_NOTHING_TO_ANSWER = "The channel lost every message on its way by chance, so there was nothing to answer."


@declare_judge(Replies)
def judge_replies(criterion: Replies, trial: TrialResult) -> Outcome:
    """Judge the answer to each expected text, or to each different question that arrived."""
    pair = build_pair(criterion, trial.recording)
    recording = pair.recording
    sent = [message for message in recording.messages if message.sender == "robot"]
    asked = [
        (index, message)
        for index, message in enumerate(recording.messages)
        if message.sender == "robot" and message.delivered is not None
    ]
    if criterion.expect:
        return _judge_expected(criterion, asked, sent, pair)
    if criterion.in_order:
        return _judge_order(criterion, asked, pair)
    # A repeated message asks nothing new.
    questions: dict[str, list[tuple[int, Message]]] = {}
    for index, message in asked:
        if _is_question(criterion, message.received):
            questions.setdefault(message.received, []).append((index, message))
    count = len(questions)
    unheard = [each for each in sent if each.text not in questions and _is_question(criterion, each.text)]
    excused = len({message.text for message in unheard if is_lost_by_chance(message)})
    if count + excused < criterion.at_least:
        few = f"only {count} different reached it" if count else "none reached it"
        astray = next((message for message in unheard if is_out_of_reach(message)), None)
        why = f": the channel lost {quote_text(astray.text)} ({describe_loss(astray)})" if astray else ""
        wanted = f"at least {criterion.at_least} of {_describe_messages(criterion, pair)}"
        return fail_with(f"Expected {pair.receiver_name} to be sent {wanted}, but {few}{why}.", score=Fraction(0))
    if excused and not count:
        return pass_with(_NOTHING_TO_ANSWER)
    answers = Answers(recording)
    wrong: list[tuple[Message, str]] = []
    for times in questions.values():
        mistakes = ((message, _describe_mistake(criterion, answers, index)) for index, message in times)
        wrong += itertools.islice(((message, mistake) for message, mistake in mistakes if mistake), 1)
    if not wrong:
        return pass_with(f"{pair.receiver_name.capitalize()} answered {count} of {count} messages as expected.")
    message, mistake = min(wrong, key=lambda pair: pair[0].t)
    right = count - len(wrong)
    return fail_with(
        f"Expected {pair.receiver_name} to answer {quote_text(message.received)} with "
        f"{_describe_expected(criterion)}, but {mistake} "
        f"({right} of {count} answered as expected).",
        message.t,
        get_pose_at(recording, message.t),
        Fraction(right, count),
    )


def _judge_expected(
    criterion: Replies, asked: list[tuple[int, Message]], sent: list[Message], pair: AgentPair
) -> Outcome:
    """Judge the expected texts, without those lost by chance, which the responder could not answer."""
    answers = Answers(pair.recording)
    right = count = 0
    first: Outcome | None = None
    for text, answer in criterion.expect.items():
        heard = [(index, each) for index, each in asked if is_same_text(each.received, text, criterion.ignore_case)]
        right_ones = list_allowed_answers(answer)
        words = " or ".join(quote_text(as_text(each)) for each in right_ones)
        wanted = words + (f" at {criterion.path}" if criterion.path else "")
        if not heard:
            tries = [message for message in sent if is_same_text(message.text, text, criterion.ignore_case)]
            if tries and all(map(is_lost_by_chance, tries)):
                continue
            outcome = fail_with(
                f"Expected {pair.receiver_name} to be sent {quote_text(text)}, but {_explain_unsent(tries, sent)}."
            )
        else:
            mistakes = [_describe_wrong_answer(criterion, answers, index, right_ones) for index, _ in heard]
            place = next((i for i, mistake in enumerate(mistakes) if mistake), None)
            if place is None:
                right += 1
                count += 1
                continue
            message = heard[place][1]
            outcome = fail_with(
                f"Expected {pair.receiver_name} to answer {quote_text(text)} with {wanted}, but {mistakes[place]}.",
                message.t,
                get_pose_at(pair.recording, message.t),
            )
        first = first or outcome
        count += 1
    if first is None and not count:
        return pass_with(_NOTHING_TO_ANSWER)
    if first is None:
        return pass_with(f"{pair.receiver_name.capitalize()} answered {count} of {count} messages as expected.")
    return fail_with(f"{first.message[:-1]} ({right} of {count} right).", first.t, first.pose, Fraction(right, count))


def _judge_order(criterion: Replies, asked: list[tuple[int, Message]], pair: AgentPair) -> Outcome:
    """Judge the answers to all questions, in order, against the list."""
    answers = Answers(pair.recording)
    heard = [(index, each) for index, each in asked if _is_question(criterion, each.received)]
    wrong = [
        (message, wanted, mistake)
        for (index, message), wanted in zip(heard, criterion.in_order, strict=False)
        if (mistake := _describe_mismatch(criterion, answers, index, wanted))
    ]
    count = len(criterion.in_order)
    right = max(0, min(count, len(heard)) - len(wrong) - max(0, len(heard) - count))
    score = Fraction(right, count)
    if wrong:
        message, wanted, mistake = wrong[0]
        return fail_with(
            f"Expected {pair.receiver_name} to answer {quote_text(message.received)} with {quote_text(wanted)}, "
            f"but {mistake} "
            f"({right} of {count} right).",
            message.t,
            get_pose_at(pair.recording, message.t),
            score,
        )
    if len(heard) != count:
        few = f"{len(heard)} reached it" if heard else "none reached it"
        return fail_with(f"Expected {pair.receiver_name} to answer {count} messages, but {few}.", score=score)
    return pass_with(f"{pair.receiver_name.capitalize()} answered {count} of {count} messages as expected.")


def _explain_unsent(tries: Sequence[Message], sent: Sequence[Message]) -> str:
    """Return why a text never reached the responder, and what was sent instead."""
    astray = next((message for message in tries if is_out_of_reach(message)), None)
    if astray:
        return f"the channel lost it ({describe_loss(astray)})"
    texts = tuple(dict.fromkeys(message.text for message in sent if len(message.text) <= _LONGEST_SENT))
    return f"it was not; it was sent {quote_list(texts[:_MOST_SENT])}" if texts else "it was not"


def _describe_wrong_answer(criterion: Replies, answers: Answers, index: int, right_ones: Sequence[object]) -> str:
    """Return the problem with the answer to the message at ``index``; empty if it is one of the correct ones."""
    mistakes = [_describe_mismatch(criterion, answers, index, each) for each in right_ones]
    return "" if "" in mistakes else mistakes[0] if mistakes else "no answer is correct"


def _describe_mismatch(criterion: Replies, answers: Answers, index: int, answer: object) -> str:
    """Return how the answer to the message at ``index`` differs from this one; empty if it does not."""
    reply = answers.find_answer(index)
    if reply is None:
        return answers.describe_silence(index)
    if criterion.is_json and not is_json_answer(reply.text):
        return f"it answered {quote_text(reply.text)}, which is not JSON:: and well-formed JSON"
    if criterion.agents:
        said = parse_json_answer(JSON + reply.text) if reply.note == VALUE else reply.text
        mistake = "it answered " + ("the text " if isinstance(said, str) else "") + quote_text(reply.text)
        return "" if is_same_value(said, answer) else mistake
    if criterion.path is None:
        same = is_same_text(reply.text, str(answer), criterion.ignore_case)
        return "" if same else f"it answered {quote_text(reply.text)}"
    found = find_at_path(parse_json_answer(reply.text), criterion.path)
    if found is MISSING:
        return f"there is nothing at {criterion.path} in its answer {quote_text(reply.text)}"
    if isinstance(found, str) and isinstance(answer, str):
        same = is_same_text(found, answer, criterion.ignore_case)
    else:
        same = is_same_value(found, answer)
    return "" if same else f"it has {quote_text(as_text(found))} at {criterion.path}"


def _describe_mistake(criterion: Replies, answers: Answers, index: int) -> str:
    """Return how the answer to the message at ``index`` violates the conditions; empty if it does not."""
    reply = answers.find_answer(index)
    if reply is None:
        return answers.describe_silence(index)
    if criterion.is_json and not is_json_answer(reply.text):
        return f"it answered {quote_text(reply.text)}, which is not JSON:: and well-formed JSON"
    text = reply.text
    if criterion.path is not None:
        found = find_at_path(parse_json_answer(reply.text), criterion.path)
        if found is MISSING:
            return f"there is nothing at {criterion.path} in its answer {quote_text(reply.text)}"
        if criterion.value is not None and not is_same_value(found, criterion.value):
            return f"it has {quote_text(as_text(found))} at {criterion.path}"
        text = as_text(found)
    return "" if is_accepted_text(criterion, text) else f"it answered {quote_text(text)}"


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
    words = ["JSON"] if criterion.is_json else []
    there = f" at {criterion.path}" if criterion.path else ""
    if criterion.value is not None:
        words.append(f"{quote_text(as_text(criterion.value))}{there}")
    elif criterion.has_conditions:
        words.append(f"{describe_conditions(criterion)}{there}")
    elif there:
        words.append(f"something{there}")
    return " and ".join(words) or "a text"
