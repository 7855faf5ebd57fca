"""Token streams cut into grams, and the few of them that winnowing picks as a stream's fingerprints.

S. Schleimer, D. Wilkerson, A. Aiken: Winnowing: Local Algorithms for Document Fingerprinting. SIGMOD 2003. Whatever two
streams share of GRAM + WINDOW - 1 tokens in a row gives both a fingerprint; what is shorter than GRAM never does.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from service.similarity.tokens import Tokens

#: Tokens in a gram, and the neighbours of which one is picked.
GRAM, WINDOW = 8, 3
#: Different tokens in a gram that says something; ``[number], [number]`` has four.
FEWEST_DIFFERENT = 5

_FACTOR, _MIX = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9)


def grams(tokens: Tokens) -> NDArray[np.uint64]:
    """A number for each run of GRAM tokens, in their order; equal where the runs are."""
    if len(tokens) < GRAM:
        return np.empty(0, np.uint64)
    mixed = (tokens.numbers + np.uint64(1)) * _FACTOR
    mixed ^= mixed >> np.uint64(29)
    made = np.zeros(len(tokens) - GRAM + 1, np.uint64)
    for place in range(GRAM):
        made = made * _MIX + mixed[place : place + len(made)]
    return made ^ (made >> np.uint64(32))


def varied(tokens: Tokens) -> NDArray[np.bool_]:
    """Of each gram, whether it has enough different tokens to say something; those of tables of numbers have not."""
    if len(tokens) < GRAM:
        return np.empty(0, np.bool_)
    in_order = np.sort(sliding_window_view(tokens.numbers, GRAM), axis=1)
    steps = np.count_nonzero(in_order[:, 1:] != in_order[:, :-1], axis=1)
    return np.asarray(steps + 1 >= FEWEST_DIFFERENT)


def winnowed(numbers: NDArray[np.uint64]) -> NDArray[np.int64]:
    """The places of the fingerprints: in every window the least number, of equals the last."""
    if len(numbers) == 0:
        return np.empty(0, np.int64)
    size = min(WINDOW, len(numbers))
    windows = sliding_window_view(numbers, size)[:, ::-1]
    least = size - 1 - windows.argmin(axis=1)
    return np.unique(least + np.arange(len(windows)))


def covered(places: NDArray[np.bool_], tokens: int) -> NDArray[np.bool_]:
    """Which tokens are in a gram that is marked."""
    edges = np.zeros(tokens + 1, np.int64)
    np.add.at(edges, np.flatnonzero(places), 1)
    np.add.at(edges, np.flatnonzero(places) + GRAM, -1)
    return edges[:-1].cumsum() > 0
