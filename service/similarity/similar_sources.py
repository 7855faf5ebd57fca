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
MIN_TOKENS = 60
#: Code in at least this fraction and number of the students' work is common: from the docs, or a hint in class.
COMMON_PART, MIN_IN_COMMON = 1 / 3, 5
#: A file shared by more than this fraction of the students is not a student's own.
NEARLY_ALL = 2 / 3
#: The number of pairs compared, those with most in common. Hundreds of copies of one large file make thousands of
#: pairs.
MAX_PAIRS = 2000
#: The number of places of a gram at which a stretch may continue.
_MAX_PLACES = 8
_MAX_STRETCHES = 50


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
    sources: Sequence[Source], given_code: Sequence[str], cutoff: float = SIMILARITY_THRESHOLD
) -> SourceComparison:
    """Return all pairs of different students' sources that are similar.

    In a similar pair, the fraction ``cutoff`` of one source's own tokens is also in the other. The students of a pair
    are in order of name.
    """
    sources = sorted(sources, key=lambda source: source.student)
    all_grams = [compute_grams(source.tokens) for source in sources]
    given_grams = _compute_given_grams(given_code)
    excluded_grams = np.union1d(given_grams, _find_common_grams(sources, all_grams))
    indexed_sources = [
        _index_source(source, own, excluded_grams) for source, own in zip(sources, all_grams, strict=True)
    ]
    long_sources = [each for each in indexed_sources if each.own >= MIN_TOKENS]
    candidates = list(_find_candidates(long_sources, cutoff))
    chosen_pairs = nlargest(MAX_PAIRS, candidates, key=lambda candidate: candidate[0])
    compared_pairs = (_compare_pair(one, other) for _, one, other in chosen_pairs)
    similar_pairs = sorted(
        (each for each in compared_pairs if each.share >= cutoff),
        key=lambda each: (-each.share, each.students, each.files),
    )
    same_files = _group_same_files(sources, all_grams, given_grams)
    compared_students = {each.source.student for each in long_sources}.union(*same_files)
    too_short = sorted({source.student for source in sources} - compared_students)
    return SourceComparison(tuple(similar_pairs), tuple(too_short), len(candidates) - len(chosen_pairs), same_files)


def _compute_given_grams(texts: Sequence[str]) -> NDArray[np.uint64]:
    return np.concatenate([np.empty(0, np.uint64), *(compute_grams(tokenise_source(text)) for text in texts)])


def _group_same_files(
    sources: Sequence[Source], all_grams: Sequence[NDArray[np.uint64]], given_grams: NDArray[np.uint64]
) -> tuple[tuple[str, ...], ...]:
    """Return groups that share a whole file with enough code that was not given.

    Files that nearly all students have are left out, because they must have been given in some other way.
    """
    students: dict[bytes, set[str]] = {}
    for source, grams in zip(sources, all_grams, strict=True):
        size = len(source.tokens)
        if size - int(mark_covered_tokens(np.isin(grams, given_grams), size).sum()) >= MIN_TOKENS:
            students.setdefault(grams.tobytes(), set()).add(source.student)
    max_students = max(MIN_IN_COMMON, NEARLY_ALL * len({source.student for source in sources}))
    groups = {tuple(sorted(group)) for group in students.values() if 1 < len(group) <= max_students}
    return tuple(sorted(groups, key=lambda group: (-len(group), group)))


def _find_common_grams(sources: Sequence[Source], all_grams: Sequence[NDArray[np.uint64]]) -> NDArray[np.uint64]:
    student_grams: dict[str, list[NDArray[np.uint64]]] = {}
    for source, grams in zip(sources, all_grams, strict=True):
        student_grams.setdefault(source.student, []).append(grams)
    unique_grams = [np.unique(np.concatenate(own)) for own in student_grams.values()]
    all_unique, counts = np.unique(np.concatenate([np.empty(0, np.uint64), *unique_grams]), return_counts=True)
    return all_unique[counts >= max(MIN_IN_COMMON, COMMON_PART * len(student_grams))]


def _index_source(source: Source, grams: NDArray[np.uint64], excluded_grams: NDArray[np.uint64]) -> _IndexedSource:
    is_excluded, is_varied = np.isin(grams, excluded_grams), mark_varied_grams(source.tokens)
    is_own, size = is_varied & ~is_excluded, len(source.tokens)
    places = select_fingerprints(grams)
    fingerprints = np.unique(grams[places[is_own[places]]])
    return _IndexedSource(
        source,
        grams,
        is_own,
        mark_covered_tokens(is_varied, size) & ~mark_covered_tokens(is_excluded, size),
        fingerprints,
    )


