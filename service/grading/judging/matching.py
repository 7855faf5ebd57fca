"""Matching of a criterion's requirements with the content of a run, for as many matches as possible.

The first candidate for one requirement may be the only one for a later one, so pairs stay open until the end.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

#: For each requirement, whether each candidate matches.
MatchMatrix = Sequence[Sequence[bool]]


def match_most_pairs(suits: MatchMatrix) -> list[int | None]:
    """Return the candidate of each requirement, None without one, with as many pairs as possible.

    Uses maximum bipartite matching by augmenting paths. Among equal solutions, earlier requirements get candidates.
    """
    pairs: list[int | None] = [None] * len(suits)
    owners: dict[int, int] = {}
    for wish in range(len(suits)):
        reached_from: dict[int, int] = {}
        candidate = _find_free_candidate(wish, suits, owners, reached_from)
        while candidate is not None:
            owner = reached_from[candidate]
            pairs[owner], owners[candidate], candidate = candidate, owner, pairs[owner]
    return pairs


def _find_free_candidate(
    wish: int, suits: MatchMatrix, owners: dict[int, int], reached_from: dict[int, int]
) -> int | None:
    """Return the nearest candidate without an owner, and record which requirement reached each candidate."""
    waiting = deque([wish])
    while waiting:
        owner = waiting.popleft()
        new = [place for place, suited in enumerate(suits[owner]) if suited and place not in reached_from]
        reached_from.update(dict.fromkeys(new, owner))
        free = next((place for place in new if place not in owners), None)
        if free is not None:
            return free
        waiting.extend(owners[place] for place in new)
    return None


def match_most_in_order(wishes: int, first_from: Callable[[int, int], int | None], step: int = 1) -> list[int | None]:
    """Return the place of each requirement, None if it is left out, with as many in order as possible.

    ``first_from(wish, start)`` returns the first place from ``start`` on that matches. The search for the next
    requirement begins ``step`` places further on (0: at the same place). Among equal solutions, earlier requirements
    get places.
    """
    known: dict[tuple[int, int], tuple[int, int | None]] = {}

    def count(wish: int, start: int) -> int:
        return known[wish, start][0] if wish < wishes else 0

    unexplored = [(0, 0)]
    while unexplored:
        wish, start = unexplored[-1]
        if (wish, start) in known:
            unexplored.pop()
            continue
        place = first_from(wish, start)
        following = [(wish + 1, start)] + ([] if place is None else [(wish + 1, place + step)])
        missing = [state for state in following if wish + 1 < wishes and state not in known]
        if missing:
            unexplored += missing
            continue
        without = count(wish + 1, start)
        with_it = -1 if place is None else 1 + count(wish + 1, place + step)
        known[wish, start] = max(with_it, without), place if with_it >= without else None
        unexplored.pop()
    places: list[int | None] = []
    start = 0
    for wish in range(wishes):
        place = known[wish, start][1]
        places.append(place)
        start = start if place is None else place + step
    return places
