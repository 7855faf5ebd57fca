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
from service.reports.messages import PARTNER_OF, SECOND, describe_loss, describe_reach, iterate_robots
from sim.recording import Call, Message, Recording

#: In the order of their lanes. A name bound to a network, such as MLP, belongs to the party ``network``.
PARTIES = ("robot", "responder", SECOND, "parser", "agent", "logger", "network")
MAX_EXCHANGES = 6
MAX_STEPS = 40
#: Per message, however many calls it causes in the responder.
MAX_CALL_STEPS = 60
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
    recording: Recording, max_exchanges: int = MAX_EXCHANGES, max_steps: int = MAX_STEPS
) -> SequenceDiagram:
    """Return the messages across the bridge and the responder's calls, within the given limits.

    It keeps the first exchanges. Of the later ones, it keeps those in which a repeated message got through, or
    something was lost or wrong.
    """
    exchanges = [exchange for robot, own in iterate_robots(recording) for exchange in _iterate_exchanges(own, robot)]
    if recording.partner is not None:
        exchanges.sort(key=lambda exchange: exchange.begin)
    kept_exchanges = _select_exchanges(exchanges, max_exchanges, max_steps)
    timed_steps: list[tuple[float, int, list[Step | Gap]]] = []
    skipped_count = 0
    for number, exchange in enumerate(exchanges):
        if number not in kept_exchanges:
            skipped_count += 1
            continue
        if skipped_count:
            timed_steps.append((exchange.begin, number, [Gap(skipped_count)]))
            skipped_count = 0
        timed_steps += [(t, number, list(steps)) for t, steps in _build_steps(exchange)]
    steps = [step for _, _, group in sorted(timed_steps, key=lambda item: item[0]) for step in group]
    if skipped_count:
        steps.append(Gap(skipped_count))
    named_parties = {name for step in steps if isinstance(step, Step) for name in (step.source, step.target)}
    required_parties = ("robot", "responder") if recording.partner is None else ("robot", SECOND)
    lanes = (*PARTIES, *(each.agent for each in recording.agent_outputs if each.agent not in _KNOWN_PARTIES))
    parties = tuple(party for party in lanes if party in named_parties or party in required_parties)
    return SequenceDiagram(parties, tuple(steps), len(kept_exchanges), len(exchanges))


def has_problem(message: Message) -> bool:
    """Return whether a message was lost, never arrived, or could not be read."""
    return message.delivered is None or bool(describe_loss(message))


def _iterate_exchanges(recording: Recording, robot: str) -> Iterator[_Exchange]:
    """Yield this robot's messages with their answers. The other robot's list contains its messages."""
    messages = recording.messages
    answers: dict[int, list[int]] = {}
    for index, message in enumerate(messages):
        replied_index = message.reply_to
        if message.sender == "responder" and replied_index is not None and 0 <= replied_index < len(messages):
            answers.setdefault(replied_index, []).append(index)
    answered_indices = {answer for found in answers.values() for answer in found}
    for index, message in enumerate(messages):
        if index in answered_indices or message.sender == "partner":
            continue
        is_from_robot = message.sender == "robot"
        exchange = _Exchange(index, tuple(answers.get(index, ())), recording, robot)
        yield exchange if is_from_robot else _Exchange(None, (index,), recording, robot)


def _select_exchanges(exchanges: Sequence[_Exchange], max_exchanges: int, max_steps: int) -> set[int]:
    failed_exchanges = [number for number, exchange in enumerate(exchanges) if _has_failed(exchange)]
    half_count = max_exchanges - max_exchanges // 2
    first_exchanges = range(min(half_count, len(exchanges)))
    order = dict.fromkeys(
        [
            *first_exchanges,
            *_iterate_recovered_exchanges(exchanges, failed_exchanges),
            *failed_exchanges,
            *range(len(exchanges)),
        ]
    )
    kept_exchanges: set[int] = set()
    step_count = 0
    for number in list(order)[:max_exchanges]:
        step_count += sum(len(told) for _, told in _build_steps(exchanges[number]))
        if kept_exchanges and step_count > max_steps:
            break
        kept_exchanges.add(number)
    return kept_exchanges


