"""Serves two robot programs in the same simulated time: each up to the next tick, the first robot's first.

What one program may ask is ``bridge.py``'s; children are set up and recordings made in ``pair.py``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from greenlet import getcurrent, greenlet

from responders import message_format
from responders.bridge import Bridge
from responders.conversation import Sent
from responders.link import InfraredLink
from responders.responder_process import Collected, ResponderProcess
from responders.sandbox.meter import JobMeter
from responders.sandbox.running_child import ServedChild
from responders.trial_spec import TrialSpec
from sim.camera import LightCamera
from sim.recording import SECOND, Call, Fault, Verdict
from sim.shared_arena import SharedArena


@dataclass(frozen=True, slots=True)
class Question:
    """A text for the responder, with what its robot had logged when it was sent."""

    sent: Sent
    collected: Collected


class PairedBridge(Bridge):
    """Serves one of two programs, and at each tick waits for the other one to come as far.

    What it says to the responder is kept until then, as the other may have said something before; where there is
    none, it goes to the other robot.
    """

    def __init__(
        self, spec: TrialSpec, arena: SharedArena, camera: LightCamera, child: ServedChild, meter: JobMeter
    ) -> None:
        super().__init__(spec, arena, camera, child, None, meter)
        self.arena = arena
        self.number = spec.number
        self.questions: list[Question] = []
        self.calls: list[Call] = []
        self._passed_on: list[tuple[int, tuple[int, ...]]] = []  # a text, and its copies among the partner's messages

    def meet(self, partner: PairedBridge) -> None:
        """From now on this robot and ``partner`` know of each other."""
        self.partner = partner
        channel = self._spec.channel
        if channel.link == "between robots":

            def there() -> tuple[float, float]:
                pose = partner.world.pose
                return pose.x, pose.y

            self.conversation.link = InfraredLink(channel, self.arena, lambda: self.world.pose, there)

    def settle(self) -> None:
        """Both programs have ended: when did the partner hear each text, if it did?"""
        messages = self.conversation.messages
        for index, copies in self._passed_on:
            heard = [self.partner.conversation.messages[copy] for copy in copies]
            delivered = min((copy.delivered for copy in heard if copy.delivered is not None), default=None)
            message = replace(messages[index], delivered=delivered)
            if delivered is None and heard:
                message = replace(message, note=message.note or heard[0].note, lost=heard[0].lost)
            messages[index] = message

    def _tick(self) -> None:
        """Whatever a program makes our own code stumble over, it does in its own turn, and is its own fault."""
        _wait_for_partner()
        self.take_arrivals()
        moved = self.world.move()
        drive = self.world.drive
        self.partner.arena.place_partner(drive.x, drive.y, drive.heading)
        _wait_for_partner()
        self.world.sense(moved)

    def _send(self, text: str) -> int:
        sent = self.conversation.send(text, self.now)
        if self._spec.responder is None:
            self._pass_on(text, sent)
        elif sent.copies:
            self.questions.append(Question(sent, self.collected()))
        return sent.message

    def _pass_on(self, text: str, sent: Sent) -> None:
        entry = None
        try:
            entry = message_format.passed_on(text)
        except ValueError as error:
            sentence = f"the text begins with PY::JSON:: but is not JSON: {error}"
            self.conversation.faults.append(Fault(self.now / SECOND, Verdict.PROTOCOL_ERROR, "program", sentence))
        if entry is not None and sent.text != text:
            entry = _entry_of(sent.text)
        self._meter.keep(sent.copies * (len(text) + len(entry or "")))
        self._passed_on.append((sent.message, self.conversation.pass_on(sent, entry, self.partner.conversation)))


Faults = tuple[Fault | None, Fault | None]


def serve_both(first: PairedBridge, second: PairedBridge, responder: ResponderProcess | None) -> Faults:
    """Serve both programs until they have ended; what cut each short or went wrong, if anything.

    One that has ended leaves its robot standing, and the other goes on. Whatever is raised for the machine's sake, or
    by the meter's heartbeat, comes from here, and leaves neither program half served.
    """
    bridges = first, second
    first.meet(second)
    second.meet(first)
    # Everything is done in this one thread, so that heartbeats, signals and locks are where they are for one robot.
    turns = [greenlet(bridge.run) for bridge in bridges]
    faults: dict[int, Fault | None] = {}
    try:
        while len(faults) < len(turns):
            _take_turns(turns, faults)  # both look round, and their programs are served until the next tick
            if responder is not None:
                _ask(responder, bridges)
            _take_turns(turns, faults)  # both take what has arrived, and move
    finally:
        for turn in turns:
            turn.throw()
    return faults[0], faults[1]


def _take_turns(turns: Sequence[greenlet], faults: dict[int, Fault | None]) -> None:
    """Each goes on until it waits for the other; one that has ended leaves what was its fault."""
    for number, turn in enumerate(turns):
        if number not in faults:
            fault = turn.switch()
            if turn.dead:
                faults[number] = fault


def _wait_for_partner() -> None:
    getcurrent().parent.switch()


def _entry_of(corrupted: str) -> str | None:
    """Nothing joins a queue of what was JSON before the channel corrupted it, and no longer is."""
    try:
        return message_format.passed_on(corrupted)
    except ValueError:
        return None


def _ask(responder: ResponderProcess, bridges: Sequence[PairedBridge]) -> None:
    """What both robots have said since the last tick is answered, in the order in which it was said."""
    asked = [(bridge, question) for bridge in bridges for question in bridge.questions]
    for bridge, question in sorted(asked, key=lambda each: each[1].sent.t):
        sent, logged = question.sent, question.collected
        for copy in range(sent.copies):
            before = len(responder.calls)
            answer = responder.answer(sent.text, sent.t, sent.message, logged, bridge.number)
            bridge.calls += responder.calls[before:]
            bridge.conversation.answer(sent, copy, answer)
            logged = Collected()
    for bridge in bridges:
        bridge.questions.clear()
