"""Drawing of block diagrams: one box per actor, with arrows between them.

``block_layout.py`` assigns the levels. This module draws any diagram.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from matplotlib.figure import Figure

from service.reports.plots.block_layout import compute_layout
from service.reports.plots.diagram_parts import (
    CHARACTERS,
    LINE_HEIGHT,
    Highlights,
    break_label,
    choose_arrow_colour,
    draw_actor,
    draw_arrow,
    draw_group_frame,
    draw_label,
)
from service.reports.plots.style import HEAD, WIDTH, add_axes, create_figure
from submissions.diagram import Diagram, DiagramArrow

_MOST_ACROSS = 4  # levels side by side; more go down the page
_BOX = 1.02  # inches, the width of the widest label
_GAP = 0.44  # between boxes, unless a label needs more
_ROW = 0.42  # between boxes below each other
_MARGIN = 0.16
_FOOT = 0.28
_TWO_WAYS = 0.07  # distance from the middle, if two arrows connect the same boxes
#: The bends of a line to the left or right, to avoid a box.
_BENDS = (0.0, 0.25, -0.25, 0.45, -0.45, 0.7, -0.7, 1.0, -1.0)

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class _PageLayout:
    """Box sizes, box centres and page size, in inches."""

    box: Point
    centres: Mapping[str, Point]
    width: float
    height: float


def draw_blocks(diagram: Diagram, title: str, subtitle: str, highlights: Highlights) -> Figure:
    """Draw the diagram across the page or, with many levels or long labels, down the page."""
    diagram = replace(diagram, steps=_merge_arrows(diagram))
    sheet = _compute_page_layout(diagram)
    figure = create_figure(HEAD + sheet.height + _FOOT, title, subtitle, sheet.width)
    axes = add_axes(figure, 0, _FOOT, sheet.width, sheet.height)
    axes.set_axis_off()
    axes.set_xlim(0, sheet.width)
    axes.set_ylim(0, sheet.height)
    width, height = sheet.box
    for group in diagram.groups:
        at = [sheet.centres[name] for name in group.members]
        if at:
            left, low = min(x for x, _ in at) - width / 2 - 0.09, min(y for _, y in at) - height / 2 - 0.09
            right, top = max(x for x, _ in at) + width / 2 + 0.09, max(y for _, y in at) + height / 2 + 0.22
            draw_group_frame(axes, left, low, right - left, top - low, group.colour, group.label)
    patches = {}
    for actor in diagram.actors:
        x, y = sheet.centres[actor.name]
        patches[actor.name] = draw_actor(
            axes, actor, x, y, width, height, break_label(actor.label, width - 0.1, 4), highlights
        )
    pairs = {(arrow.source, arrow.target) for arrow in diagram.arrows}
    for number, arrow in enumerate(diagram.arrows):
        shift = _TWO_WAYS if (arrow.target, arrow.source) in pairs else 0.0
        if arrow.source == arrow.target:
            continue
        start, end, bend = _route_arrow(arrow, sheet, shift, 1 if number % 2 else -1)
        draw_arrow(axes, arrow, start, end, highlights, (patches[arrow.source], patches[arrow.target]), bend)
        signed = highlights.add_sign(arrow, break_label(arrow.label, 2.0, 3))
        x, y = _place_label(start, end, bend, signed if shift else ())
        draw_label(axes, x, y, signed, choose_arrow_colour(arrow, highlights), va="center")
    highlights.draw_explanation(figure)
    return figure


def _merge_arrows(diagram: Diagram) -> tuple[DiagramArrow, ...]:
    """Return the arrows, with coinciding ones merged and their labels joined."""
    found: dict[tuple[str, str, str], DiagramArrow] = {}
    for arrow in diagram.arrows:
        key = (arrow.source, arrow.target, arrow.heads)
        before = found.get(key)
        words = [each.label for each in (before, arrow) if each is not None and each.label]
        found[key] = replace(before or arrow, label=" / ".join(dict.fromkeys(words)))
    return tuple(found.values())


def _compute_page_layout(diagram: Diagram) -> _PageLayout:
    layout = compute_layout(diagram)
    levels = 1 + max(position.level for position in layout.values())
    rows = 1 + int(2 * max(position.row for position in layout.values()))
    words = max((len(line) for arrow in diagram.arrows for line in break_label(arrow.label, 2.0, 3)), default=0)
    gap = max(_GAP, words / CHARACTERS + 0.26)
    down = diagram.portrait or levels > _MOST_ACROSS or _compute_width(levels, gap) > WIDTH
    across, below = (rows, levels) if down else (levels, rows)
    width = max(WIDTH, _compute_width(across, gap))
    lines = max(len(break_label(actor.label, _BOX - 0.1, 4)) for actor in diagram.actors)
    framed = 0.24 if diagram.groups else 0.0
    box = (_BOX, max(0.4, LINE_HEIGHT * lines + 0.2))
    spread = (width - 2 * _MARGIN - _BOX) / max(1, across - 1)
    step = (_BOX + gap if down else min(_BOX + 1.4, spread), box[1] + _ROW + framed)
    height = box[1] + step[1] * (below - 1) + 2 * _MARGIN + framed
    centres = {}
    for name, position in layout.items():
        level = position.level - (levels - 1) / 2
        right, low = (position.row, level) if down else (level, position.row)
        centres[name] = (width / 2 + right * step[0], height / 2 - low * step[1])
    return _PageLayout(box, centres, width, height)


def _compute_width(boxes: int, gap: float) -> float:
    """Return the width of boxes beside each other, in inches."""
    return boxes * _BOX + (boxes - 1) * gap + 2 * _MARGIN


def _route_arrow(arrow: DiagramArrow, sheet: _PageLayout, shift: float, side: int) -> tuple[Point, Point, float]:
    """Return the line's ends and bend: shifted if there is a return arrow, and bent round boxes in its way."""
    (x, y), (to_x, to_y) = sheet.centres[arrow.source], sheet.centres[arrow.target]
    length = max(1e-6, ((to_x - x) ** 2 + (to_y - y) ** 2) ** 0.5)
    aside = (-(to_y - y) / length * shift, (to_x - x) / length * shift)
    start, end = (x + aside[0], y + aside[1]), (to_x + aside[0], to_y + aside[1])
    others = [at for name, at in sheet.centres.items() if name not in (arrow.source, arrow.target)]
    for bend in (side * each for each in _BENDS):
        if not any(_is_crossing_box(at, start, end, bend, sheet.box) for at in others):
            return start, end, bend
    return start, end, 0.0


