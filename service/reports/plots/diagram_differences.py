"""Comparison of a notebook's own diagram with the recorded events. It is shown and never marked.

Actors are identified by words in their names and labels. Other modules draw the differences.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from service.language import ENGLISH, Language
from service.reports.display_text import to_one_line
from service.reports.plots.message_counts import MessageCount, identify_party
from service.reports.robots import format_party_name
from submissions.diagram import Diagram, DiagramActor

Pair = tuple[str, str]

#: Words that identify a party. The first match counts: a Python agent is the agent.
_PARTY_KEYWORDS: Mapping[str, frozenset[str]] = MappingProxyType(
    {
        "logger": frozenset({"logger", "log", "logfile"}),
        "parser": frozenset({"parser"}),
        "agent": frozenset({"agent"}),
        "network": frozenset({"mlp", "cnn", "network", "net", "nn", "classifier", "model"}),
        "responder": frozenset({"responder", "pyresponder", "handler", "python", "notebook"}),
        "robot": frozenset({"robot", "brick", "ev3", "simulator"}),
    }
)
_WORD = re.compile(r"[a-z]+[0-9]*")
_MOST_NAMED = 6


@dataclass(frozen=True, slots=True)
class Differences:
    """The differences: names as in the diagram if only it has them, as in ``talks`` if only the recording has them.

    An arrow at an actor that is itself a difference is not listed. ``alike`` is the fraction of all arrows, 0 to 1,
    that both have.
    """

    drawn_actors: tuple[str, ...] = ()
    drawn_arrows: tuple[Pair, ...] = ()
    happened_actors: tuple[str, ...] = ()
    happened_arrows: tuple[Pair, ...] = ()
    similarity: float = 0.0

    def __bool__(self) -> bool:
        return bool(self.drawn_actors or self.drawn_arrows or self.happened_actors or self.happened_arrows)


def compare_with_recording(diagram: Diagram, told: Sequence[MessageCount]) -> Differences | None:
    """Return the differences; None if fewer than two drawn parties took part, so the diagram shows something else.

    An arrow may represent a path through parties that are not drawn, and one without a direction represents both.
    Return values of calls need not be drawn.
    """
    party = {actor.name: identify_actor_party(actor) for actor in diagram.actors}
    drawn = {each for each in party.values() if each is not None}
    happened = {identify_party(name) for talk in told for name in (talk.source, talk.target)}
    if len(drawn & happened) < 2:
        return None
    ways = _find_connections(told, drawn)
    wrong: dict[Pair, None] = {}
    covered: set[tuple[str | None, str | None]] = set()
    for arrow in diagram.arrows:
        pair = (party[arrow.source], party[arrow.target])
        either = {pair} if arrow.heads == "target" else {pair, pair[::-1]}
        covered |= either
        if pair[0] != pair[1] and set(pair) <= happened and not either & ways:
            wrong[arrow.source, arrow.target] = None
    missing = [
        (talk.source, talk.target)
        for talk in told
        if talk.kind != "return"
        and {identify_party(talk.source), identify_party(talk.target)} <= drawn
        and (identify_party(talk.source), identify_party(talk.target)) not in covered
    ]
    pairs = {(identify_party(talk.source), identify_party(talk.target)) for talk in told}
    took_part = dict.fromkeys(name for talk in told for name in (talk.source, talk.target))
    return Differences(
        tuple(name for name, each in party.items() if each not in happened),
        tuple(wrong),
        tuple(name for name in took_part if identify_party(name) not in drawn),
        tuple(dict.fromkeys(missing)),
        len(covered & pairs) / len(covered | pairs),
    )


def describe_differences(found: Differences, language: Language = ENGLISH) -> str:
    """Return the differences as sentences."""
    if not found:
        return language.say("The diagram matches the events.")
    told = []
    if found.drawn_actors:
        told.append(language.say("%(names)s took no part.", names=_join_names(found.drawn_actors, language)))
    if found.drawn_arrows:
        arrows = _join_names(map(_format_arrow, found.drawn_arrows), language)
        told.append(language.say("%(arrows)s did not happen.", arrows=arrows))
    if found.happened_actors:
        told.append(
            language.counted(
                "%(names)s took part and is not drawn.",
                "%(names)s took part and are not drawn.",
                len(found.happened_actors),
                names=_join_names((format_party_name(name, language) for name in found.happened_actors), language),
            )
        )
    if found.happened_arrows:
        told.append(
            language.counted(
                "%(arrows)s happened and is not drawn.",
                "%(arrows)s happened and are not drawn.",
                len(found.happened_arrows),
                arrows=_join_names(map(_format_arrow, found.happened_arrows), language),
            )
        )
    return " ".join(told)


def identify_actor_party(actor: DiagramActor) -> str | None:
    """Return the party of an actor, by its name or else its label; None if it is none of them."""
    for text in (actor.name, actor.label):
        words = set(_WORD.findall(text.lower()))
        for party, told_by in _PARTY_KEYWORDS.items():
            if words & told_by:
                return party
    return None


def _find_connections(told: Sequence[MessageCount], drawn: set[str]) -> set[tuple[str | None, str | None]]:
    """Return sender and receiver of each text, directly or through parties that are not drawn."""
    steps = {(identify_party(talk.source), identify_party(talk.target)) for talk in told}
    ways: set[tuple[str | None, str | None]] = set()
    for start in drawn:
        reached, waiting = {start}, [start]
        while waiting:
            here = waiting.pop()
            for target in {other for one, other in steps if one == here} - reached:
                reached.add(target)
                ways.add((start, target))
                if target not in drawn:
                    waiting.append(target)
    return ways


def _format_arrow(pair: Pair) -> str:
    return f"{to_one_line(pair[0], 30)} → {to_one_line(pair[1], 30)}"


def _join_names(names: Iterable[str], language: Language) -> str:
    """Join names for a sentence, shortened if there are many."""
    found = [to_one_line(name, 70) for name in names]
    if len(found) > _MOST_NAMED:
        more = language.say("%(count)s more", count=len(found) - _MOST_NAMED + 1)
        found = [*found[: _MOST_NAMED - 1], more]
    return language.say(" and ").join([", ".join(found[:-1]), found[-1]] if len(found) > 1 else found)
