"""The agents of a submission during one trial, and the questions that they and the responder ask each other.

Each agent runs in its own process. All questions pass through this module, one at a time. The bridge decides which
robot messages reach the responder in the first place.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from responders import wire
from responders.faults import build_error_fault, to_child_data_error
from responders.logger_file import read_log
from responders.responder_process import AgentReply, ResponderProcess
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import ChildStopped, JobMeter
from responders.trial_spec import AgentSpec
from sim.random_streams import RandomStream
from sim.readers.json_text import read_json
from sim.readers.reader_errors import UnreadableDataError
from sim.recording import SECOND, AgentMessage, AgentOutput, Fault, Recording, Verdict
from sim.world import HashChain

#: Maximum number of questions per trial between the responder and its agents.
_MAX_QUESTIONS = 10_000
_MAX_NOTES = 200
_MAX_TYPE_LENGTH = 100
_INVALID_JSON = object()


@dataclass(frozen=True, slots=True)
class AgentCounts:
    """Counts of agent messages, faults and calls at one point in the trial."""

    messages: int = 0
    faults: int = 0
    calls: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))  # by agent


class Agents:
    """All agents of one trial or notebook.

    ``ask`` raises no exception for faults of an agent; it records them and returns an error.
    """

    def __init__(
        self,
        specs: Mapping[str, AgentSpec],
        seed: int,
        sandboxes: Sandboxes,
        meter: JobMeter,
        stack: contextlib.ExitStack,
    ) -> None:
        """Start one process and one private folder per agent; both are closed with ``stack``."""
        self.messages: list[AgentMessage] = []
        self.faults: list[Fault] = []
        self.notes: list[str] = []
        self._meter = meter
        self._chain = HashChain()
        self._outputs: list[AgentOutput] = []
        self._waiting: list[str] = []  # agents that are waiting for an answer, outermost first
        self._loaded = False
        self._unloadable = 0  # number of faults from loading
        self._processes: dict[str, AgentProcess] = {}
        for name, agent_spec in specs.items():
            folder = stack.enter_context(sandboxes.open_private_folder())
            self._processes[name] = AgentProcess(name, agent_spec, sandboxes, folder, seed, meter, self)
            stack.callback(self._processes[name].close)

    def list_askable_agents(self, asker: str) -> Sequence[str]:
        """Return the names of the agents that ``asker`` (the responder or an agent) may ask."""
        return [name for name in self._processes if name != asker]

    def load(self) -> None:
        """Load the module of each agent. Questions are refused until all agents are loaded."""
        for name, process in self._processes.items():
            fault = process.load()
            if fault is not None and process.given:
                sentence = f"the given agent {name} cannot be used: {fault.message}"
                fault = replace(fault, verdict=Verdict.ASSIGNMENT_ERROR, message=sentence)
            if fault is not None:
                self.faults.append(fault)
        self._loaded = True
        self._unloadable = len(self.faults)

    def collect_faults_since(self, earlier_counts: AgentCounts) -> Sequence[Fault]:
        """Return all loading faults, and the other faults recorded since ``earlier_counts``."""
        return (*self.faults[: self._unloadable], *self.faults[max(earlier_counts.faults, self._unloadable) :])

    def ask(self, asker: str, question: wire.Frame, t: int, message: int) -> AgentReply:
        """Ask the agent named in ``question`` and return its reply.

        Args:
            asker: The responder or the agent that asks.
            question: The frame with the agent's name and the arguments.
            t: The time of the question, in units of simulated time.
            message: The index of the robot's message that is being answered.

        Raises:
            ChildStopped: If the frame is invalid, or the limit on questions is exceeded.
        """
        name = question["agent"]
        process = self._processes.get(name)
        if process is None:
            raise ChildStopped(Verdict.SANDBOX_VIOLATION, "it asked an agent that this assignment does not have")
        if len(self.messages) >= 2 * _MAX_QUESTIONS:
            raise ChildStopped(Verdict.OUTPUT_LIMIT, f"it and the agents asked more than {_MAX_QUESTIONS} questions")
        arguments, keywords = _parse_content(question["arguments"], list), _parse_content(question["named"], dict)
        values = [*arguments, *keywords.values()]
        index = len(self.messages)
        self._record_message(asker, name, values[0] if len(values) == 1 else values, t, message)
        reply = self._find_refusal(asker, name)
        if reply is None:
            self._waiting.append(name)
            try:
                reply = process.answer_question(question, t, message)
            finally:
                self._waiting.pop()
        if reply.kind == "error":
            self.messages[index] = replace(self.messages[index], note="no answer")
        else:
            self._record_message(name, asker, _parse_content(reply.text, object), t + reply.slept, message, index)
        return reply

    def count_events(self) -> AgentCounts:
        """Return the current counts of messages, faults and calls."""
        calls = {name: len(process.calls) for name, process in self._processes.items()}
        return AgentCounts(len(self.messages), len(self.faults), MappingProxyType(calls))

    def seal(self, chain: HashChain, now: int) -> None:
        """Add the digest of all agent messages so far to the hash chain of a run that ends."""
        chain.add("agents", now, self._chain.hexdigest().encode())

    def finish(self) -> None:
        """End the agents' processes and collect their output, logs and notes."""
        for name, process in self._processes.items():
            process.close()
            log, log_fault = read_log(process.folder, self._meter, name)
            if log_fault is not None:
                self.faults.append(log_fault)
            self._outputs.append(AgentOutput(name, "\n".join(process.output), log))
            self.notes += process.notes

    def add_messages_and_calls(self, recording: Recording, earlier_counts: AgentCounts) -> Recording:
        """Return the recording with the agent messages and calls since ``earlier_counts``."""
        messages = [
            replace(each, reply_to=None if each.reply_to is None else each.reply_to - earlier_counts.messages)
            for each in self.messages[earlier_counts.messages :]
        ]
        new_calls = [
            call
            for name, process in self._processes.items()
            for call in process.calls[earlier_counts.calls.get(name, 0) :]
        ]
        calls = [replace(call, before=call.before - earlier_counts.messages) for call in new_calls]
        return replace(
            recording,
            calls=tuple(sorted((*recording.calls, *calls), key=lambda call: (call.message, call.before))),
            agent_messages=tuple(messages),
        )

    def add_outputs(self, recording: Recording) -> Recording:
        """Return the recording with the output and logs of all agents. Call ``finish`` first."""
        return replace(recording, agent_outputs=tuple(self._outputs))

    def record_failure(self, name: str, fault: Fault, reason: str, slept: int) -> AgentReply:
        """Return the error that the asker receives when agent ``name`` fails.

        Records the fault, unless a given agent failed but is still running: the asker may have caused that, so it
        becomes a note.
        """
        process = self._processes[name]
        sentence = f"{name} gave no answer: {reason}"
        if not process.given or not process.is_alive:
            self.faults.append(fault)
        elif len(self.notes) < _MAX_NOTES and f"the given agent {sentence}" not in self.notes:
            self.notes.append(f"the given agent {sentence}")
        return AgentReply("error", sentence, slept)

    def _find_refusal(self, asker: str, name: str) -> AgentReply | None:
        if not self._loaded:
            return AgentReply("error", f"{name} cannot be asked while the agents are being loaded, only in a function")
        if name in self._waiting or name == asker:
            waiting_chain = " → ".join(["responder", *self._waiting, name])
            return AgentReply("error", f"{name} cannot be asked now, as it waits for an answer itself: {waiting_chain}")
        return None

    def _record_message(
        self, sender: str, receiver: str, value: Any, t: int, message: int, reply_to: int | None = None
    ) -> None:
        text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
        text = text.encode("utf-8", "replace").decode("utf-8")  # replace lone surrogates, which can't be stored
        self._meter.charge_bytes(len(text))
        self.messages.append(
            AgentMessage(t / SECOND, sender, receiver, text, message, reply_to, is_text=isinstance(value, str))
        )
        kind = "text" if isinstance(value, str) else "value"
        self._chain.add(f"{sender}>{receiver} {kind}", t, text.encode())


