"""The conversation of a robot and its responder: all messages with their times, and the answers in transit.

It works only in simulated time. It records messages and computes arrivals, but does not call the responder.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, replace

from responders.channel import Channel, ChannelLink, Contact, TrialChannel
from responders.message_format import format_queue_entry
from sim.recording import SECOND, Fault, Message
from sim.world import HashChain


@dataclass(frozen=True, slots=True)
class SentText:
    """A text sent by the robot: its index in the messages, its number among the robot's texts, and its time."""

    message: int
    number: int
    t: int
    text: str  # as the responder receives it
    copies: int  # number of copies that arrive


@dataclass(frozen=True, slots=True)
class Answer:
    """The responder's reaction to a text: the answer if any, the time that it slept, and the fault if any."""

    text: str | None = None
    slept: int = 0
    fault: Fault | None = None
    entry: str | None = None  # the entry for the robot's message queue, as JSON
    note: str = ""


@dataclass(frozen=True, slots=True)
class _AnswerInTransit:
    """An answer in transit: its queue entry, and its text if the channel corrupted it."""

    entry: str | None
    corrupted: str | None


class Conversation:
    """All messages of one trial, and the answers in transit. Times are units of simulated time."""

    def __init__(
        self,
        channel: Channel,
        seed: int,
        chain: HashChain,
        link: ChannelLink,
        never_lost: frozenset[int] = frozenset(),
    ) -> None:
        self._channel = TrialChannel(channel, seed, never_lost)
        self._chain = chain
        self.link = link
        self._under_way: list[tuple[int, int, _AnswerInTransit]] = []  # arrival time, message index, content
        self._texts = 0
        self.messages: list[Message] = []
        self.faults: list[Fault] = []

    def send(self, text: str, now: int) -> SentText:
        """Record a text from the robot. It reaches the responder at once, in zero or more copies."""
        contact = self.link.measure_contact()
        copies = 0 if contact.lost else self._channel.count_copies(self._texts)
        corrupted = self._channel.corrupt_text(text, self._texts) if copies else None
        message = Message(
            now / SECOND,
            "robot",
            text,
            now / SECOND if copies else None,
            note="" if copies == 1 else "duplicated" if copies else "lost",
            lost="" if copies else contact.lost or "chance",
            distance=contact.distance,
            angle=contact.angle,
            arrived_as=corrupted,
        )
        sent_text = SentText(len(self.messages), self._texts, now, message.received, copies)
        self.messages.append(message)
        self._texts += 1
        self._chain.add("message", now, text.encode())
        self._chain_channel_effects(now, contact, corrupted)
        return sent_text

    def record_answer(self, sent_text: SentText, copy: int, answer: Answer) -> None:
        """Record the responder's answer to one copy of a text and schedule its arrival."""
        if answer.fault is not None:
            self.faults.append(answer.fault)
        if answer.text is None:
            return
        arrivals = self._channel.compute_arrivals(sent_text.number, copy, sent_text.t, answer.slept)
        message = Message(
            (sent_text.t + answer.slept) / SECOND, "responder", answer.text, None, sent_text.message, answer.note
        )
        if not arrivals:
            self.messages.append(replace(message, note=message.note or "lost", lost="chance"))
        for duplicate, due in enumerate(arrivals):
            corrupted = self._channel.corrupt_answer(answer.text, sent_text.number, copy, duplicate)
            entry = answer.entry if corrupted is None or answer.entry is None else _parse_queue_entry(corrupted)
            heapq.heappush(self._under_way, (due, len(self.messages), _AnswerInTransit(entry, corrupted)))
            self.messages.append(replace(message, note=message.note or ("duplicated" if duplicate else "")))

    def pass_on(self, sent_text: SentText, entry: str | None, receiver: Conversation) -> tuple[int, ...]:
        """Send a text of this robot to the other robot. Return the indices of its copies in the other's messages.

        ``entry`` is the entry for the other robot's queue, as JSON.
        """
        message = self.messages[sent_text.message]
        self.messages[sent_text.message] = replace(message, delivered=None, to_partner=True)
        first = len(receiver.messages)
        for copy, due in enumerate(
            self._channel.compute_one_way_arrivals(sent_text.number, sent_text.t, sent_text.copies)
        ):
            heapq.heappush(
                receiver._under_way, (due, len(receiver.messages), _AnswerInTransit(entry, message.arrived_as))
            )
            note = "duplicated" if copy else ""
            receiver.messages.append(Message(sent_text.t / SECOND, "partner", message.text, None, note=note))
        return tuple(range(first, len(receiver.messages)))

    def deliver(self, now: int) -> list[str]:
        """Deliver everything that is due by ``now``, in order. Return the queue entries for the robot, as JSON.

        Answers that are due while the robot is out of reach of the link are lost.
        """
        entries = []
        while self._under_way and self._under_way[0][0] <= now:
            _, index, under_way = heapq.heappop(self._under_way)
            if self._deliver_message(index, now, under_way.corrupted) and under_way.entry is not None:
                entries.append(under_way.entry)
        return entries

    def finish(self) -> None:
        """Mark answers still in transit as undelivered, because the program has ended."""
        for _, index, _ in self._under_way:
            self.messages[index] = replace(self.messages[index], note="undelivered")
        self._under_way.clear()

    def _deliver_message(self, index: int, now: int, corrupted: str | None) -> bool:
        contact = self.link.measure_contact()
        message = replace(self.messages[index], distance=contact.distance, angle=contact.angle)
        if contact.lost:
            self.messages[index] = replace(message, note=message.note or "lost", lost=contact.lost)
        else:
            self.messages[index] = replace(message, delivered=now / SECOND, arrived_as=corrupted)
            self._chain.add("answer", now, message.text.encode())
        self._chain_channel_effects(now, contact, corrupted)
        return not contact.lost

    def _chain_channel_effects(self, now: int, contact: Contact, corrupted: str | None) -> None:
        """Add the effects of an infrared link or a corrupting channel to the hash chain."""
        if contact.lost:
            self._chain.add("lost", now, contact.lost.encode())
        elif corrupted is not None:
            self._chain.add("corrupted", now, corrupted.encode())


def _parse_queue_entry(corrupted: str) -> str | None:
    """Return the queue entry of a corrupted JSON answer, or None if it is no longer valid JSON."""
    try:
        return format_queue_entry(corrupted)
    except ValueError:
        return None
