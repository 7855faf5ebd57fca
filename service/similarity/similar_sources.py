"""Search for similar sources of a batch, with the similar lines. Given code and common code are ignored.

Candidates come from an inverted index of fingerprints, so not all pairs of sources are compared. Only candidates are
compared gram by gram. People decide about consequences.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from heapq import nlargest

import numpy as np
from numpy.typing import NDArray

from service.similarity.tokens import Tokens, tokenise_source
from service.similarity.winnowing import (
    GRAM,
    compute_grams,
    mark_covered_tokens,
    mark_varied_grams,
    select_fingerprints,
)

#: The fraction of a source's own tokens found in another that makes the two similar.
SIMILARITY_THRESHOLD = 0.6
#: The least number of own tokens, about ten lines. Shorter sources are written alike by everyone.
FEWEST_TOKENS = 60
#: Code in at least this fraction and number of the students' work is common: from the docs, or a hint in class.
COMMON_PART, FEWEST_IN_COMMON = 1 / 3, 5
#: A file shared by more than this fraction of the students is not a student's own.
NEARLY_ALL = 2 / 3
#: The number of pairs compared, those with most in common. Hundreds of copies of one large file make thousands of
#: pairs.
MOST_PAIRS = 2000
#: The number of places of a gram at which a stretch may continue.
_MOST_PLACES = 8
_MOST_STRETCHES = 50


@dataclass(frozen=True, slots=True)
class Source:
    """One file of one student."""

    student: str
    file: str
    tokens: Tokens


@dataclass(frozen=True, slots=True)
class Stretch:
    """Similar lines of two sources, from first to last, counted from 1."""

    lines: tuple[int, int]
    other_lines: tuple[int, int]
    tokens: int


@dataclass(frozen=True, slots=True)
class SimilarSources:
    """Similar sources of two students. A share is the fraction of a source's own tokens that the other contains."""

    students: tuple[str, str]
    files: tuple[str, str]
    shares: tuple[float, float]
    own_tokens: tuple[int, int]
    stretches: tuple[Stretch, ...]

    @property
    def share(self) -> float:
        """The larger share: a copy may be all of one source and half of the other."""
        return max(self.shares)


@dataclass(frozen=True, slots=True)
class SourceComparison:
    """The similar sources of a batch, the most similar first.

    ``same`` are groups that share a whole file apart from names, comments and layout, however large. ``too_short`` are
    students with too little own code. ``not_compared`` is the number of pairs beyond the limit.
    """

    alike: tuple[SimilarSources, ...]
    too_short: tuple[str, ...]
    not_compared: int = 0
    same: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True, slots=True)
class _IndexedSource:
    source: Source
    grams: NDArray[np.uint64]
    is_own: NDArray[np.bool_]  # for each gram: varied, and neither given nor common
    own_tokens: NDArray[np.bool_]  # for each token: in a varied gram, and in none that is given or common
    fingerprints: NDArray[np.uint64]

    @property
    def own(self) -> int:
        return int(self.own_tokens.sum())


def build_source(student: str, file: str, text: str) -> Source:
    """Return the text in its compared form. The text itself is not kept."""
    return Source(student, file, tokenise_source(text))


def compare_sources(
    sources: Sequence[Source], given: Sequence[str], alike: float = SIMILARITY_THRESHOLD
) -> SourceComparison:
    """Return all pairs of different students' sources that are similar.

    In a similar pair, the fraction ``alike`` of one source's own tokens is also in the other. The students of a pair
    are in order of name.
    """
    sources = sorted(sources, key=lambda source: source.student)
    all_grams = [compute_grams(source.tokens) for source in sources]
    all_given = _compute_given_grams(given)
    left_out = np.union1d(all_given, _find_common_grams(sources, all_grams))
    indexed = [_index_source(source, own, left_out) for source, own in zip(sources, all_grams, strict=True)]
    long_enough = [each for each in indexed if each.own >= FEWEST_TOKENS]
    candidates = list(_find_candidates(long_enough, alike))
    chosen = nlargest(MOST_PAIRS, candidates, key=lambda candidate: candidate[0])
    compared = (_compare_pair(one, other) for _, one, other in chosen)
    found = sorted(
        (each for each in compared if each.share >= alike), key=lambda each: (-each.share, each.students, each.files)
    )
    same = _group_same_files(sources, all_grams, all_given)
    heard = {each.source.student for each in long_enough}.union(*same)
    too_short = sorted({source.student for source in sources} - heard)
    return SourceComparison(tuple(found), tuple(too_short), len(candidates) - len(chosen), same)


def _compute_given_grams(texts: Sequence[str]) -> NDArray[np.uint64]:
    return np.concatenate([np.empty(0, np.uint64), *(compute_grams(tokenise_source(text)) for text in texts)])


def _group_same_files(
    sources: Sequence[Source], all_grams: Sequence[NDArray[np.uint64]], given: NDArray[np.uint64]
) -> tuple[tuple[str, ...], ...]:
    """Return groups that share a whole file with enough code that was not given.

    Files that nearly all students have are left out, because they must have been given in some other way.
    """
    students: dict[bytes, set[str]] = {}
    for source, own in zip(sources, all_grams, strict=True):
        size = len(source.tokens)
        if size - int(mark_covered_tokens(np.isin(own, given), size).sum()) >= FEWEST_TOKENS:
            students.setdefault(own.tobytes(), set()).add(source.student)
    most = max(FEWEST_IN_COMMON, NEARLY_ALL * len({source.student for source in sources}))
    groups = {tuple(sorted(group)) for group in students.values() if 1 < len(group) <= most}
    return tuple(sorted(groups, key=lambda group: (-len(group), group)))


