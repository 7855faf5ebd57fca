"""Two students whose work is alike, with all that was found of it: what they wrote and what their robots did.

The order is one to look at them in; nothing here accuses, and nothing here is a mark.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from service.similarity.behaviour import Behaviour, SameInTrial, same_in_trials, same_recordings
from service.similarity.writing import AlikeSources, Source, compare

#: The part of the trials, and at least so many, in which robots with the same path make a pair without alike sources;
#: a winding path counts twice. The same messages make none: where few are right, those few say the same.
SAME_PART, FEWEST_TRIALS = 0.5, 2


@dataclass(frozen=True, slots=True)
class SimilarPair:
    """Two students, their sources that are alike, and the trials in which their robots did what few others' did."""

    students: tuple[str, str]
    sources: tuple[AlikeSources, ...]
    trials: tuple[SameInTrial, ...]

    @property
    def share(self) -> float:
        """The largest part of a source that is in the other's; 0 where no sources are alike."""
        return max((each.share for each in self.sources), default=0.0)


@dataclass(frozen=True, slots=True)
class Similarity:
    """The similar pairs of one assignment in a batch, the most similar first, and what could not be told."""

    assignment: str
    students: int
    pairs: tuple[SimilarPair, ...]
    too_short: tuple[str, ...]  # who has too little of their own to compare; their robots are compared
    not_compared: int = 0  # pairs of sources that were too many to compare
    same: tuple[tuple[str, ...], ...] = ()  # groups who have a whole file in common, however many they are
    same_recordings: tuple[tuple[str, ...], ...] = ()  # groups whose recordings are all the same


def similarity(
    assignment: str, sources: Sequence[Source], given: Sequence[str], behaviours: Mapping[str, Behaviour]
) -> Similarity:
    """All similar pairs among these students' submissions."""
    writing = compare(sources, given)
    alike: dict[tuple[str, str], list[AlikeSources]] = {}
    for each in writing.alike:
        alike.setdefault(each.students, []).append(each)
    same = same_in_trials(behaviours)
    often = {pair for pair, found in same.items() if _often(found, [behaviours[student] for student in pair])}
    pairs = [SimilarPair(pair, tuple(alike.get(pair, ())), same.get(pair, ())) for pair in {*alike, *often}]
    pairs.sort(key=lambda pair: (-pair.share, -len(pair.trials), pair.students))
    students = {source.student for source in sources} | set(behaviours)
    return Similarity(
        assignment,
        len(students),
        tuple(pairs),
        writing.too_short,
        writing.not_compared,
        writing.same,
        same_recordings(behaviours),
    )


def _often(same: Sequence[SameInTrial], behaviours: Sequence[Behaviour]) -> bool:
    paths = [each.trial for each in same if each.aspect == "path"]
    weight = sum(2 if trial in behaviours[0].winding else 1 for trial in paths)
    return weight >= FEWEST_TRIALS and len(paths) >= SAME_PART * max(each.trials for each in behaviours)
