"""The conversation of a trial as steps between parties, for a sequence diagram.

The module selects the steps. Pages list them, and ``sequence_drawing.py`` draws them beside a notebook's diagram.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from service.reports.display_text import abbreviate_message, to_one_line
from service.reports.message_losses import describe_loss, describe_reach
from service.reports.robots import PARTNER_OF, SECOND, iterate_robots
from sim.recording import Call, Message, Recording

#: In the order of their lanes. A name bound to a network, such as MLP, belongs to the party ``network``.
PARTIES = ("robot", "responder", SECOND, "parser", "agent", "logger", "network")
MOST_EXCHANGES = 6
MOST_STEPS = 40
#: Per message, however many calls it causes in the responder.
MOST_CALL_STEPS = 60
_KNOWN_PARTIES: Mapping[str, str] = MappingProxyType({party: party for party in PARTIES})

StepKind = Literal["message", "call", "return", "lost", "silence"]


@dataclass(frozen=True, slots=True)
class Step:
    """One arrow. ``t`` (seconds) is its start; None inside a process, where no time passes."""

    kind: StepKind
    source: str
    target: str
    label: str
    t: float | None = None
    note: str = ""


@dataclass(frozen=True, slots=True)
class Gap:
    """The number of exchanges, or steps inside an exchange, that are left out here."""

    count: int
    what: Literal["exchange", "step"] = "exchange"


@dataclass(frozen=True, slots=True)
class SequenceDiagram:
    """A conversation. ``parties`` take part, always with robot and responder. ``total`` counts all exchanges."""

    parties: tuple[str, ...]
    steps: tuple[Step | Gap, ...]
    shown: int
    total: int


@dataclass(frozen=True, slots=True)
class _Exchange:
    """A message from the robot with its answers, or an unsolicited answer; indices into that robot's messages."""

    sent: int | None
    answers: tuple[int, ...]
    recording: Recording
    robot: str

    @property
    def messages(self) -> Iterator[Message]:
        """The message, if there is one, then the answers."""
        yield from (self.recording.messages[i] for i in (self.sent, *self.answers) if i is not None)

    @property
    def begin(self) -> float:
        """The time at which the first of them was sent."""
        return next(self.messages).t


def build_conversation(
    recording: Recording, most_exchanges: int = MOST_EXCHANGES, most_steps: int = MOST_STEPS
) -> SequenceDiagram:
    """Return the messages across the bridge and the responder's calls, within the given limits.

    It keeps the first exchanges. Of the later ones, it keeps those in which a repeated message got through, or
    something was lost or wrong.
    """
    exchanges = [exchange for robot, own in iterate_robots(recording) for exchange in _iterate_exchanges(own, robot)]
    if recording.partner is not None:
        exchanges.sort(key=lambda exchange: exchange.begin)
    kept = _select_exchanges(exchanges, most_exchanges, most_steps)
    timed: list[tuple[float, int, list[Step | Gap]]] = []
    skipped = 0
    for number, exchange in enumerate(exchanges):
        if number not in kept:
            skipped += 1
            continue
        if skipped:
            timed.append((exchange.begin, number, [Gap(skipped)]))
            skipped = 0
        timed += [(t, number, list(steps)) for t, steps in _build_steps(exchange)]
    steps = [step for _, _, group in sorted(timed, key=lambda item: item[0]) for step in group]
    if skipped:
        steps.append(Gap(skipped))
    named = {name for step in steps if isinstance(step, Step) for name in (step.source, step.target)}
    always = ("robot", "responder") if recording.partner is None else ("robot", SECOND)
    lanes = (*PARTIES, *(each.agent for each in recording.agent_outputs if each.agent not in _KNOWN_PARTIES))
    parties = tuple(party for party in lanes if party in named or party in always)
    return SequenceDiagram(parties, tuple(steps), len(kept), len(exchanges))


def has_problem(message: Message) -> bool:
    """Return whether a message was lost, never arrived, or could not be read."""
    return message.delivered is None or bool(describe_loss(message))


def _iterate_exchanges(recording: Recording, robot: str) -> Iterator[_Exchange]:
    """Yield this robot's messages with their answers. Messages from the other robot belong to the other's list."""
    messages = recording.messages
    answers: dict[int, list[int]] = {}
    for index, message in enumerate(messages):
        to = message.reply_to
        if message.sender == "responder" and to is not None and 0 <= to < len(messages):
            answers.setdefault(to, []).append(index)
    answered = {answer for found in answers.values() for answer in found}
    for index, message in enumerate(messages):
        if index in answered or message.sender == "partner":
            continue
        sent = message.sender == "robot"
        own = _Exchange(index, tuple(answers.get(index, ())), recording, robot)
        yield own if sent else _Exchange(None, (index,), recording, robot)


