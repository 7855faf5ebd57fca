"""The reply to each image that the robot sent: which of several answers counts, or why there is none."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from responders.faults import is_wrong_return
from service.grading.judging.answers import Answers
from sim.recording import Image, Message, Recording, TimedText
from sim.sentences import Sentence
from submissions.criteria.recognition import Recognition

ReplyStatus = Literal["answered", "late", "malformed", "unanswered"]
_STATUS_ORDER: tuple[ReplyStatus, ...] = ("answered", "late", "malformed", "unanswered")


@dataclass(frozen=True, slots=True)
class Reply:
    """The reply to one image. ``text`` is the answer that counts; ``words`` is the reason if there is none."""

    status: ReplyStatus
    text: str | None
    words: str
    duplicates: int = 0  # answers after the one that counts


def find_reply(recording: Recording, answers: Answers, number: int) -> Reply:
    """Return the reply to image ``number`` of the recording.

    An answer is late if it arrived after the next image was sent, or was in transit when the program ended. A lost
    answer does not count. Of several answers, the first that arrived in time counts.
    """
    image = recording.images[number]
    next_image_time = recording.images[number + 1].t if number + 1 < len(recording.images) else None
    received_answers = answers.list_answers(image.message)
    statuses = [(_determine_status(message, next_image_time), message) for message in received_answers]
    arrived_answers = [pair for pair in statuses if pair[0] != "unanswered"]
    if not arrived_answers:
        return _build_missing_reply(recording, answers, image.message, received_answers)
    status, message = min(arrived_answers, key=_rank_answer)
    text = message.text
    duplicates = len(arrived_answers) - 1
    if status == "malformed":
        return Reply(status, None, Sentence("the answer begins with JSON:: but is not JSON"), duplicates)
    return Reply(status, text, "", duplicates)


def _rank_answer(answer: tuple[ReplyStatus, Message]) -> tuple[int, float]:
    """Return the sort key of answers: by status, then by arrival. Answers in transit at the end come last."""
    status, message = answer
    return _STATUS_ORDER.index(status), math.inf if message.delivered is None else message.delivered


def _determine_status(message: Message, next_image_time: float | None) -> ReplyStatus:
    if message.note == "malformed":
        return "malformed"
    if message.delivered is None:
        return "unanswered" if message.note == "lost" else "late"
    return "late" if next_image_time is not None and message.delivered > next_image_time else "answered"


def _build_missing_reply(
    recording: Recording, answers: Answers, question: int, received_answers: Sequence[Message]
) -> Reply:
    """Return the reply if nothing arrived: image or answer was lost, the answer was not a text, or none was given."""
    if received_answers:
        return Reply("unanswered", None, Sentence("the answer was lost on its way"))
    question_message = recording.messages[question] if question < len(recording.messages) else None
    if question_message is not None and question_message.note == "lost":
        return Reply("unanswered", None, Sentence("the image was lost on its way"))
    fault = answers.find_fault_after(question)
    if fault is not None and is_wrong_return(fault):
        return Reply("malformed", None, answers.describe_silence(question))
    return Reply("unanswered", None, answers.describe_silence(question))


def collect_replies(criterion: Recognition, recording: Recording) -> list[Reply]:
    """Return the reply to every image of the recording, including images that don't count."""
    if criterion.answer_from == "reply":
        answers = Answers(recording)
        return [find_reply(recording, answers, number) for number in range(len(recording.images))]
    silence = (
        Sentence("the robot said nothing after the image")
        if criterion.answer_from == "speech"
        else Sentence("the robot printed nothing after the image")
    )
    replies = []
    for image in recording.images:
        answer_lines = _list_lines_between(recording, image, criterion.answer_from == "speech")
        text = " | ".join(line.text for line in answer_lines)
        replies.append(Reply("answered", text, "") if answer_lines else Reply("unanswered", None, silence))
    return replies


def _list_lines_between(recording: Recording, image: Image, is_speech: bool) -> Sequence[TimedText]:
    """Return what the robot said or printed after this image and before the next."""
    next_index = bisect_right(recording.images, image.message, key=lambda other: other.message)
    end = recording.images[next_index].t if next_index < len(recording.images) else math.inf
    lines = recording.spoken if is_speech else recording.printed
    return lines[bisect_left(lines, image.t, key=_get_time) : bisect_left(lines, end, key=_get_time)]


def _get_time(line: TimedText) -> float:
    return line.t
