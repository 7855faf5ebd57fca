"""The conversation of a robot and its responder: who said what when, and which answers are still under way.

It lives in simulated time alone: it is told what was said, says when that arrives, and asks nobody for an answer.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, replace

from responders.channel import Channel, ChannelOfTrial
from sim.recording import SECOND, Fault, Message
from sim.world import Chain


@dataclass(frozen=True, slots=True)
class Sent:
    """A text of the robot's: its index in the messages, its number among the robot's, and when it was sent."""

    message: int
    number: int
    t: int
    copies: int  # how often it reaches the responder


@dataclass(frozen=True, slots=True)
class Answer:
    """What came of a text: the answer, if there is one; how long it took the responder; and what went wrong."""

    text: str | None = None
    slept: int = 0
    fault: Fault | None = None
    entry: str | None = None  # what joins the robot's queue when it arrives, as JSON
    note: str = ""


class Conversation:
    """All messages of one trial, and the answers that are still under way. Times are units of simulated time."""

    def __init__(self, channel: Channel, seed: int, chain: Chain) -> None:
        self._channel = ChannelOfTrial(channel, seed)
        self._chain = chain
        self._under_way: list[tuple[int, int, str | None]] = []  # due, index of the message, what joins the queue
        self._texts = 0
        self.messages: list[Message] = []
        self.faults: list[Fault] = []

    def send(self, text: str, now: int) -> Sent:
        """The robot says ``text``; it reaches the responder at once, as often as it is copied on its way."""
        copies = self._channel.copies(self._texts)
        sent = Sent(len(self.messages), self._texts, now, copies)
        note = "" if copies == 1 else "duplicated" if copies else "lost"
        self.messages.append(Message(now / SECOND, "robot", text, now / SECOND if copies else None, note=note))
        self._texts += 1
        self._chain.add("message", now, text.encode())
        return sent

    def answer(self, sent: Sent, copy: int, answer: Answer) -> None:
        """The responder's answer to one copy of a text sets out."""
        if answer.fault is not None:
            self.faults.append(answer.fault)
        if answer.text is None:
            return
        arrivals = self._channel.arrivals(sent.number, copy, sent.t, answer.slept)
        said = Message((sent.t + answer.slept) / SECOND, "responder", answer.text, None, sent.message, answer.note)
        if not arrivals:
            self.messages.append(replace(said, note=said.note or "lost"))
        for place, due in enumerate(arrivals):
            heapq.heappush(self._under_way, (due, len(self.messages), answer.entry))
            self.messages.append(replace(said, note=said.note or ("duplicated" if place else "")))

    def pass_on(self, sent: Sent, entry: str | None, other: Conversation) -> tuple[int, ...]:
        """A text of this robot's sets out to the other one; the indices of its copies among the other's messages.

        ``entry`` is what joins the other's queue, as JSON.
        """
        message = self.messages[sent.message]
        self.messages[sent.message] = replace(message, delivered=None, to_partner=True)
        text = message.text
        first = len(other.messages)
        for copy, due in enumerate(self._channel.one_way(sent.number, sent.t, sent.copies)):
            heapq.heappush(other._under_way, (due, len(other.messages), entry))
            note = "duplicated" if copy else ""
            other.messages.append(Message(sent.t / SECOND, "partner", text, None, note=note))
        return tuple(range(first, len(other.messages)))

    def deliver(self, now: int) -> list[str]:
        """Everything due at the tick at ``now`` arrives, in order; what joins the robot's queue of it, as JSON."""
        arrived = []
        while self._under_way and self._under_way[0][0] <= now:
            _, index, entry = heapq.heappop(self._under_way)
            message = self.messages[index] = replace(self.messages[index], delivered=now / SECOND)
            self._chain.add("answer", now, message.text.encode())
            if entry is not None:
                arrived.append(entry)
        return arrived

    def finish(self) -> None:
        """The program has ended: what is still under way will never arrive."""
        for _, index, _ in self._under_way:
            self.messages[index] = replace(self.messages[index], note="undelivered")
        self._under_way.clear()