def _select_exchanges(exchanges: Sequence[_Exchange], most_exchanges: int, most_steps: int) -> set[int]:
    wrong = [number for number, exchange in enumerate(exchanges) if _has_failed(exchange)]
    half = most_exchanges - most_exchanges // 2
    first = range(min(half, len(exchanges)))
    order = dict.fromkeys([*first, *_iterate_recovered(exchanges, wrong), *wrong, *range(len(exchanges))])
    kept: set[int] = set()
    steps = 0
    for number in list(order)[:most_exchanges]:
        steps += sum(len(told) for _, told in _build_steps(exchanges[number]))
        if kept and steps > most_steps:
            break
        kept.add(number)
    return kept


def _iterate_recovered(exchanges: Sequence[_Exchange], wrong: Sequence[int]) -> Iterator[int]:
    """Yield the exchanges in which a text got through that was lost before."""
    astray: set[str] = set()
    failed = set(wrong)
    for number, exchange in enumerate(exchanges):
        text = next(exchange.messages).text if exchange.sent is not None else ""
        if number in failed:
            astray.add(text)
        elif text in astray:
            astray.discard(text)
            yield number


def _has_failed(exchange: _Exchange) -> bool:
    unanswered = not exchange.answers and not next(exchange.messages).to_partner
    return unanswered or any(has_problem(message) for message in exchange.messages)


def _build_steps(exchange: _Exchange) -> Iterator[tuple[float, list[Step | Gap]]]:
    """Yield groups of steps, with the time of each group."""
    recording, robot = exchange.recording, exchange.robot
    if exchange.sent is not None:
        message = recording.messages[exchange.sent]
        steps: list[Step | Gap] = [_build_message_step(message, robot)]
        if message.delivered is not None and not message.to_partner:
            made = list(iterate_inner_steps(recording, exchange.sent))
            steps += made[:MOST_CALL_STEPS]
            if len(made) > MOST_CALL_STEPS:
                steps.append(Gap(len(made) - MOST_CALL_STEPS, "step"))
            if not exchange.answers:
                steps.append(Step("silence", "responder", robot, "– no answer –"))
        yield message.t, steps
    for index in exchange.answers:
        answer = recording.messages[index]
        yield (answer.t if answer.delivered is None else answer.delivered), [_build_message_step(answer, robot)]


def _build_message_step(message: Message, robot: str) -> Step:
    sent = message.sender == "robot"
    other = PARTNER_OF[robot] if message.to_partner else "responder"
    source, target = (robot, other) if sent else (other, robot)
    label, note = abbreviate_message(message.text, 90), describe_loss(message)
    reach = describe_reach(message)
    label = f"{label} ({reach})" if reach else label
    if message.delivered is None:
        return Step("lost", source, target, label, message.t, note or "not delivered")
    return Step("message", source, target, label, message.t if sent else message.delivered, note)


def iterate_inner_steps(recording: Recording, message: int) -> Iterator[Step]:
    """Yield the calls and agent messages until the robot's message was answered; for -1, those before any message."""
    calls = sorted((call for call in recording.calls if call.message == message), key=_position_of)
    told, shown_at = 0, recording.messages[message].t if message >= 0 else 0.0
    for place, each in enumerate(recording.agent_messages):
        if each.message == message:
            until = bisect_right(calls, place, told, key=_position_of)
            yield from _iterate_call_steps(calls[told:until])
            told = until
            kind: StepKind = "call" if each.reply_to is None else "return"
            label, t = abbreviate_message(each.text, 60), None if each.t == shown_at else each.t
            yield Step(kind, each.sender, each.receiver, label, t, to_one_line(each.note, 30))
            shown_at = each.t
    yield from _iterate_call_steps(calls[told:])


def _position_of(call: Call) -> int:
    return call.before


def _iterate_call_steps(calls: Iterable[Call]) -> Iterator[Step]:
    """Yield each call, the calls inside it, and its return. ``calls`` are in the order in which they ended."""
    ended: list[tuple[int, list[Step]]] = []  # depth and steps of calls whose caller has not ended yet
    for call in calls:
        inner: list[Step] = []
        while ended and ended[-1][0] > call.depth:
            inner = ended.pop()[1] + inner
        ended.append((call.depth, [_build_call_step(call), *inner, *_iterate_return_steps(call)]))
    for _, steps in ended:
        yield from steps


def _build_call_step(call: Call) -> Step:
    name = "" if call.callee in _KNOWN_PARTIES else f"{to_one_line(call.callee, 20)}: "
    return Step(
        "call", _identify_party(call.caller, "responder"), _identify_party(call.callee), name + _format_argument(call)
    )


def _format_argument(call: Call) -> str:
    return (
        "'IMG_DATA::{left, right}'" if call.argument[1:].startswith("IMG_DATA::{") else to_one_line(call.argument, 60)
    )


def _iterate_return_steps(call: Call) -> Iterator[Step]:
    if call.result != "None":  # a logger returns nothing
        yield Step(
            "return",
            _identify_party(call.callee),
            _identify_party(call.caller, "responder"),
            to_one_line(call.result, 60),
        )


def _identify_party(name: str, otherwise: str = "network") -> str:
    return _KNOWN_PARTIES.get(name, otherwise)
