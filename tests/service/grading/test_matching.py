"""Matching of requirements with the items of a run: as many as an exhaustive search finds, and only suitable pairs."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from hypothesis import given
from hypothesis import strategies as st

from service.grading.judging.matching import match_maximum_in_order, match_maximum_pairs

tables = st.integers(0, 5).flatmap(
    lambda width: st.lists(st.lists(st.booleans(), min_size=width, max_size=width), min_size=1, max_size=5)
)


def ways(wishes: int, candidates: int) -> itertools.product[tuple[int | None, ...]]:
    """Return every choice of a candidate, or of none, for each requirement."""
    return itertools.product([None, *range(candidates)], repeat=wishes)


def suited(table: Sequence[Sequence[bool]], chosen: Sequence[int | None]) -> bool:
    return all(place is None or table[wish][place] for wish, place in enumerate(chosen))


def met(chosen: Sequence[int | None]) -> int:
    return sum(place is not None for place in chosen)


@given(tables)
def test_as_many_pairs_as_an_exhaustive_search_finds(table: list[list[bool]]) -> None:
    def is_pairing(chosen: Sequence[int | None]) -> bool:
        taken = [place for place in chosen if place is not None]
        return suited(table, chosen) and len(set(taken)) == len(taken)

    matches = match_maximum_pairs(table)
    assert is_pairing(matches)
    assert met(matches) == max(met(way) for way in ways(len(table), len(table[0])) if is_pairing(way))


@given(tables, st.sampled_from((0, 1)))
def test_as_many_in_order_as_an_exhaustive_search_finds(table: list[list[bool]], step: int) -> None:
    def is_in_order(chosen: Sequence[int | None]) -> bool:
        taken = [place for place in chosen if place is not None]
        return suited(table, chosen) and all(after >= before + step for before, after in itertools.pairwise(taken))

    def first_from(wish: int, start: int) -> int | None:
        return next((place for place in range(start, len(table[wish])) if table[wish][place]), None)

    matches = match_maximum_in_order(len(table), first_from, step)
    assert is_in_order(matches)
    assert met(matches) == max(met(way) for way in ways(len(table), len(table[0])) if is_in_order(way))


def test_what_comes_first_is_paired_first() -> None:
    assert match_maximum_pairs([[True, True], [True, True]]) == [0, 1]
    assert match_maximum_pairs([[True, True], [True, False]]) == [1, 0]
    assert match_maximum_pairs([[True], [True]]) == [0, None]
