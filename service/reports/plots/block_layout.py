"""Layout of block diagrams: blocks further along the arrows are further along the page.

Positions are counted in levels, and in rows across them. ``block_drawing.py`` converts them to inches.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from submissions.diagram import Diagram


@dataclass(frozen=True, slots=True)
class BlockPosition:
    """The level of a block, from 0, and its row: 0 is the middle, with as many before as after it."""

    level: int
    row: float


def compute_layout(diagram: Diagram) -> Mapping[str, BlockPosition]:
    """Return a position for each actor. Arrows count in the order of the text, whatever their direction."""
    arrow_names = [name for arrow in diagram.arrows for name in (arrow.source, arrow.target)]
    order = {
        name: number for number, name in enumerate(dict.fromkeys([*arrow_names, *(a.name for a in diagram.actors)]))
    }
    group_numbers = {name: number for number, each in enumerate(diagram.groups) for name in each.members}
    levels = dict.fromkeys(order, 0)
    pairs = sorted({tuple(sorted((order[a.source], order[a.target]))) for a in diagram.arrows if a.source != a.target})
    names = list(order)
    for first_index, second_index in pairs:  # the levels of earlier actors are final
        levels[names[second_index]] = max(levels[names[second_index]], levels[names[first_index]] + 1)
    layout: dict[str, BlockPosition] = {}
    for level in range(max(levels.values(), default=0) + 1):
        level_names = sorted(
            (name for name in order if levels[name] == level),
            key=lambda name: (group_numbers.get(name, -1), order[name]),
        )
        for row, name in enumerate(level_names):
            layout[name] = BlockPosition(level, row - (len(level_names) - 1) / 2)
    return layout
