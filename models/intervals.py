"""How sure a share is that was counted: the interval of Wilson.

It knows counts only, not what was counted.
"""

from __future__ import annotations

import math

_Z95 = 1.959963984540054


def wilson(right: int, count: int) -> tuple[float, float]:
    """The 95 % interval of a share (Wilson, J. Am. Stat. Assoc. 22 (1927) 209); 0 to 1 for no trials at all."""
    if count == 0:
        return 0.0, 1.0
    share = right / count
    square = _Z95 * _Z95
    middle = (share + square / (2 * count)) / (1 + square / count)
    half = _Z95 * math.sqrt(share * (1 - share) / count + square / (4 * count * count)) / (1 + square / count)
    # At the ends the interval touches them exactly; rounding must not push it past.
    low = 0.0 if right == 0 else max(middle - half, 0.0)
    high = 1.0 if right == count else min(middle + half, 1.0)
    return low, high
