"""Serves two robot programs in the same simulated time, tick by tick, the first robot first.

``bridge.py`` handles the requests of each program. ``pair.py`` creates the children and the recordings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from greenlet import getcurrent, greenlet

from responders import message_format
from responders.bridge import Bridge
from responders.channel import InfraredLink
from responders.conversation import SentText
from responders.responder_process import LoggedData, ResponderProcess
from responders.sandbox.meter import JobMeter
from responders.sandbox.served_child import ServedChild
from responders.trial_spec import TrialSpec
from sim.camera import LightCamera
from sim.recording import SECOND, Call, Fault, Verdict
from sim.shared_arena import SharedArena


@dataclass(frozen=True, slots=True)
class PendingText:
    """A text for the responder, with the data that its robot had logged when it was sent."""

    sent: SentText
    collected: LoggedData


class PairedBridge(Bridge):
    """Serves one of two programs and waits for the other one at each tick.

    Texts for the responder are queued until the tick, because the other robot may have sent an earlier one. Without a
    responder, texts go to the other robot.
    """

    def __init__(
        self, spec: TrialSpec, arena: SharedArena, camera: LightCamera, child: ServedChild, meter: JobMeter
    ) -> None:
        super().__init__(spec, arena, camera, child, None, meter)
        self.arena = arena
        self.number = spec.number
        self.questions: list[PendingText] = []
        self.calls: list[Call] = []
        self._passed_on: list[tuple[int, tuple[int, ...]]] = []  # message index, indices at the partner

    def connect_partner(self, partner: PairedBridge) -> None:
        """Connect this robot with its partner."""
        self.partner = partner
        channel = self._spec.channel
        if channel.link == "between robots":

            def there() -> tuple[float, float]:
                pose = partner.world.pose
                return pose.x, pose.y

            self.conversation.link = InfraredLink(channel, self.arena, lambda: self.world.pose, there)

    def set_delivery_times(self) -> None:
        """Set the delivery time of each text that went to the partner. Call it after both programs have ended."""
        messages = self.conversation.messages
        for index, copies in self._passed_on:
            partner_messages = [self.partner.conversation.messages[copy] for copy in copies]
            delivered = min((copy.delivered for copy in partner_messages if copy.delivered is not None), default=None)
            message = replace(messages[index], delivered=delivered)
            if delivered is None and partner_messages:
                message = replace(message, note=message.note or partner_messages[0].note, lost=partner_messages[0].lost)
            messages[index] = message

    def _run_tick(self) -> None:
        """Run one tick. Errors that a program causes in our own code occur in its own turn and count as its fault."""
        _wait_for_partner()
        self.take_arrivals()
        movement = self.world.move()
        drive = self.world.drive
        self.partner.arena.place_partner(drive.x, drive.y, drive.heading)
        _wait_for_partner()
        self.world.sense(movement)

    def _send_text(self, text: str) -> int:
        sent_text = self.conversation.send(text, self.now)
        if self._spec.responder is None:
            self._pass_on(text, sent_text)
        elif sent_text.copies:
            self.questions.append(PendingText(sent_text, self.collect_logged_data()))
        return sent_text.message

    def _pass_on(self, text: str, sent_text: SentText) -> None:
        entry = None
        try:
            entry = message_format.format_partner_entry(text)
        except ValueError as error:
            sentence = f"the text begins with PY::JSON:: but is not JSON: {error}"
            self.conversation.faults.append(Fault(self.now / SECOND, Verdict.PROTOCOL_ERROR, "program", sentence))
        if entry is not None and sent_text.text != text:
            entry = _parse_partner_entry(sent_text.text)
        self._meter.charge_bytes(sent_text.copies * (len(text) + len(entry or "")))
        self._passed_on.append(
            (sent_text.message, self.conversation.pass_on(sent_text, entry, self.partner.conversation))
        )


FaultPair = tuple[Fault | None, Fault | None]


def serve_both(first: PairedBridge, second: PairedBridge, responder: ResponderProcess | None) -> FaultPair:
    """Serve both programs until they end. Return the fault of each, or None.

    A robot stands still after its program has ended, and the other program continues. Host faults and exceptions from
    the meter's heartbeat are raised from here, and neither program is left running.
    """
    bridges = first, second
    first.connect_partner(second)
    second.connect_partner(first)
    # All work stays in this thread, so heartbeats, signals and locks behave as for one robot.
    turns = [greenlet(bridge.run) for bridge in bridges]
    faults: dict[int, Fault | None] = {}
    try:
        while len(faults) < len(turns):
            _take_turns(turns, faults)  # both sense; their programs are served until the next tick
            if responder is not None:
                _answer_pending_texts(responder, bridges)
            _take_turns(turns, faults)  # both receive arrivals and move
    finally:
        for turn in turns:
            turn.throw()
    return faults[0], faults[1]


def _take_turns(turns: Sequence[greenlet], faults: dict[int, Fault | None]) -> None:
    """Resume each program until it waits for the other one. Store the fault of a program that ends."""
    for number, turn in enumerate(turns):
        if number not in faults:
            fault = turn.switch()
            if turn.dead:
                faults[number] = fault


def _wait_for_partner() -> None:
    getcurrent().parent.switch()


def _parse_partner_entry(corrupted: str) -> str | None:
    """Return the queue entry of a corrupted text, or None if it was JSON and no longer is."""
    try:
        return message_format.format_partner_entry(corrupted)
    except ValueError:
        return None


def _answer_pending_texts(responder: ResponderProcess, bridges: Sequence[PairedBridge]) -> None:
    """Answer the texts that both robots have sent since the last tick, in the order they were sent."""
    questions = [(bridge, question) for bridge in bridges for question in bridge.questions]
    for bridge, question in sorted(questions, key=lambda each: each[1].sent.t):
        sent_text, logged = question.sent, question.collected
        for copy in range(sent_text.copies):
            call_count = len(responder.calls)
            answer = responder.answer(sent_text.text, sent_text.t, sent_text.message, logged, bridge.number)
            bridge.calls += responder.calls[call_count:]
            bridge.conversation.record_answer(sent_text, copy, answer)
            logged = LoggedData()
    for bridge in bridges:
        bridge.questions.clear()
