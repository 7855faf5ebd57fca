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
from service.reports.plots.sequence import PARTIES, SequenceDiagram, Step
from service.reports.robots import PARTNER_OF, SECOND, format_party_name, iterate_robots
from sim.recording import Call, Recording
from submissions.diagram import Diagram, DiagramActor, DiagramArrow, Divider

#: Networks that are counted by name. Networks called later are counted together.
_MOST_NETWORKS = 4
_OTHER_NETWORKS = "other networks"
#: The longest label of a message, beside a diagram with words as labels.
_LONGEST_LABEL = 32
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
    lost: Counter[tuple[str, str, MessageKind]] = Counter()
    for talk, arrived in _iterate_messages(recording):
        counts[talk] += 1
        lost[talk] += not arrived
    return tuple(MessageCount(*talk, count, lost[talk]) for talk, count in counts.items())


def _iterate_messages(recording: Recording) -> Iterator[tuple[tuple[str, str, MessageKind], bool]]:
    """Yield sender, receiver and kind of each message and call, and whether it arrived."""
    for robot, own in iterate_robots(recording):
        for message in own.messages:
            other = PARTNER_OF[robot] if message.to_partner else "responder"
            if message.sender != "partner":  # the other robot's list has it
                way = (robot, other) if message.sender == "robot" else (other, robot)
                yield (*way, "message"), message.delivered is not None
    calls = [call for _, own in iterate_robots(recording) for call in own.calls]
    names = _name_callees(calls, (each.agent for each in recording.agent_outputs))
    for call in calls:
        caller, callee = names.get(call.caller, "responder"), names[call.callee]
        yield (caller, callee, "call"), True
        if call.result != "None":  # a logger returns nothing
            yield (callee, caller, "return"), True
    for each in recording.agent_messages:
        yield (each.sender, each.receiver, "call" if each.reply_to is None else "return"), True


def identify_party(name: str) -> str:
    """Return the party of a name in ``talks``. Unknown names are networks."""
    return name if name in _NAMED else "network"


def describe_message_counts(told: tuple[MessageCount, ...], language: Language = ENGLISH) -> str:
    """Return the counts as a sentence; empty if there are none."""
    counts = ", ".join(_describe_count(each, language) for each in told if each.kind != "return")
    return language.say("Messages by sender and receiver: %(counts)s.", counts=counts) if counts else ""


def _describe_count(talk: MessageCount, language: Language) -> str:
    return language.say(
        "%(source)s to %(target)s %(count)s",
        source=format_party_name(talk.source, language),
        target=format_party_name(talk.target, language),
        count=_format_count(talk, language),
    )


def build_block_diagram(told: tuple[MessageCount, ...]) -> Diagram:
    """Return the counts as a block diagram. A call that returned something has an arrow at both ends."""
    returned = {(talk.source, talk.target) for talk in told if talk.kind == "return"}
    arrows = tuple(
        DiagramArrow(
            talk.source,
            talk.target,
            _format_count(talk),
            heads="both" if talk.kind == "call" and (talk.target, talk.source) in returned else "target",
        )
        for talk in told
        if talk.kind != "return"
    )
    linked = any({talk.source, talk.target} == {"robot", SECOND} for talk in told)
    always = ("robot", SECOND) if linked else ("robot", "responder")
    named = dict.fromkeys((*always, *(name for talk in told for name in (talk.source, talk.target))))
    return Diagram("blockdiag", tuple(DiagramActor(name, name) for name in named), arrows)


def build_sequence_diagram(told: SequenceDiagram) -> Diagram:
    """Return the conversation as a sequence diagram, for display beside a notebook's own."""
    return Diagram("seqdiag", tuple(DiagramActor(party, party) for party in told.parties), tuple(_build_steps(told)))


def _build_steps(told: SequenceDiagram) -> Iterator[DiagramArrow | Divider]:
    for step in told.steps:
        if not isinstance(step, Step):
            yield Divider(f"{step.count} more {step.what}{'' if step.count == 1 else 's'}", delay=True)
        elif step.kind == "silence":
            yield Divider("no answer", delay=True)
        else:
            yield DiagramArrow(
                step.source,
                step.target,
                to_one_line(step.label, _LONGEST_LABEL),
                "dashed" if step.kind == "return" else "solid",
                failed=step.kind == "lost",
            )


def _name_callees(calls: Sequence[Call], agents: Iterable[str]) -> Mapping[str, str]:
    """Return the display name of each called name."""
    networks = dict.fromkeys(call.callee for call in calls if call.callee not in _NAMED)
    shown = {
        name: to_one_line(name, 20) if place < _MOST_NETWORKS else _OTHER_NETWORKS
        for place, name in enumerate(networks)
    }
    return MappingProxyType(shown | {name: name for name in (*_NAMED, *agents)})


def _format_count(talk: MessageCount, language: Language = ENGLISH) -> str:
    if not talk.lost:
        return str(talk.count)
    return language.say("%(count)s, %(lost)s lost", count=talk.count, lost=talk.lost)
