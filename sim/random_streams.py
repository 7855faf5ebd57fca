"""Random streams keyed by the trial's seed, a name and a tick, so that streams do not affect each other.

Streams have no state. The same question gives the same numbers, regardless of other draws.
"""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

_TO_UNIT = 2.0**-53


class RandomStream:
    """A named random stream of a trial, such as ``left light`` or ``channel``."""

    def __init__(self, seed: int, name: str) -> None:
        self._key = hashlib.blake2b(f"{seed}:{name}".encode(), digest_size=16).digest()
        self._philox_key = np.frombuffer(self._key, dtype="<u8").astype(np.uint64)

    def integer(self, tick: int, index: int = 0) -> int:
        """Return 64 random bits."""
        data = tick.to_bytes(8, "little") + index.to_bytes(8, "little")
        return int.from_bytes(hashlib.blake2b(data, key=self._key, digest_size=8).digest(), "little")

    def uniform(self, tick: int, index: int = 0) -> float:
        """Return a number in [0, 1)."""
        return (self.integer(tick, index) >> 11) * _TO_UNIT

    def between(self, low: float, high: float, tick: int, index: int = 0) -> float:
        """Return a number in [low, high)."""
        return low + (high - low) * self.uniform(tick, index)

    def uniforms(self, tick: int, count: int) -> NDArray[np.float64]:
        """Return ``count`` numbers in [0, 1), shape (count,)."""
        generator = np.random.Philox(key=self._philox_key, counter=[0, 0, 0, tick])
        raw: NDArray[np.uint64] = np.asarray(generator.random_raw(count), dtype=np.uint64)
        return np.asarray((raw >> np.uint64(11)) * _TO_UNIT, dtype=np.float64)
