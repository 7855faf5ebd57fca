"""Matching of a criterion's requirements with the content of a run, for as many matches as possible.

The first candidate for one requirement may be the only one for a later one, so pairs stay open until the end.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

#: For each requirement, whether each candidate matches.
MatchMatrix = Sequence[Sequence[bool]]


def match_maximum_pairs(matches: MatchMatrix) -> list[int | None]:
    """Return the candidate of each requirement, None without one, with as many pairs as possible.

    Uses maximum bipartite matching by augmenting paths. Among equal solutions, earlier requirements get candidates.
    """
    pairs: list[int | None] = [None] * len(matches)
    owners: dict[int, int] = {}
    for wish in range(len(matches)):
        reached_from: dict[int, int] = {}
        candidate = _find_free_candidate(wish, matches, owners, reached_from)
        while candidate is not None:
            owner = reached_from[candidate]
            pairs[owner], owners[candidate], candidate = candidate, owner, pairs[owner]
    return pairs


def _find_free_candidate(
    wish: int, matches: MatchMatrix, owners: dict[int, int], reached_from: dict[int, int]
) -> int | None:
    """Return the nearest candidate without an owner, and record which requirement reached each candidate."""
    queue = deque([wish])
    while queue:
        owner = queue.popleft()
        new_candidates = [place for place, suited in enumerate(matches[owner]) if suited and place not in reached_from]
        reached_from.update(dict.fromkeys(new_candidates, owner))
        free_candidate = next((place for place in new_candidates if place not in owners), None)
        if free_candidate is not None:
            return free_candidate
        queue.extend(owners[place] for place in new_candidates)
    return None


def match_maximum_in_order(
    wishes: int, first_from: Callable[[int, int], int | None], step: int = 1
) -> list[int | None]:
    """Return the place of each requirement, None if it is left out, with as many in order as possible.

    ``first_from(wish, start)`` returns the first place from ``start`` on that matches. The search for the next
    requirement begins ``step`` places further on (0: at the same place). Among equal solutions, earlier requirements
    get places.
    """
    solutions: dict[tuple[int, int], tuple[int, int | None]] = {}

    def count(wish: int, start: int) -> int:
        return solutions[wish, start][0] if wish < wishes else 0

    open_states = [(0, 0)]
    while open_states:
        wish, start = open_states[-1]
        if (wish, start) in solutions:
            open_states.pop()
            continue
        candidate = first_from(wish, start)
        next_states = [(wish + 1, start)] + ([] if candidate is None else [(wish + 1, candidate + step)])
        missing_states = [state for state in next_states if wish + 1 < wishes and state not in solutions]
        if missing_states:
            open_states += missing_states
            continue
        count_without = count(wish + 1, start)
        count_with = -1 if candidate is None else 1 + count(wish + 1, candidate + step)
        solutions[wish, start] = max(count_with, count_without), candidate if count_with >= count_without else None
        open_states.pop()
    places: list[int | None] = []
    start = 0
    for wish in range(wishes):
        candidate = solutions[wish, start][1]
        places.append(candidate)
        start = start if candidate is None else candidate + step
    return places
