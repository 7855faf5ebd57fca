"""Tables and zones that stand inside a criterion.

A criterion itself is in the module of its family.
"""

from __future__ import annotations

#: left, bottom, right, top, mm
Zone = tuple[float, float, float, float]


def zone_with_room(zone: Zone) -> Zone:
    """Refuses a zone that nothing can be in."""
    if not (zone[0] < zone[2] and zone[1] < zone[3]):
        raise ValueError("is empty, expected [left, bottom, right, top]")
    return zone
