"""Division of token streams into grams, and selection of fingerprints by winnowing.

S. Schleimer, D. Wilkerson, A. Aiken: Winnowing: Local Algorithms for Document Fingerprinting. SIGMOD 2003. If two
streams share GRAM + WINDOW - 1 consecutive tokens, both have the same fingerprint. Matches shorter than GRAM are never
found.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from service.similarity.tokens import Tokens

#: The number of tokens in a gram, and of neighbours from which one is selected.
GRAM, WINDOW = 8, 3
#: The least number of different tokens in a significant gram; ``[number], [number]`` has four.
MIN_DIFFERENT_TOKENS = 5

_FACTOR, _MIX = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9)


def compute_grams(tokens: Tokens) -> NDArray[np.uint64]:
    """Return a number for each run of GRAM tokens, in order; equal runs have equal numbers."""
    if len(tokens) < GRAM:
        return np.empty(0, np.uint64)
    mixed_numbers = (tokens.numbers + np.uint64(1)) * _FACTOR
    mixed_numbers ^= mixed_numbers >> np.uint64(29)
    grams = np.zeros(len(tokens) - GRAM + 1, np.uint64)
    for offset in range(GRAM):
        grams = grams * _MIX + mixed_numbers[offset : offset + len(grams)]
    return grams ^ (grams >> np.uint64(32))


def mark_varied_grams(tokens: Tokens) -> NDArray[np.bool_]:
    """Return for each gram whether it has enough different tokens. Grams of number tables don't."""
    if len(tokens) < GRAM:
        return np.empty(0, np.bool_)
    sorted_windows = np.sort(sliding_window_view(tokens.numbers, GRAM), axis=1)
    steps = np.count_nonzero(sorted_windows[:, 1:] != sorted_windows[:, :-1], axis=1)
    return np.asarray(steps + 1 >= MIN_DIFFERENT_TOKENS)


def select_fingerprints(numbers: NDArray[np.uint64]) -> NDArray[np.int64]:
    """Return the places of the fingerprints: the smallest number in every window, the last among equals."""
    if len(numbers) == 0:
        return np.empty(0, np.int64)
    size = min(WINDOW, len(numbers))
    windows = sliding_window_view(numbers, size)[:, ::-1]
    offsets = size - 1 - windows.argmin(axis=1)
    return np.unique(offsets + np.arange(len(windows)))


def mark_covered_tokens(places: NDArray[np.bool_], tokens: int) -> NDArray[np.bool_]:
    """Return which tokens are in a marked gram."""
    edges = np.zeros(tokens + 1, np.int64)
    np.add.at(edges, np.flatnonzero(places), 1)
    np.add.at(edges, np.flatnonzero(places) + GRAM, -1)
    return edges[:-1].cumsum() > 0
