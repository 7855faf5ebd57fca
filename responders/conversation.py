"""The talk between a robot program and its responder: who said what when, and what is still under way.

It keeps the messages of one trial and asks the responder's process for answers; simulated time is the bridge's.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from responders import messages, wire
from responders.channel import Channel, ChannelOfTrial
from responders.code import Code
from responders.faults import error_fault, refusal, stopped, surprise
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import ChildStopped, JobMeter
from responders.sandbox.running_child import Child, ChildLimits
from sim.chance import Stream
from sim.recording import SECOND, Call, Fault, Message, Verdict
from sim.world import Chain

_MOST_NOTES = 200
#: Of the calls that are shown, and of the characters of each of their parts.
_MOST_CALLS, _MOST_SHOWN = 10_000, 200


@dataclass(frozen=True, slots=True)
class ResponderSpec:
    """What answers the robot: code and the files in its folder."""

    code: Code
    files: Mapping[str, bytes]
    limits: ChildLimits
    output_bytes: int
    function: str | None = None  # the name of the responder; by the module's own choice if not given


@dataclass(frozen=True, slots=True)
class Collected:
    """What a robot has logged: name, value, the program's time or None, and the time; and images as the kit keeps them.

    Images are texts ``left 245,226,... 30``: side, RGBA numbers, tick.
    """

    data: tuple[tuple[str, float, float | None, float], ...] = ()
    images: tuple[str, ...] = ()


def _nothing_collected() -> Collected:
    return Collected()


class ResponderProcess:
    """A responder's process during one trial; ``answer`` never raises for what the student's code does."""

    _schema = wire.RESPONDER

    def __init__(self, spec: ResponderSpec, sandboxes: Sandboxes, folder: Path, seed: int, meter: JobMeter) -> None:
        self._spec = spec
        self._folder = folder
        self.output: list[str] = []
        self._output_left = spec.output_bytes
        self.calls: list[Call] = []
        self.notes: list[str] = []
        #: What the robot has logged since it was last asked; set by the bridge that serves the robot.
        self.collected: Callable[[], Collected] = _nothing_collected
        for name, data in spec.files.items():
            (folder / name).write_bytes(data)
        self._child: Child | None = sandboxes.spawn("responder", spec.limits, folder, meter)
        self.sandbox = self._child.sandbox
        self._seed = seed

    def load(self) -> Fault | None:
        """Run the module. The fault that kept it from answering, if any."""
        assert self._child is not None
        try:
            self._child.send(
                {
                    "name": self._spec.code.name,
                    "text": self._spec.code.text,
                    "seed": Stream(self._seed, "responder").integer(0),
                    "function": self._spec.function,
                }
            )
            frame = self._until("ready", -1, [])
        except ChildStopped as stop:
            return self._stopped(stop, 0)
        except Exception as error:
            return self._stopped(surprise(error), 0)
        if frame["error"] is not None:
            self.close()
            return error_fault(frame["error"], 0, "responder")
        return None

    @property
    def alive(self) -> bool:
        return self._child is not None

    def answer(self, text: str, t: int, message: int) -> tuple[str | None, int, Fault | None]:
        """The answer to ``text``, if there is one; how long the responder slept; and what went wrong."""
        if self._child is None:
            return None, 0, None
        slept: list[int] = []
        try:
            logged = self.collected()
            self._child.send({"do": "message", "t": t, "text": text, "data": logged.data, "images": logged.images})
            frame = self._until("answer", message, slept)
            said = frame["error"]["text"] if frame["kind"] == "error" else frame.get("text", "")
            self._spend(said, "printed and answered")
        except ChildStopped as stop:
            return None, 0, self._stopped(stop, t)
        except Exception as error:
            return None, 0, self._stopped(surprise(error), t)
        answered = t + sum(slept)
        if frame["kind"] == "text":
            return frame["text"], sum(slept), None
        if frame["kind"] == "error":
            return None, 0, error_fault(frame["error"], answered, "responder")
        what = (
            f"an answer of {frame['length']} characters; the most is about 60000"
            if frame["kind"] == "long"
            else f"{frame['type'][:_MOST_SHOWN]} instead of a text; an answer has to be a str"
        )
        sentence = f"the responder returned {what}"
        return None, 0, Fault(answered / SECOND, Verdict.PROTOCOL_ERROR, "responder", sentence)

    def close(self) -> None:
        if self._child is not None:
            self._child.close()
            self._child = None

    def _until(self, last: str, message: int, slept: list[int]) -> wire.Frame:
        assert self._child is not None
        while True:
            frame = self._child.receive(self._schema)
            if frame["do"] == last:
                return frame
            self._take(frame, message, slept)

    def _take(self, frame: wire.Frame, message: int, slept: list[int]) -> None:
        """A frame that waits for nothing. Raises ChildStopped for one that no honest child sends now."""
        match frame["do"]:
            case "print":
                self._print(frame["text"])
            case "refused":
                self._note(refusal("responder", frame))
            case "sleep":
                slept[:] = [sum(slept) + frame["units"]]
            case "call":
                if len(self.calls) < _MOST_CALLS:
                    words = (frame[name][:_MOST_SHOWN] for name in ("caller", "callee", "argument", "result"))
                    self.calls.append(Call(message, frame["depth"], *words))
            case kind:
                raise ChildStopped(Verdict.SANDBOX_VIOLATION, f"the responder's process sent a stray {kind} frame")

    def _note(self, sentence: str) -> None:
        if len(self.notes) < _MOST_NOTES and sentence not in self.notes:
            self.notes.append(sentence)

    def _print(self, text: str) -> None:
        self._spend(text, "printed")
        self.output.append(text)

    def _spend(self, text: str, did: str) -> None:
        self._output_left -= len(text.encode("utf-8", "replace")) + 1
        if self._output_left < 0:
            raise ChildStopped(Verdict.OUTPUT_LIMIT, f"the responder {did} more than {self._spec.output_bytes} bytes")

    def _stopped(self, stop: ChildStopped, t: int) -> Fault:
        self.close()
        return stopped(stop, "responder", t)


class Conversation:
    """All messages of one trial, and the answers that are still under way. Times are units of simulated time."""

    def __init__(
        self, channel: Channel, seed: int, chain: Chain, responder: ResponderProcess | None, meter: JobMeter
    ) -> None:
        self._meter = meter
        self._line = ChannelOfTrial(channel, seed)
        self._chain = chain
        self._responder = responder
        self._under_way: list[tuple[int, int, int]] = []  # due, order, index of the message
        self._queued: dict[int, str] = {}  # by index of the message: what joins the robot's queue, as JSON
        self._texts = 0
        self.messages: list[Message] = []
        self.faults: list[Fault] = []

    def send(self, text: str, now: int) -> int:
        """The robot says ``text``; the responder answers at once, and the answer sets out. The message's index."""
        number = self._texts
        self._texts += 1
        copies = self._line.copies(number)
        index = len(self.messages)
        self.messages.append(
            Message(
                now / SECOND,
                "robot",
                text,
                now / SECOND if copies else None,
                note="" if copies == 1 else "duplicated" if copies else "lost",
            )
        )
        self._chain.add("message", now, text.encode())
        for copy in range(copies):
            self._answer(text, now, index, number, copy)
        return index

    def deliver(self, now: int) -> list[str]:
        """Everything due at the tick at ``now``, in order; what joins the robot's queue of it, as JSON."""
        arrived = []
        while self._under_way and self._under_way[0][0] <= now:
            _, _, index = heapq.heappop(self._under_way)
            message = self.messages[index] = replace(self.messages[index], delivered=now / SECOND)
            self._chain.add("answer", now, message.text.encode())
            if index in self._queued:
                arrived.append(self._queued.pop(index))
        return arrived

    def finish(self) -> None:
        """The program has ended: what is still under way will never arrive."""
        for _, _, index in self._under_way:
            self.messages[index] = replace(self.messages[index], note="undelivered")
        self._under_way.clear()
        self._queued.clear()

    def _answer(self, text: str, now: int, question: int, number: int, copy: int) -> None:
        answer: str | None
        if self._responder is None:
            answer, slept, fault = f"pingpong {text}", 0, None
            self._meter.keep(len(answer))
        else:
            answer, slept, fault = self._responder.answer(text, now, question)
        if fault is not None:
            self.faults.append(fault)
        if answer is None:
            return
        queued, note = self._queue_entry(answer, now + slept)
        t = (now + slept) / SECOND
        arrivals = self._line.arrivals(number, copy, now, slept)
        if not arrivals:
            self.messages.append(Message(t, "responder", answer, None, question, note or "lost"))
        for place, due in enumerate(arrivals):
            index = len(self.messages)
            self.messages.append(
                Message(t, "responder", answer, None, question, note or ("duplicated" if place else ""))
            )
            if queued is not None:
                self._queued[index] = queued
            heapq.heappush(self._under_way, (due, index, index))

    def _queue_entry(self, answer: str, now: int) -> tuple[str | None, str]:
        """What joins the robot's queue when the answer arrives, if anything does; and a note if it is malformed."""
        if not answer.startswith(messages.JSON):
            return None, ""
        try:
            entry = messages.queue_entry(answer)
        except ValueError as error:
            sentence = f"the responder's answer begins with JSON:: but is not JSON: {error}"
            self.faults.append(Fault(now / SECOND, Verdict.PROTOCOL_ERROR, "responder", sentence))
            return None, "malformed"
        self._meter.keep(len(entry))
        return entry, ""
