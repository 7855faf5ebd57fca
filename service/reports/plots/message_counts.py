"""Message and call counts of a trial by sender and receiver: the robot, the responder, its agents, and callees.

``sequence.py`` has the texts. This module only counts, and includes only the first fifty calls of a message.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from service.language import ENGLISH, Language
from service.reports.display_text import to_one_line
from service.reports.messages import PARTNER_OF, SECOND, format_party_name, iterate_robots
from service.reports.plots.sequence import PARTIES, SequenceDiagram, Step
from sim.recording import Call, Recording
from submissions.diagram import Diagram, DiagramActor, DiagramArrow, Divider

#: Networks that are counted by name. Networks called later are counted together.
_MAX_NETWORKS = 4
_OTHER_NETWORKS = "other networks"
#: The longest label of a message, beside a diagram with words as labels.
_MAX_LABEL_LENGTH = 32
_NAMED = frozenset(PARTIES) - {"network"}

MessageKind = Literal["message", "call", "return"]


@dataclass(frozen=True, slots=True)
class MessageCount:
    """The number of messages or calls from ``source`` to ``target``, and how many were lost."""

    source: str
    target: str
    kind: MessageKind
    count: int
    lost: int = 0


def count_messages(recording: Recording) -> tuple[MessageCount, ...]:
    """Return the counts by sender and receiver, messages first."""
    counts: Counter[tuple[str, str, MessageKind]] = Counter()
    lost_counts: Counter[tuple[str, str, MessageKind]] = Counter()
    for message_key, is_delivered in _iterate_messages(recording):
        counts[message_key] += 1
        lost_counts[message_key] += not is_delivered
    return tuple(MessageCount(*talk, count, lost_counts[talk]) for talk, count in counts.items())


def _iterate_messages(recording: Recording) -> Iterator[tuple[tuple[str, str, MessageKind], bool]]:
    """Yield sender, receiver and kind of each message and call, and whether it arrived."""
    for robot, robot_recording in iterate_robots(recording):
        for message in robot_recording.messages:
            other_party = PARTNER_OF[robot] if message.to_partner else "responder"
            if message.sender != "partner":  # the other robot's list has it
                route = (robot, other_party) if message.sender == "robot" else (other_party, robot)
                yield (*route, "message"), message.delivered is not None
    calls = [call for _, own in iterate_robots(recording) for call in own.calls]
    names = _name_callees(calls, (each.agent for each in recording.agent_outputs))
    for call in calls:
        caller, callee = names.get(call.caller, "responder"), names[call.callee]
        yield (caller, callee, "call"), True
        if call.result != "None":  # a logger returns nothing
            yield (callee, caller, "return"), True
    for agent_message in recording.agent_messages:
        yield (
            (agent_message.sender, agent_message.receiver, "call" if agent_message.reply_to is None else "return"),
            True,
        )


def identify_party(name: str) -> str:
    """Return the party of a sender or receiver in ``MessageCount``. Unknown names are networks."""
    return name if name in _NAMED else "network"


def describe_message_counts(message_counts: tuple[MessageCount, ...], language: Language = ENGLISH) -> str:
    """Return the counts as a sentence; empty if there are none."""
    counts = ", ".join(_describe_count(each, language) for each in message_counts if each.kind != "return")
    return language.say("Messages by sender and receiver: %(counts)s.", counts=counts) if counts else ""


def _describe_count(message_count: MessageCount, language: Language) -> str:
    return language.say(
        "%(source)s to %(target)s %(count)s",
        source=format_party_name(message_count.source, language),
        target=format_party_name(message_count.target, language),
        count=_format_count(message_count, language),
    )


def build_block_diagram(message_counts: tuple[MessageCount, ...]) -> Diagram:
    """Return the counts as a block diagram. A call that returned something has an arrow at both ends."""
    returned_routes = {(talk.source, talk.target) for talk in message_counts if talk.kind == "return"}
    arrows = tuple(
        DiagramArrow(
            talk.source,
            talk.target,
            _format_count(talk),
            heads="both" if talk.kind == "call" and (talk.target, talk.source) in returned_routes else "target",
        )
        for talk in message_counts
        if talk.kind != "return"
    )
    is_linked = any({talk.source, talk.target} == {"robot", SECOND} for talk in message_counts)
    required_parties = ("robot", SECOND) if is_linked else ("robot", "responder")
    party_names = dict.fromkeys(
        (*required_parties, *(name for talk in message_counts for name in (talk.source, talk.target)))
    )
    return Diagram("blockdiag", tuple(DiagramActor(name, name) for name in party_names), arrows)


def build_sequence_diagram(conversation: SequenceDiagram) -> Diagram:
    """Return the conversation as a sequence diagram, for display beside a notebook's own."""
    return Diagram(
        "seqdiag",
        tuple(DiagramActor(party, party) for party in conversation.parties),
        tuple(_build_steps(conversation)),
    )


def _build_steps(conversation: SequenceDiagram) -> Iterator[DiagramArrow | Divider]:
    for step in conversation.steps:
        if not isinstance(step, Step):
            yield Divider(f"{step.count} more {step.what}{'' if step.count == 1 else 's'}", delay=True)
        elif step.kind == "silence":
            yield Divider("no answer", delay=True)
        else:
            yield DiagramArrow(
                step.source,
                step.target,
                to_one_line(step.label, _MAX_LABEL_LENGTH),
                "dashed" if step.kind == "return" else "solid",
                failed=step.kind == "lost",
            )


def _name_callees(calls: Sequence[Call], agents: Iterable[str]) -> Mapping[str, str]:
    """Return the display name of each called name."""
    networks = dict.fromkeys(call.callee for call in calls if call.callee not in _NAMED)
    display_names = {
        name: to_one_line(name, 20) if place < _MAX_NETWORKS else _OTHER_NETWORKS for place, name in enumerate(networks)
    }
    return MappingProxyType(display_names | {name: name for name in (*_NAMED, *agents)})


def _format_count(message_count: MessageCount, language: Language = ENGLISH) -> str:
    if not message_count.lost:
        return str(message_count.count)
    return language.say("%(count)s, %(lost)s lost", count=message_count.count, lost=message_count.lost)
