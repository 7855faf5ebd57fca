"""The robot's queue: the answers that joined it, and whether each message has its answer there."""

from __future__ import annotations

from collections.abc import Container, Iterable
from fractions import Fraction

from responders.message_format import JSON, PY
from service.grading.judging.answers import MISSING, Answers, as_text, find_at_path, is_json_answer, parse_json_answer
from service.grading.judging.channel_losses import describe_loss, is_lost_by_chance, is_out_of_reach
from service.grading.judging.message_parts import quote_text
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from sim.recording import Message, Recording, TimedText
from sim.recording_values import get_pose_at
from sim.sentences import Sentence
from submissions.criteria.texts import Messages


def collect_queue_lines(criterion: Messages, answers: Iterable[tuple[float, str]]) -> list[TimedText]:
    """Return the answers that join the robot's queue, in order of time, reduced to the requested value."""
    lines = []
    for t, text in sorted(answers, key=lambda answer: answer[0]):
        value = parse_json_answer(text)
        value = value if value is MISSING or criterion.path is None else find_at_path(value, criterion.path)
        if value is not MISSING:
            lines.append(TimedText(t, as_text(value)))
    return lines


def is_queued(message: Message) -> bool:
    """Return whether it is an answer that joined the robot's queue."""
    if message.sender != "responder" or message.delivered is None:
        return False
    if message.arrived_as is not None:
        return is_json_answer(message.arrived_as)
    return message.text.startswith(JSON) and message.note != "malformed"


def judge_queue_growth(recording: Recording) -> Outcome:
    """Judge whether every PY:: message that reached the responder has its JSON:: answer in the queue, in order.

    Answers that the channel lost by chance, or that came when the message was sent again, are not missed.
    """
    sent_messages = [
        (index, message)
        for index, message in enumerate(recording.messages)
        if message.sender == "robot" and message.text.startswith(PY)
    ]
    received_messages = [(index, message) for index, message in sent_messages if message.delivered is not None]
    expectation = Sentence("Expected the robot's queue to grow by one JSON:: message for each PY:: message")
    if not received_messages:
        unreachable_message = next((message for _, message in sent_messages if is_out_of_reach(message)), None)
        if sent_messages and not unreachable_message:
            return pass_with(
                Sentence("The channel lost every PY:: message by chance, so there were no answers to queue.")
            )
        if not unreachable_message:
            return fail_with(Sentence("%(expectation)s, but the robot sent no PY:: message.", expectation=expectation))
        return fail_with(
            Sentence(
                "%(expectation)s, but the channel lost %(text)s (%(reason)s).",
                expectation=expectation,
                text=quote_text(unreachable_message.text),
                reason=describe_loss(unreachable_message),
            )
        )
    answers = Answers(recording)
    replies = [(message, _find_reply(answers, index)) for index, message in received_messages]
    arrivals = [reply.delivered for _, reply in replies if reply is not None and is_queued(reply)]
    answered_texts = {message.text for message, reply in replies if reply is not None and is_queued(reply)}
    # A repeated message shows nothing new.
    distinct_texts = {message.text for _, message in received_messages}
    missed_messages = [
        (message, reply) for message, reply in replies if not _is_excused(message, reply, answered_texts)
    ]
    score = Fraction(len(distinct_texts - {message.text for message, _ in missed_messages}), len(distinct_texts))
    for message, reply in missed_messages:
        return fail_with(
            Sentence(
                "%(expectation)s, but %(problem)s (%(count)s of %(total)s in the queue).",
                expectation=expectation,
                problem=_describe_missed_message(message, reply),
                count=len(arrivals),
                total=len(received_messages),
            ),
            message.t,
            get_pose_at(recording, message.t),
            score,
        )
    if not arrivals:
        return pass_with(Sentence("The channel lost every answer by chance."))
    times = [arrived or 0.0 for arrived in arrivals]
    if times != sorted(times):
        problem = Sentence("%(expectation)s, but the answers arrived in another order.", expectation=expectation)
        return fail_with(problem, times[-1], None, score)
    return pass_with(
        Sentence("The robot's queue grew by one for each of %(count)s messages.", count=len(arrivals)),
        times[-1],
        get_pose_at(recording, times[-1]),
    )


def _describe_missed_message(message: Message, reply: Message | None) -> str:
    """Return why the answer to a message is not in the queue, as ``"PY::1" got no answer``."""
    text = quote_text(message.text)
    if reply is None:
        return Sentence("%(text)s got no answer", text=text)
    if is_out_of_reach(reply):
        return Sentence(
            "%(text)s was answered and the channel lost the answer (%(reason)s)",
            text=text,
            reason=describe_loss(reply),
        )
    if reply.delivered is None and reply.note == "undelivered":
        return Sentence("%(text)s got its answer only after the program had ended", text=text)
    return Sentence("%(text)s was answered with %(answer)s", text=text, answer=quote_text(reply.text))


def _find_reply(answers: Answers, index: int) -> Message | None:
    """Return the answer that joined the queue, the first of several copies; otherwise the first answer."""
    return next(filter(is_queued, answers.list_answers(index)), answers.find_answer(index))


def _is_excused(message: Message, reply: Message | None, answered_texts: Container[str]) -> bool:
    """Return whether a message's answer is in the queue, or missing only because of the channel."""
    if reply is None:
        return False
    return is_queued(reply) or is_lost_by_chance(reply) or (is_out_of_reach(reply) and message.text in answered_texts)
