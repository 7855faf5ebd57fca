"""Pairs of students with similar work: their similar sources and their robots' equal behaviour.

The order is for review only. It is not an accusation and not a mark.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from service.similarity.behaviour import Behaviour, SharedBehaviour, find_shared_behaviour, group_same_recordings
from service.similarity.similar_sources import SimilarSources, Source, compare_sources

#: The fraction and least number of trials with the same path that make a pair without similar sources. A winding path
#: counts twice. Equal messages make no pair: if few are right, those few send the same.
SAME_PART, MIN_TRIALS = 0.5, 2


@dataclass(frozen=True, slots=True)
class SimilarPair:
    """Two students, their similar sources, and the trials in which their robots shared rare behaviour."""

    students: tuple[str, str]
    sources: tuple[SimilarSources, ...]
    trials: tuple[SharedBehaviour, ...]

    @property
    def share(self) -> float:
        """The largest fraction of a source found in the other's; 0 without similar sources."""
        return max((each.share for each in self.sources), default=0.0)


@dataclass(frozen=True, slots=True)
class Similarity:
    """The similar pairs of one assignment in a batch, the most similar first, and what could not be compared."""

    assignment: str
    students: int
    pairs: tuple[SimilarPair, ...]
    too_short: tuple[str, ...]  # students whose sources are too short; their robots are still compared
    not_compared: int = 0  # pairs of sources beyond the limit
    same: tuple[tuple[str, ...], ...] = ()  # groups that share a whole file, however large
    same_recordings: tuple[tuple[str, ...], ...] = ()  # groups with equal recordings


def compare_submissions(
    assignment: str, sources: Sequence[Source], given_code: Sequence[str], behaviours: Mapping[str, Behaviour]
) -> Similarity:
    """Return all similar pairs among these students' submissions."""
    comparison = compare_sources(sources, given_code)
    similar_sources: dict[tuple[str, str], list[SimilarSources]] = {}
    for source_pair in comparison.alike:
        similar_sources.setdefault(source_pair.students, []).append(source_pair)
    shared_behaviour = find_shared_behaviour(behaviours)
    behaviour_pairs = {
        pair
        for pair, found in shared_behaviour.items()
        if _has_enough_trials(found, [behaviours[student] for student in pair])
    }
    pairs = [
        SimilarPair(pair, tuple(similar_sources.get(pair, ())), shared_behaviour.get(pair, ()))
        for pair in {*similar_sources, *behaviour_pairs}
    ]
    pairs.sort(key=lambda pair: (-pair.share, -len(pair.trials), pair.students))
    students = {source.student for source in sources} | set(behaviours)
    return Similarity(
        assignment,
        len(students),
        tuple(pairs),
        comparison.too_short,
        comparison.not_compared,
        comparison.same,
        group_same_recordings(behaviours),
    )


def _has_enough_trials(shared_behaviour: Sequence[SharedBehaviour], behaviours: Sequence[Behaviour]) -> bool:
    paths = [each.trial for each in shared_behaviour if each.aspect == "path"]
    weight = sum(2 if trial in behaviours[0].winding else 1 for trial in paths)
    return weight >= MIN_TRIALS and len(paths) >= SAME_PART * max(each.trials for each in behaviours)
