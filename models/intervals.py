"""Wilson confidence interval of a proportion.

The module works on counts alone.
"""

from __future__ import annotations

import math

_Z95 = 1.959963984540054


def compute_wilson_interval(successes: int, count: int) -> tuple[float, float]:
    """Return the 95 % interval of a proportion (Wilson, J. Am. Stat. Assoc. 22 (1927) 209); (0, 1) without trials."""
    if count == 0:
        return 0.0, 1.0
    share = successes / count
    square = _Z95 * _Z95
    middle = (share + square / (2 * count)) / (1 + square / count)
    half = _Z95 * math.sqrt(share * (1 - share) / count + square / (4 * count * count)) / (1 + square / count)
    # The interval includes 0 or 1 exactly at the extremes; rounding must not exclude them.
    low = 0.0 if successes == 0 else max(middle - half, 0.0)
    high = 1.0 if successes == count else min(middle + half, 1.0)
    return low, high