def _iterate_recovered_exchanges(exchanges: Sequence[_Exchange], failed_exchanges: Sequence[int]) -> Iterator[int]:
    """Yield the exchanges in which a text got through that was lost before."""
    lost_texts: set[str] = set()
    failed_numbers = set(failed_exchanges)
    for number, exchange in enumerate(exchanges):
        text = next(exchange.messages).text if exchange.sent is not None else ""
        if number in failed_numbers:
            lost_texts.add(text)
        elif text in lost_texts:
            lost_texts.discard(text)
            yield number


def _has_failed(exchange: _Exchange) -> bool:
    is_unanswered = not exchange.answers and not next(exchange.messages).to_partner
    return is_unanswered or any(has_problem(message) for message in exchange.messages)


def _build_steps(exchange: _Exchange) -> Iterator[tuple[float, list[Step | Gap]]]:
    """Yield groups of steps, with the time of each group."""
    recording, robot = exchange.recording, exchange.robot
    if exchange.sent is not None:
        message = recording.messages[exchange.sent]
        steps: list[Step | Gap] = [_build_message_step(message, robot)]
        if message.delivered is not None and not message.to_partner:
            inner_steps = list(iterate_inner_steps(recording, exchange.sent))
            steps += inner_steps[:MAX_CALL_STEPS]
            if len(inner_steps) > MAX_CALL_STEPS:
                steps.append(Gap(len(inner_steps) - MAX_CALL_STEPS, "step"))
            if not exchange.answers:
                steps.append(Step("silence", "responder", robot, "– no answer –"))
        yield message.t, steps
    for index in exchange.answers:
        answer = recording.messages[index]
        yield (answer.t if answer.delivered is None else answer.delivered), [_build_message_step(answer, robot)]


def _build_message_step(message: Message, robot: str) -> Step:
    is_from_robot = message.sender == "robot"
    other_party = PARTNER_OF[robot] if message.to_partner else "responder"
    source, target = (robot, other_party) if is_from_robot else (other_party, robot)
    label, note = abbreviate_message(message.text, 90), describe_loss(message)
    reach = describe_reach(message)
    label = f"{label} ({reach})" if reach else label
    if message.delivered is None:
        return Step("lost", source, target, label, message.t, note or "not delivered")
    return Step("message", source, target, label, message.t if is_from_robot else message.delivered, note)


def iterate_inner_steps(recording: Recording, message: int) -> Iterator[Step]:
    """Yield the calls and agent messages until the robot's message was answered; for -1, those before any message."""
    calls = sorted((call for call in recording.calls if call.message == message), key=_get_position)
    start_index, last_shown_time = 0, recording.messages[message].t if message >= 0 else 0.0
    for position, agent_message in enumerate(recording.agent_messages):
        if agent_message.message == message:
            end_index = bisect_right(calls, position, start_index, key=_get_position)
            yield from _iterate_call_steps(calls[start_index:end_index])
            start_index = end_index
            kind: StepKind = "call" if agent_message.reply_to is None else "return"
            label, t = (
                abbreviate_message(agent_message.text, 60),
                None if agent_message.t == last_shown_time else agent_message.t,
            )
            yield Step(
                kind, agent_message.sender, agent_message.receiver, label, t, to_one_line(agent_message.note, 30)
            )
            last_shown_time = agent_message.t
    yield from _iterate_call_steps(calls[start_index:])


def _get_position(call: Call) -> int:
    return call.before


def _iterate_call_steps(calls: Iterable[Call]) -> Iterator[Step]:
    """Yield each call, the calls inside it, and its return. ``calls`` are in the order in which they ended."""
    finished_calls: list[tuple[int, list[Step]]] = []  # depth and steps of calls whose caller has not ended yet
    for call in calls:
        inner: list[Step] = []
        while finished_calls and finished_calls[-1][0] > call.depth:
            inner = finished_calls.pop()[1] + inner
        finished_calls.append((call.depth, [_build_call_step(call), *inner, *_iterate_return_steps(call)]))
    for _, steps in finished_calls:
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


def _identify_party(name: str, default: str = "network") -> str:
    return _KNOWN_PARTIES.get(name, default)
