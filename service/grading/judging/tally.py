"""What became of every image that was sent: answered, late, malformed or unanswered; and the answer that counts.

Each image is in exactly one of the four, so that they add up to the images sent. What an answer says is
read elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from service.grading.judging.answers import Answers
from sim.recording import Message, Recording, Verdict

ReplyStatus = Literal["answered", "late", "malformed", "unanswered"]
_BEST_FIRST: tuple[ReplyStatus, ...] = ("answered", "late", "malformed", "unanswered")


@dataclass(frozen=True, slots=True)
class Reply:
    """What came back to one image. ``text`` is the answer that counts; ``words`` say why there is none."""

    status: ReplyStatus
    text: str | None
    words: str
    duplicates: int = 0  # answers beyond the one that counts


def reply_to(recording: Recording, answers: Answers, number: int) -> Reply:
    """What came back to image ``number`` of the recording.

    An answer is late if it arrived after the next image was sent, or was under way when the program ended.
    One that was lost on its way is none. Of several answers the first that arrived in time counts.
    """
    image = recording.images[number]
    following = recording.images[number + 1].t if number + 1 < len(recording.images) else None
    came = answers.all_to(image.message)
    statuses = [(_status(message, following), message) for message in came]
    arrived = [pair for pair in statuses if pair[0] != "unanswered"]
    if not arrived:
        return _silence(recording, answers, image.message, came)
    status, message = min(arrived, key=lambda pair: _BEST_FIRST.index(pair[0]))
    text = message.text
    duplicates = len(arrived) - 1
    if status == "malformed":
        return Reply(status, None, "the answer begins with JSON:: but is not JSON", duplicates)
    return Reply(status, text, "", duplicates)


def _status(message: Message, following: float | None) -> ReplyStatus:
    if message.note == "malformed":
        return "malformed"
    if message.delivered is None:
        return "unanswered" if message.note == "lost" else "late"
    return "late" if following is not None and message.delivered > following else "answered"


def _silence(recording: Recording, answers: Answers, question: int, came: Sequence[Message]) -> Reply:
    """Nothing arrived: the image or its answer was lost, the answer was no text, or there was none."""
    if came:
        return Reply("unanswered", None, "the answer was lost on its way")
    sent = recording.messages[question] if question < len(recording.messages) else None
    if sent is not None and sent.note == "lost":
        return Reply("unanswered", None, "the image was lost on its way")
    fault = answers.fault_after(question)
    if fault is not None and fault.verdict is Verdict.PROTOCOL_ERROR and "the responder returned" in fault.message:
        return Reply("malformed", None, answers.silence(question))
    return Reply("unanswered", None, answers.silence(question))