def _find_common_grams(sources: Sequence[Source], all_grams: Sequence[NDArray[np.uint64]]) -> NDArray[np.uint64]:
    of_students: dict[str, list[NDArray[np.uint64]]] = {}
    for source, own in zip(sources, all_grams, strict=True):
        of_students.setdefault(source.student, []).append(own)
    once_each = [np.unique(np.concatenate(own)) for own in of_students.values()]
    found, counts = np.unique(np.concatenate([np.empty(0, np.uint64), *once_each]), return_counts=True)
    return found[counts >= max(FEWEST_IN_COMMON, COMMON_PART * len(of_students))]


def _index_source(source: Source, own: NDArray[np.uint64], left_out: NDArray[np.uint64]) -> _IndexedSource:
    masked, telling = np.isin(own, left_out), mark_varied_grams(source.tokens)
    is_own, size = telling & ~masked, len(source.tokens)
    places = select_fingerprints(own)
    fingerprints = np.unique(own[places[is_own[places]]])
    return _IndexedSource(
        source, own, is_own, mark_covered_tokens(telling, size) & ~mark_covered_tokens(masked, size), fingerprints
    )


def _find_candidates(
    indexed: Sequence[_IndexedSource], alike: float
) -> Iterator[tuple[float, _IndexedSource, _IndexedSource]]:
    """Yield pairs with enough common fingerprints to be similar, and the common fraction."""
    if not indexed:
        return
    numbers = np.concatenate([each.fingerprints for each in indexed])
    owners = np.repeat(np.arange(len(indexed)), [len(each.fingerprints) for each in indexed])
    order = np.argsort(numbers, kind="stable")
    numbers, owners = numbers[order], owners[order]
    for place, one in enumerate(indexed):
        begins = np.searchsorted(numbers, one.fingerprints, "left")
        ends = np.searchsorted(numbers, one.fingerprints, "right")
        who = [owners[begin:end] for begin, end in zip(begins, ends, strict=True) if end - begin > 1]
        shared = np.bincount(np.concatenate([np.empty(0, np.int64), *who]), minlength=len(indexed))
        for number in (np.flatnonzero(shared[place + 1 :]) + place + 1).tolist():
            other = indexed[number]
            part = shared[number] / min(len(one.fingerprints), len(other.fingerprints))
            # Half of the threshold, because fingerprints are a sample.
            if part >= alike / 2 and one.source.student != other.source.student:
                yield float(part), one, other


def _compare_pair(one: _IndexedSource, other: _IndexedSource) -> SimilarSources:
    like = np.isin(one.grams, other.grams[other.is_own]) & one.is_own
    other_like = np.isin(other.grams, one.grams[one.is_own]) & other.is_own
    shares = (_compute_share(one, like), _compute_share(other, other_like))
    return SimilarSources(
        (one.source.student, other.source.student),
        (one.source.file, other.source.file),
        shares,
        (one.own, other.own),
        _find_stretches(one, other, like),
    )


def _compute_share(one: _IndexedSource, like: NDArray[np.bool_]) -> float:
    return float((mark_covered_tokens(like, len(one.source.tokens)) & one.own_tokens).sum() / one.own)


def _find_stretches(one: _IndexedSource, other: _IndexedSource, like: NDArray[np.bool_]) -> tuple[Stretch, ...]:
    """Return the longest common stretches, found from the top of one source, the longest first."""
    own, others = _map_own_grams(one), _map_own_grams(other)
    places: dict[int, list[int]] = {}
    for place, number in others.items():
        places.setdefault(number, []).append(place)
    found: list[tuple[int, int, int]] = []
    end = 0
    for begin in np.flatnonzero(like).tolist():
        if begin >= end:
            runs = [(_measure_run(own, others, begin, at), -at) for at in places[own[begin]][:_MOST_PLACES]]
            length, at = max(runs)
            found.append((begin, -at, length))
            end = begin + length + GRAM - 1
    longest = sorted(found, key=lambda each: (-each[2], each[0]))[:_MOST_STRETCHES]
    return tuple(_build_stretch(one, other, each) for each in longest)


def _map_own_grams(indexed: _IndexedSource) -> dict[int, int]:
    places = np.flatnonzero(indexed.is_own)
    return dict(zip(places.tolist(), indexed.grams[places].tolist(), strict=True))


def _measure_run(own: Mapping[int, int], others: Mapping[int, int], begin: int, at: int) -> int:
    """Return how many consecutive grams are equal from there on."""
    length = 0
    while (number := own.get(begin + length)) is not None and number == others.get(at + length):
        length += 1
    return length


def _build_stretch(one: _IndexedSource, other: _IndexedSource, grams_in_row: tuple[int, int, int]) -> Stretch:
    begin, at, count = grams_in_row
    size = count + GRAM - 1
    lines = one.source.tokens.lines[begin : begin + size]
    other_lines = other.source.tokens.lines[at : at + size]
    return Stretch(_compute_span(lines), _compute_span(other_lines), size)


def _compute_span(lines: NDArray[np.int64]) -> tuple[int, int]:
    return int(lines.min()), int(lines.max())
