"""Streams of chance: each is keyed by the trial's seed, a name and a tick, so that no stream can disturb another.

There is no state to advance: asking twice gives the same numbers, and asking more often elsewhere changes nothing.
"""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

_TO_UNIT = 2.0**-53


class Stream:
    """One named stream of a trial, such as ``left light`` or ``channel``."""

    def __init__(self, seed: int, name: str) -> None:
        self._key = hashlib.blake2b(f"{seed}:{name}".encode(), digest_size=16).digest()
        self._philox_key = np.frombuffer(self._key, dtype="<u8").astype(np.uint64)

    def integer(self, tick: int, index: int = 0) -> int:
        """64 random bits."""
        data = tick.to_bytes(8, "little") + index.to_bytes(8, "little")
        return int.from_bytes(hashlib.blake2b(data, key=self._key, digest_size=8).digest(), "little")

    def uniform(self, tick: int, index: int = 0) -> float:
        """A number in [0, 1)."""
        return (self.integer(tick, index) >> 11) * _TO_UNIT

    def between(self, low: float, high: float, tick: int, index: int = 0) -> float:
        """A number in [low, high)."""
        return low + (high - low) * self.uniform(tick, index)

    def uniforms(self, tick: int, count: int) -> NDArray[np.float64]:
        """``count`` numbers in [0, 1), shape (count,)."""
        generator = np.random.Philox(key=self._philox_key, counter=[0, 0, 0, tick])
        raw: NDArray[np.uint64] = np.asarray(generator.random_raw(count), dtype=np.uint64)
        return np.asarray((raw >> np.uint64(11)) * _TO_UNIT, dtype=np.float64)