def _find_candidates(
    indexed_sources: Sequence[_IndexedSource], cutoff: float
) -> Iterator[tuple[float, _IndexedSource, _IndexedSource]]:
    """Yield pairs with enough common fingerprints to be similar, and the common fraction."""
    if not indexed_sources:
        return
    numbers = np.concatenate([each.fingerprints for each in indexed_sources])
    owners = np.repeat(np.arange(len(indexed_sources)), [len(each.fingerprints) for each in indexed_sources])
    order = np.argsort(numbers, kind="stable")
    numbers, owners = numbers[order], owners[order]
    for index, first_source in enumerate(indexed_sources):
        starts = np.searchsorted(numbers, first_source.fingerprints, "left")
        ends = np.searchsorted(numbers, first_source.fingerprints, "right")
        sharing_owners = [owners[begin:end] for begin, end in zip(starts, ends, strict=True) if end - begin > 1]
        shared_counts = np.bincount(
            np.concatenate([np.empty(0, np.int64), *sharing_owners]), minlength=len(indexed_sources)
        )
        for number in (np.flatnonzero(shared_counts[index + 1 :]) + index + 1).tolist():
            second_source = indexed_sources[number]
            share = shared_counts[number] / min(len(first_source.fingerprints), len(second_source.fingerprints))
            # Half of the threshold, because fingerprints are a sample.
            if share >= cutoff / 2 and first_source.source.student != second_source.source.student:
                yield float(share), first_source, second_source


def _compare_pair(first_source: _IndexedSource, second_source: _IndexedSource) -> SimilarSources:
    is_shared = np.isin(first_source.grams, second_source.grams[second_source.is_own]) & first_source.is_own
    is_shared_by_first = np.isin(second_source.grams, first_source.grams[first_source.is_own]) & second_source.is_own
    shares = (_compute_share(first_source, is_shared), _compute_share(second_source, is_shared_by_first))
    return SimilarSources(
        (first_source.source.student, second_source.source.student),
        (first_source.source.file, second_source.source.file),
        shares,
        (first_source.own, second_source.own),
        _find_stretches(first_source, second_source, is_shared),
    )


def _compute_share(indexed_source: _IndexedSource, is_shared: NDArray[np.bool_]) -> float:
    return float(
        (mark_covered_tokens(is_shared, len(indexed_source.source.tokens)) & indexed_source.own_tokens).sum()
        / indexed_source.own
    )


def _find_stretches(
    first_source: _IndexedSource, second_source: _IndexedSource, is_shared: NDArray[np.bool_]
) -> tuple[Stretch, ...]:
    """Return the longest common stretches, found from the top of one source, the longest first."""
    first_grams, second_grams = _map_own_grams(first_source), _map_own_grams(second_source)
    places: dict[int, list[int]] = {}
    for place, number in second_grams.items():
        places.setdefault(number, []).append(place)
    stretches: list[tuple[int, int, int]] = []
    end = 0
    for start in np.flatnonzero(is_shared).tolist():
        if start >= end:
            runs = [
                (_measure_run(first_grams, second_grams, start, at), -at)
                for at in places[first_grams[start]][:_MAX_PLACES]
            ]
            length, negated_start = max(runs)
            stretches.append((start, -negated_start, length))
            end = start + length + GRAM - 1
    longest = sorted(stretches, key=lambda each: (-each[2], each[0]))[:_MAX_STRETCHES]
    return tuple(_build_stretch(first_source, second_source, each) for each in longest)


def _map_own_grams(indexed: _IndexedSource) -> dict[int, int]:
    places = np.flatnonzero(indexed.is_own)
    return dict(zip(places.tolist(), indexed.grams[places].tolist(), strict=True))


def _measure_run(
    first_grams: Mapping[int, int], second_grams: Mapping[int, int], first_start: int, second_start: int
) -> int:
    """Return how many consecutive grams are equal from there on."""
    length = 0
    while (number := first_grams.get(first_start + length)) is not None and number == second_grams.get(
        second_start + length
    ):
        length += 1
    return length


def _build_stretch(
    first_source: _IndexedSource, second_source: _IndexedSource, grams_in_row: tuple[int, int, int]
) -> Stretch:
    first_start, second_start, count = grams_in_row
    size = count + GRAM - 1
    lines = first_source.source.tokens.lines[first_start : first_start + size]
    other_lines = second_source.source.tokens.lines[second_start : second_start + size]
    return Stretch(_compute_span(lines), _compute_span(other_lines), size)


def _compute_span(lines: NDArray[np.int64]) -> tuple[int, int]:
    return int(lines.min()), int(lines.max())
