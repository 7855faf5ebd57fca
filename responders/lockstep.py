"""Serves two robot programs in the same simulated time: each up to the next tick, the first robot's first.

What one program may ask is ``bridge.py``'s; children are set up and recordings made in ``pair.py``.
"""

from __future__ import annotations

from dataclasses import replace

from greenlet import getcurrent, greenlet

from responders import message_format
from responders.bridge import Bridge
from responders.conversation import Answer
from responders.responder_process import Collected, ResponderProcess
from responders.sandbox.meter import JobMeter
from responders.sandbox.running_child import Child
from responders.trial_spec import TrialSpec
from sim.camera import LightCamera
from sim.recording import SECOND, Call, Fault, Verdict
from sim.shared_arena import SharedArena


class AskedBy:
    """A responder as one of two robots has it: it is told who speaks, and what it calls then is that robot's."""

    def __init__(self, responder: ResponderProcess, number: int) -> None:
        self._responder = responder
        self._number = number
        self.calls: list[Call] = []

    def answer(self, text: str, t: int, message: int, collected: Collected) -> Answer:
        """As ``ResponderProcess.answer``."""
        before = len(self._responder.calls)
        answer = self._responder.answer(text, t, message, collected, self._number)
        self.calls += self._responder.calls[before:]
        return answer


class PairedBridge(Bridge):
    """Serves one of two programs, and at each tick waits for the other; without a responder they talk to each other."""

    def __init__(
        self,
        spec: TrialSpec,
        arena: SharedArena,
        camera: LightCamera,
        child: Child,
        responder: AskedBy | None,
        meter: JobMeter,
    ) -> None:
        super().__init__(spec, arena, camera, child, responder, meter)
        self.arena = arena
        self.calls = responder.calls if responder is not None else []
        self._passed_on: list[tuple[int, tuple[int, ...]]] = []  # a text, and its copies among the partner's messages

    def meet(self, partner: PairedBridge) -> None:
        """From now on this robot and ``partner`` know of each other."""
        self.partner = partner

    def settle(self) -> None:
        """Both programs have ended: when did the partner hear each text, if it did?"""
        messages = self.conversation.messages
        for index, copies in self._passed_on:
            heard = [self.partner.conversation.messages[copy].delivered for copy in copies]
            delivered = min((t for t in heard if t is not None), default=None)
            note = messages[index].note or ("" if delivered is not None else "undelivered")
            messages[index] = replace(messages[index], delivered=delivered, note=note)

    def _tick(self) -> None:
        getcurrent().parent.switch()

    def _send(self, text: str) -> int:
        if self._responder is not None:
            return super()._send(text)
        sent = self.conversation.send(text, self.now)
        entry = None
        try:
            entry = message_format.passed_on(text)
        except ValueError as error:
            sentence = f"the text begins with PY::JSON:: but is not JSON: {error}"
            self.conversation.faults.append(Fault(self.now / SECOND, Verdict.PROTOCOL_ERROR, "program", sentence))
        self._meter.keep(sent.copies * (len(text) + len(entry or "")))
        self._passed_on.append((sent.message, self.conversation.pass_on(sent, entry, self.partner.conversation)))
        return sent.message


def serve_both(first: PairedBridge, second: PairedBridge) -> tuple[Fault | None, Fault | None]:
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
            for number, turn in enumerate(turns):
                if number in faults:
                    continue
                result = turn.switch()
                if turn.dead:
                    faults[number] = result
            _tick([bridge for number, bridge in enumerate(bridges) if number not in faults])
    finally:
        for turn in turns:
            turn.throw()
    return faults[0], faults[1]


def _tick(waiting: list[PairedBridge]) -> None:
    """All that has arrived is taken, then all robots move, then all look round."""
    for bridge in waiting:
        bridge.take_arrivals()
    moved = []
    for bridge in waiting:
        moved.append(bridge.world.move())
        drive = bridge.world.drive
        bridge.partner.arena.place_partner(drive.x, drive.y, drive.heading)
    for bridge, elsewhere in zip(waiting, moved, strict=True):
        bridge.world.sense(elsewhere)