@contextlib.contextmanager
def running_agents(
    specs: Mapping[str, AgentSpec], seed: int, sandboxes: Sandboxes, meter: JobMeter
) -> Iterator[Agents | None]:
    """Yield the agents, loaded in fresh processes, or None if there are none."""
    with contextlib.ExitStack() as stack:
        if not specs:
            yield None
            return
        agents = Agents(specs, seed, sandboxes, meter, stack)
        agents.load()
        yield agents


class AgentProcess(ResponderProcess):
    """The process of one agent. It answers questions with values instead of texts."""

    def __init__(
        self,
        name: str,
        spec: AgentSpec,
        sandboxes: Sandboxes,
        folder: Path,
        seed: int,
        meter: JobMeter,
        agents: Agents,
    ) -> None:
        super().__init__(spec, sandboxes, folder, seed, meter, agents)
        self._schema = wire.AGENT
        self._who = name
        self._all = agents
        self._ended: AgentReply | None = None
        self.given = spec.given
        self.folder = folder

    def answer_question(self, question: wire.Frame, t: int, message: int) -> AgentReply:
        """Return the agent's reply to a question. Raises no exception for errors in student code."""
        if self._child is None:
            return self._ended or AgentReply("error", f"{self._who} gave no answer: it could not be loaded")
        self._message, self._asked_at, self._slept = message, t, 0
        try:
            self._child.send({"do": "asked", "t": t, "arguments": question["arguments"], "named": question["named"]})
            return self._parse_reply(self._receive_until("returned"))
        except ChildStopped as stopped:
            stop = stopped
        except Exception as error:
            stop = to_child_data_error(error)
        fault = self._convert_stop(stop, t + self._slept)
        reply = self._all.record_failure(self._who, fault, stop.message, self._slept)
        self._ended = replace(reply, slept=0)
        return reply

    def _build_first_frame(self) -> dict[str, Any]:
        seed = RandomStream(self._seed, f"agent {self._who}").integer(0)
        return {
            **super()._build_first_frame(),
            "agent": self._who,
            "agents": self._all.list_askable_agents(self._who),
            "seed": seed,
        }

    def _parse_reply(self, frame: wire.Frame) -> AgentReply:
        match frame:
            case {"kind": "value", "text": text}:
                _parse_content(text, object)
                return AgentReply("value", text, self._slept)
            case {"kind": "error", "error": error}:
                fault = build_error_fault(error, self._asked_at + self._slept, self._who)
                # A RuntimeError reports the fault of another agent. Only the original cause is passed on.
                reason = str(error["text"] or fault.message) if error["type"] == "RuntimeError" else fault.message
                return self._all.record_failure(self._who, fault, reason, self._slept)
            case {"kind": "other", "type": kind}:
                sentence = f"the {self._who} returned {kind[:_MAX_TYPE_LENGTH]}, which no message can hold"
                fault = self._build_protocol_fault(self._asked_at, sentence)
            case {"kind": "long", "length": length}:
                sentence = f"the {self._who} returned {length} characters of JSON; the most is about 60000"
                fault = self._build_protocol_fault(self._asked_at, sentence)
            case _:
                raise ChildStopped(Verdict.SANDBOX_VIOLATION, "it sent an answer without its content")
        return self._all.record_failure(self._who, fault, sentence, self._slept)


def _parse_content(text: str, kind: type) -> Any:
    """Return the decoded JSON content of a message.

    Raises:
        ChildStopped: If the text is not valid JSON or not of type ``kind``.
    """
    try:
        value = read_json(text, parse_constant=_reject_constant)
    except UnreadableDataError as error:
        raise ChildStopped(Verdict.PROTOCOL_ERROR, f"it sent a message that cannot be read: {error}") from None
    except ValueError:
        value = _INVALID_JSON
    if value is _INVALID_JSON or not isinstance(value, kind):
        raise ChildStopped(Verdict.PROTOCOL_ERROR, "it sent a message that is no JSON")
    return value


def _reject_constant(name: str) -> None:
    raise ValueError(f"{name} is not JSON")