def _compute_curve_point(start: Point, end: Point, bend: float, part: float) -> Point:
    """Return a point on the curve that Matplotlib draws as ``arc3``, at the fraction ``part`` of its length."""
    control = (
        (start[0] + end[0]) / 2 + bend * (end[1] - start[1]),
        (start[1] + end[1]) / 2 - bend * (end[0] - start[0]),
    )
    a, b, c = (1 - part) ** 2, 2 * part * (1 - part), part**2
    return a * start[0] + b * control[0] + c * end[0], a * start[1] + b * control[1] + c * end[1]


def _is_crossing_box(
    box: Point,
    start: Point,
    end: Point,
    bend: float,
    size: Point,
) -> bool:
    for step in range(1, 24):
        x, y = _compute_curve_point(start, end, bend, step / 24)
        if abs(x - box[0]) < size[0] / 2 + 0.04 and abs(y - box[1]) < size[1] / 2 + 0.04:
            return True
    return False


def _place_label(start: Point, end: Point, bend: float, beside: tuple[str, ...]) -> Point:
    """Return the middle of the curve, or the centre of a label ``beside`` it, on its left."""
    x, y = _compute_curve_point(start, end, bend, 0.5)
    if not beside:
        return x, y
    length = max(1e-6, ((end[0] - start[0]) ** 2 + (end[1] - start[1]) ** 2) ** 0.5)
    across, up = -(end[1] - start[1]) / length, (end[0] - start[0]) / length
    half = max(map(len, beside)) / CHARACTERS / 2, LINE_HEIGHT * len(beside) / 2
    away = abs(across) * half[0] + abs(up) * half[1] + 0.04
    return x + across * away, y + up * away
