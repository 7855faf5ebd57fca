"""The process of a responder during one trial. It receives texts and returns answers or faults.

It handles one message at a time. ``conversation.py`` decides which texts arrive and when the answers do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol

from responders import message_format, wire
from responders.answer_texts import (
    JSON_HINT,
    RETURN_HINT,
    build_length_fault,
    build_protocol_fault,
    build_text_answer,
)
from responders.conversation import Answer
from responders.faults import (
    build_error_fault,
    build_stop_fault,
    describe_refusal,
    describe_wrong_return,
    to_child_data_error,
)
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import ChildStopped, JobMeter
from responders.sandbox.served_child import ServedChild
from responders.trial_spec import EarlierAnswer, ResponderSpec
from sim.random_streams import RandomStream
from sim.recording import AgentMessage, Call, Fault, Verdict

_MAX_NOTES = 200
#: Maximum number of recorded calls, and of characters in each of their parts.
_MAX_CALLS, _MAX_RECORDED_LENGTH = 10_000, 200


@dataclass(frozen=True, slots=True)
class LoggedData:
    """Data and images that a robot has logged. A data entry is name, value, the program's time or None, and the time.

    Images are texts ``left 245,226,... 30``: side, RGBA numbers, tick, as the course's kit stores them.
    """

    data: tuple[tuple[str, float, float | None, float], ...] = ()
    images: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class AgentReply:
    """Reply to a question: a JSON value or an error message to raise in the asker, and how long the agent slept."""

    kind: Literal["value", "error"]
    text: str
    slept: int = 0


class AskableAgents(Protocol):
    """The agents of a trial, as a responder sees them (``agents.py``)."""

    messages: list[AgentMessage]

    def list_askable_agents(self, asker: str) -> Sequence[str]:
        """Return the names of the agents that ``asker`` may ask."""

    def ask(self, asker: str, question: wire.Frame, t: int, message: int) -> AgentReply:
        """Return the reply to a question."""


class ResponderProcess:
    """The process of a responder during one trial. ``answer`` raises no exception for errors in student code."""

    _schema = wire.RESPONDER
    _who = "responder"

    def __init__(
        self,
        spec: ResponderSpec,
        sandboxes: Sandboxes,
        folder: Path,
        seed: int,
        meter: JobMeter,
        agents: AskableAgents | None = None,
    ) -> None:
        """Start the process. ``agents`` are the agents that it may ask."""
        self._spec = spec
        self._earlier_answers = iter(spec.earlier_answers)
        self._agents = agents
        if agents is not None:
            self._schema = wire.RESPONDER_WITH_AGENTS
        self._folder = folder
        self._meter = meter
        self.output: list[str] = []
        self._output_left = spec.output_bytes
        self.calls: list[Call] = []
        self.notes: list[str] = []
        self._message = -1  # index of the message that is being answered
        self._asked_at = 0  # time of the request for that answer
        self._slept = 0  # time slept since then
        self._watches = True  # whether executed statements are collected now
        for name, data in spec.files.items():
            (folder / name).write_bytes(data)
        self._child: ServedChild | None = sandboxes.spawn(spec.role, spec.limits, folder, meter)
        self.sandbox = self._child.sandbox
        self._seed = seed

    def load(self) -> Fault | None:
        """Load the module. Return the fault if it cannot answer, otherwise None."""
        assert self._child is not None
        try:
            self._child.send(self._build_first_frame())
            frame = self._receive_until("ready")
        except ChildStopped as stop:
            return self._convert_stop(stop, 0)
        except Exception as error:
            return self._convert_stop(to_child_data_error(error), 0)
        if frame["error"] is not None:
            self.close()
            return build_error_fault(frame["error"], 0, self._who)
        return None

    def _build_first_frame(self) -> dict[str, Any]:
        """Return the first frame for the child."""
        return {
            "name": self._spec.code.name,
            "text": self._spec.code.text,
            "seed": RandomStream(self._seed, "responder").integer(0),
            "function": self._spec.function,
            **self._build_agents_entry(),
            **({"watch": True} if self._spec.executed_statements is not None else {}),
        }

    def _build_agents_entry(self) -> dict[str, Any]:
        """Return the agent names for the first frame, or nothing if there are no agents."""
        return {"agents": self._agents.list_askable_agents("responder")} if self._agents is not None else {}

    @property
    def is_alive(self) -> bool:
        """Return whether the child is running."""
        return self._child is not None

    def answer(self, text: str, t: int, message: int, logged_data: LoggedData, sender: int | None = None) -> Answer:
        """Return the responder's answer to ``text``.

        Args:
            text: The text as it arrived.
            t: The time, in units of simulated time.
            message: The index of the message.
            logged_data: The data that the robot has logged since the last text.
            sender: The number of the robot, in a trial of two.
        """
        answer = self._ask_child(text, t, message, logged_data, sender)
        earlier_answer = next(self._earlier_answers, None)
        return answer if earlier_answer is None else self._repeat_answer(earlier_answer)

    def _ask_child(self, text: str, t: int, message: int, logged_data: LoggedData, sender: int | None) -> Answer:
        if self._child is None:
            return Answer()
        self._message, self._asked_at, self._slept = message, t, 0
        try:
            frame = {"do": "message", "t": t, "text": text, "data": logged_data.data, "images": logged_data.images}
            self._child.send(frame if sender is None else {**frame, "sender": sender})
            return self._parse_answer(self._receive_until("answer"), t)
        except ChildStopped as stop:
            return Answer(fault=self._convert_stop(stop, t))
        except Exception as error:
            return Answer(fault=self._convert_stop(to_child_data_error(error), t))

    def _repeat_answer(self, earlier_answer: EarlierAnswer) -> Answer:
        """Return an answer from an earlier recording. Its faults are not repeated."""
        text, slept = earlier_answer.text, earlier_answer.slept
        if text is None or not text.startswith(message_format.JSON):
            return Answer(text, slept)
        try:
            entry = message_format.format_queue_entry(text)
        except ValueError:
            return Answer(text, slept, note="malformed")
        self._meter.charge_bytes(len(entry))
        return Answer(text, slept, entry=entry)

    def close(self) -> None:
        """Close the child, if there is one."""
        if self._child is not None:
            self._child.close()
            self._child = None

    def _parse_answer(self, frame: wire.Frame, t: int) -> Answer:
        """Return the answer in a frame. A valid ``JSON::`` text also has an entry for the robot's queue."""
        text = frame["error"]["text"] if frame["kind"] == "error" else frame.get("text", "")
        self._charge_output(text, "printed and answered")
        match frame["kind"]:
            case "text":
                return build_text_answer(text, t, self._slept, self._meter, self._agent)
            case "error":
                return Answer(fault=build_error_fault(frame["error"], t + self._slept, "responder"))
            case "long":
                return Answer(fault=build_length_fault(frame["length"], t + self._slept, self._agent))
        description = f"{frame['type'][:_MAX_RECORDED_LENGTH]} instead of a text; an answer has to be a str"
        hint = RETURN_HINT if frame["type"] == "NoneType" else JSON_HINT
        return Answer(fault=self._build_protocol_fault(t, describe_wrong_return(description), hint))

    @property
    def _agent(self) -> str:
        """Return the name of the agent in faults; empty for the responder itself."""
        return "" if self._who == "responder" else self._who

    def _build_protocol_fault(self, t: int, sentence: str, hint: str = "") -> Fault:
        return build_protocol_fault(t + self._slept, sentence, hint, self._agent)

    def _receive_until(self, final_kind: str) -> wire.Frame:
        assert self._child is not None
        while True:
            frame = self._child.receive(self._schema)
            if frame["do"] == final_kind:
                return frame
            self._accept_frame(frame)

    def _accept_frame(self, frame: wire.Frame) -> None:
        """Process a frame that needs no reply.

        Raises:
            ChildStopped: If the frame is not allowed now.
        """
        match frame["do"]:
            case "print":
                self._print(frame["text"])
            case "refused":
                self._add_note(describe_refusal(self._who, frame))
            case "ran":
                if self._spec.executed_statements is not None and self._watches:
                    self._spec.executed_statements.add(frame)
            case "sleep":
                self._slept += frame["units"]
            case "call":
                if len(self.calls) < _MAX_CALLS:
                    texts = {
                        name: frame[name][:_MAX_RECORDED_LENGTH] for name in ("caller", "callee", "argument", "result")
                    }
                    message_count = len(self._agents.messages) if self._agents is not None else 0
                    self.calls.append(Call(self._message, frame["depth"], before=message_count, **texts))
            case "ask" if self._agents is not None and self._child is not None:
                reply = self._agents.ask(self._who, frame, self._asked_at + self._slept, self._message)
                self._slept += reply.slept
                now = self._asked_at + self._slept
                self._child.send({"do": "told", "t": now, "kind": reply.kind, "text": reply.text})
            case kind:
                raise ChildStopped(Verdict.SANDBOX_VIOLATION, f"the {self._who}'s process sent a stray {kind} frame")

    def _add_note(self, sentence: str) -> None:
        if len(self.notes) < _MAX_NOTES and sentence not in self.notes:
            self.notes.append(sentence)

    def _print(self, text: str) -> None:
        self._charge_output(text, "printed")
        self.output.append(text)

    def _charge_output(self, text: str, deed: str) -> None:
        self._output_left -= len(text.encode("utf-8", "replace")) + 1
        if self._output_left < 0:
            raise ChildStopped(
                Verdict.OUTPUT_LIMIT, f"the {self._who} {deed} more than {self._spec.output_bytes} bytes"
            )

    def _convert_stop(self, stop: ChildStopped, t: int) -> Fault:
        self.close()
        return build_stop_fault(stop, self._who, t)
