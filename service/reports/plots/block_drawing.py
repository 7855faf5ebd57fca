"""Drawing of block diagrams: one box per actor, with arrows between them.

Blocks further along the arrows are further along the page: positions are levels, and rows across them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from matplotlib.figure import Figure

from service.reports.plots.diagram_parts import (
    CHARACTERS,
    LINE_HEIGHT,
    Highlights,
    add_axes,
    break_label,
    choose_arrow_colour,
    create_figure,
    draw_actor,
    draw_arrow,
    draw_group_frame,
    draw_label,
)
from service.reports.plots.style import HEAD, WIDTH
from submissions.diagram import Diagram, DiagramArrow

_MAX_HORIZONTAL_LEVELS = 4  # levels side by side; more go down the page
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
    layout = _compute_page_layout(diagram)
    figure = create_figure(HEAD + layout.height + _FOOT, title, subtitle, layout.width)
    axes = add_axes(figure, 0, _FOOT, layout.width, layout.height)
    width, height = layout.box
    for group in diagram.groups:
        member_centres = [layout.centres[name] for name in group.members]
        if member_centres:
            left, low = (
                min(x for x, _ in member_centres) - width / 2 - 0.09,
                min(y for _, y in member_centres) - height / 2 - 0.09,
            )
            right, top = (
                max(x for x, _ in member_centres) + width / 2 + 0.09,
                max(y for _, y in member_centres) + height / 2 + 0.22,
            )
            draw_group_frame(axes, left, low, right - left, top - low, group.colour, group.label)
    patches = {}
    for actor in diagram.actors:
        x, y = layout.centres[actor.name]
        patches[actor.name] = draw_actor(
            axes, actor, x, y, width, height, break_label(actor.label, width - 0.1, 4), highlights
        )
    pairs = {(arrow.source, arrow.target) for arrow in diagram.arrows}
    for number, arrow in enumerate(diagram.arrows):
        shift = _TWO_WAYS if (arrow.target, arrow.source) in pairs else 0.0
        if arrow.source == arrow.target:
            continue
        start, end, bend = _route_arrow(arrow, layout, shift, 1 if number % 2 else -1)
        draw_arrow(axes, arrow, start, end, highlights, (patches[arrow.source], patches[arrow.target]), bend)
        label_lines = highlights.add_sign(arrow, break_label(arrow.label, 2.0, 3))
        x, y = _place_label(start, end, bend, label_lines if shift else ())
        draw_label(axes, x, y, label_lines, choose_arrow_colour(arrow, highlights), va="center")
    highlights.draw_explanation(figure)
    return figure


def _merge_arrows(diagram: Diagram) -> tuple[DiagramArrow, ...]:
    """Return the arrows, with coinciding ones merged and their labels joined."""
    merged_arrows: dict[tuple[str, str, str], DiagramArrow] = {}
    for arrow in diagram.arrows:
        key = (arrow.source, arrow.target, arrow.heads)
        earlier_arrow = merged_arrows.get(key)
        labels = [each.label for each in (earlier_arrow, arrow) if each is not None and each.label]
        merged_arrows[key] = replace(earlier_arrow or arrow, label=" / ".join(dict.fromkeys(labels)))
    return tuple(merged_arrows.values())


def _compute_page_layout(diagram: Diagram) -> _PageLayout:
    layout = compute_layout(diagram)
    levels = 1 + max(position.level for position in layout.values())
    rows = 1 + int(2 * max(position.row for position in layout.values()))
    longest_label = max((len(line) for arrow in diagram.arrows for line in break_label(arrow.label, 2.0, 3)), default=0)
    gap = max(_GAP, longest_label / CHARACTERS + 0.26)
    is_vertical = diagram.portrait or levels > _MAX_HORIZONTAL_LEVELS or _compute_width(levels, gap) > WIDTH
    boxes_across, boxes_down = (rows, levels) if is_vertical else (levels, rows)
    width = max(WIDTH, _compute_width(boxes_across, gap))
    lines = max(len(break_label(actor.label, _BOX - 0.1, 4)) for actor in diagram.actors)
    frame_height = 0.24 if diagram.groups else 0.0
    box = (_BOX, max(0.4, LINE_HEIGHT * lines + 0.2))
    column_spacing = (width - 2 * _MARGIN - _BOX) / max(1, boxes_across - 1)
    spacing = (_BOX + gap if is_vertical else min(_BOX + 1.4, column_spacing), box[1] + _ROW + frame_height)
    height = box[1] + spacing[1] * (boxes_down - 1) + 2 * _MARGIN + frame_height
    centres = {}
    for name, position in layout.items():
        level = position.level - (levels - 1) / 2
        x_offset, y_offset = (position.row, level) if is_vertical else (level, position.row)
        centres[name] = (width / 2 + x_offset * spacing[0], height / 2 - y_offset * spacing[1])
    return _PageLayout(box, centres, width, height)


def _compute_width(boxes: int, gap: float) -> float:
    """Return the width of boxes beside each other, in inches."""
    return boxes * _BOX + (boxes - 1) * gap + 2 * _MARGIN


def _route_arrow(arrow: DiagramArrow, layout: _PageLayout, shift: float, side: int) -> tuple[Point, Point, float]:
    """Return the line's ends and bend: shifted if there is a return arrow, and bent round boxes in its way."""
    (x, y), (to_x, to_y) = layout.centres[arrow.source], layout.centres[arrow.target]
    length = max(1e-6, ((to_x - x) ** 2 + (to_y - y) ** 2) ** 0.5)
    offset = (-(to_y - y) / length * shift, (to_x - x) / length * shift)
    start, end = (x + offset[0], y + offset[1]), (to_x + offset[0], to_y + offset[1])
    other_centres = [at for name, at in layout.centres.items() if name not in (arrow.source, arrow.target)]
    for bend in (side * each for each in _BENDS):
        if not any(_is_crossing_box(at, start, end, bend, layout.box) for at in other_centres):
            return start, end, bend
    return start, end, 0.0


def _compute_curve_point(start: Point, end: Point, bend: float, fraction: float) -> Point:
    """Return a point on the curve that Matplotlib draws as ``arc3``, at the fraction ``fraction`` of its length."""
    control = (
        (start[0] + end[0]) / 2 + bend * (end[1] - start[1]),
        (start[1] + end[1]) / 2 - bend * (end[0] - start[0]),
    )
    a, b, c = (1 - fraction) ** 2, 2 * fraction * (1 - fraction), fraction**2
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


def _place_label(start: Point, end: Point, bend: float, lines: tuple[str, ...]) -> Point:
    """Return the middle of the curve, or the centre of a label ``lines`` it, on its left."""
    x, y = _compute_curve_point(start, end, bend, 0.5)
    if not lines:
        return x, y
    length = max(1e-6, ((end[0] - start[0]) ** 2 + (end[1] - start[1]) ** 2) ** 0.5)
    normal_x, normal_y = -(end[1] - start[1]) / length, (end[0] - start[0]) / length
    half_size = max(map(len, lines)) / CHARACTERS / 2, LINE_HEIGHT * len(lines) / 2
    distance = abs(normal_x) * half_size[0] + abs(normal_y) * half_size[1] + 0.04
    return x + normal_x * distance, y + normal_y * distance


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
