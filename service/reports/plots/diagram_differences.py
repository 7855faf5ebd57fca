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
from service.reports.messages import format_party_name
from service.reports.plots.message_counts import MessageCount, identify_party
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
_MAX_NAMED = 6


@dataclass(frozen=True, slots=True)
class Differences:
    """The differences: names as in the diagram, or as in ``MessageCount`` if only the recording has them.

    An arrow at an actor that is itself a difference is not listed. ``similarity`` is the fraction of all arrows, 0 to
    1, that both have.
    """

    drawn_actors: tuple[str, ...] = ()
    drawn_arrows: tuple[Pair, ...] = ()
    happened_actors: tuple[str, ...] = ()
    happened_arrows: tuple[Pair, ...] = ()
    similarity: float = 0.0

    def __bool__(self) -> bool:
        return bool(self.drawn_actors or self.drawn_arrows or self.happened_actors or self.happened_arrows)


def compare_with_recording(diagram: Diagram, message_counts: Sequence[MessageCount]) -> Differences | None:
    """Return the differences; None if fewer than two drawn parties took part, so the diagram shows something else.

    An arrow may represent a path through parties that are not drawn, and one without a direction represents both.
    Return values of calls need not be drawn.
    """
    actor_parties = {actor.name: identify_actor_party(actor) for actor in diagram.actors}
    drawn_parties = {each for each in actor_parties.values() if each is not None}
    recorded_parties = {identify_party(name) for talk in message_counts for name in (talk.source, talk.target)}
    if len(drawn_parties & recorded_parties) < 2:
        return None
    connections = _find_connections(message_counts, drawn_parties)
    wrong_arrows: dict[Pair, None] = {}
    covered_pairs: set[tuple[str | None, str | None]] = set()
    for arrow in diagram.arrows:
        pair = (actor_parties[arrow.source], actor_parties[arrow.target])
        directions = {pair} if arrow.heads == "target" else {pair, pair[::-1]}
        covered_pairs |= directions
        if pair[0] != pair[1] and set(pair) <= recorded_parties and not directions & connections:
            wrong_arrows[arrow.source, arrow.target] = None
    missing_arrows = [
        (talk.source, talk.target)
        for talk in message_counts
        if talk.kind != "return"
        and {identify_party(talk.source), identify_party(talk.target)} <= drawn_parties
        and (identify_party(talk.source), identify_party(talk.target)) not in covered_pairs
    ]
    pairs = {(identify_party(talk.source), identify_party(talk.target)) for talk in message_counts}
    participants = dict.fromkeys(name for talk in message_counts for name in (talk.source, talk.target))
    return Differences(
        tuple(name for name, each in actor_parties.items() if each not in recorded_parties),
        tuple(wrong_arrows),
        tuple(name for name in participants if identify_party(name) not in drawn_parties),
        tuple(dict.fromkeys(missing_arrows)),
        len(covered_pairs & pairs) / len(covered_pairs | pairs),
    )


def describe_differences(differences: Differences, language: Language = ENGLISH) -> str:
    """Return the differences as sentences."""
    if not differences:
        return language.say("The diagram matches the events.")
    sentences = []
    if differences.drawn_actors:
        sentences.append(language.say("%(names)s took no part.", names=_join_names(differences.drawn_actors, language)))
    if differences.drawn_arrows:
        arrows = _join_names(map(_format_arrow, differences.drawn_arrows), language)
        sentences.append(language.say("%(arrows)s did not happen.", arrows=arrows))
    if differences.happened_actors:
        sentences.append(
            language.counted(
                "%(names)s took part and is not drawn.",
                "%(names)s took part and are not drawn.",
                len(differences.happened_actors),
                names=_join_names(
                    (format_party_name(name, language) for name in differences.happened_actors), language
                ),
            )
        )
    if differences.happened_arrows:
        sentences.append(
            language.counted(
                "%(arrows)s happened and is not drawn.",
                "%(arrows)s happened and are not drawn.",
                len(differences.happened_arrows),
                arrows=_join_names(map(_format_arrow, differences.happened_arrows), language),
            )
        )
    return " ".join(sentences)


def identify_actor_party(actor: DiagramActor) -> str | None:
    """Return the party of an actor, by its name or else its label; None if it is none of them."""
    for text in (actor.name, actor.label):
        keywords = set(_WORD.findall(text.lower()))
        for party, party_keywords in _PARTY_KEYWORDS.items():
            if keywords & party_keywords:
                return party
    return None


def _find_connections(
    message_counts: Sequence[MessageCount], drawn_parties: set[str]
) -> set[tuple[str | None, str | None]]:
    """Return sender and receiver of each text, directly or through parties that are not drawn."""
    steps = {(identify_party(talk.source), identify_party(talk.target)) for talk in message_counts}
    connections: set[tuple[str | None, str | None]] = set()
    for start in drawn_parties:
        reached_parties, pending = {start}, [start]
        while pending:
            party = pending.pop()
            for target in {other for one, other in steps if one == party} - reached_parties:
                reached_parties.add(target)
                connections.add((start, target))
                if target not in drawn_parties:
                    pending.append(target)
    return connections


def _format_arrow(pair: Pair) -> str:
    return f"{to_one_line(pair[0], 30)} → {to_one_line(pair[1], 30)}"


def _join_names(names: Iterable[str], language: Language) -> str:
    """Join names for a sentence, shortened if there are many."""
    short_names = [to_one_line(name, 70) for name in names]
    if len(short_names) > _MAX_NAMED:
        remainder = language.say("%(count)s more", count=len(short_names) - _MAX_NAMED + 1)
        short_names = [*short_names[: _MAX_NAMED - 1], remainder]
    return language.say(" and ").join(
        [", ".join(short_names[:-1]), short_names[-1]] if len(short_names) > 1 else short_names
    )
