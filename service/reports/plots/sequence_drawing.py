"""Drawing of sequence diagrams: one lane per actor, time going down.

The caller decides the content and its order.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
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
    load_font,
)
from service.reports.plots.style import (
    FAINT,
    FAULT,
    HEAD,
    RULE,
    WIDTH,
    replace_missing_glyphs,
)
from submissions.diagram import Diagram, DiagramArrow, Divider

_EDGE = 0.62  # from the edge of the page to the first and last lane, inches
_NARROWEST = 0.79  # between two lanes
_ARROW = 0.19  # height of an arrow below its label
_SELF = 0.30  # width of an arrow to its own lane
_DIVIDER = 0.34
_FOOT = 0.28


@dataclass(frozen=True, slots=True)
class _StepRow:
    """A step with its label and note broken into lines, and its height in inches."""

    step: DiagramArrow | Divider
    lines: tuple[str, ...]
    note: tuple[str, ...] = ()
    height: float = _DIVIDER


def draw_sequence(diagram: Diagram, title: str, subtitle: str, highlights: Highlights) -> Figure:
    """Draw the sequence diagram, as wide as its lanes need."""
    count = len(diagram.actors)
    width = max(WIDTH, 2 * _EDGE + (count - 1) * _NARROWEST)
    gap = (width - 2 * _EDGE) / max(1, count - 1)
    lanes = {actor.name: _EDGE + number * gap for number, actor in enumerate(diagram.actors)}
    if count == 1:
        lanes = {diagram.actors[0].name: width / 2}
    half_width = min(gap / 2 - 0.06, _EDGE - 0.08)
    heading_lines = {actor.name: break_label(actor.label, 2 * half_width, 3) for actor in diagram.actors}
    rows = [_build_row(step, lanes, width) for step in diagram.steps]
    heading_height = LINE_HEIGHT * max(map(len, heading_lines.values())) + 0.16
    top = heading_height + (0.24 if diagram.groups else 0.12)
    body_height = top + sum(row.height for row in rows) + 0.16
    figure = create_figure(HEAD - 0.04 + body_height + _FOOT, title, subtitle, width)
    axes = add_axes(figure, 0, _FOOT, width, body_height)
    for group in diagram.groups:
        member_positions = [lanes[name] for name in group.members]
        if member_positions:
            left = min(member_positions) - half_width - 0.05
            draw_group_frame(
                axes,
                left,
                0.02,
                max(member_positions) + half_width + 0.05 - left,
                body_height - 0.03,
                group.colour,
                group.label,
            )
    level = body_height - (0.2 if diagram.groups else 0.06) - heading_height / 2
    for actor in diagram.actors:
        x = lanes[actor.name]
        axes.plot([x, x], [0.02, level], color=RULE, linewidth=1.0, zorder=1)
        draw_actor(axes, actor, x, level, 2 * half_width, heading_height, heading_lines[actor.name], highlights)
    y = level - heading_height / 2 - 0.06
    for row in rows:
        _draw_row(axes, row, lanes, y, highlights, width)
        y -= row.height
    highlights.draw_explanation(figure)
    return figure


def _build_row(step: DiagramArrow | Divider, lanes: Mapping[str, float], width: float) -> _StepRow:
    if isinstance(step, Divider):
        return _StepRow(step, break_label(step.text, width - 0.6, 1))
    span = abs(lanes[step.source] - lanes[step.target])
    lines = break_label(step.label, max(1.3, span) - 0.06, 4)
    note = break_label(step.note, 1.5, 3)
    height = LINE_HEIGHT * max(1, len(lines)) + _ARROW + (LINE_HEIGHT * len(note) + 0.12 if note else 0)
    return _StepRow(step, lines, note, height + (0.1 if span == 0 else 0))


def _draw_row(
    axes: Axes, row: _StepRow, lanes: Mapping[str, float], y: float, highlights: Highlights, width: float
) -> None:
    step = row.step
    if isinstance(step, Divider):
        _draw_divider(axes, row.lines, y - _DIVIDER / 2, step.delay, width)
        return
    source, target = lanes[step.source], lanes[step.target]
    baseline = y - LINE_HEIGHT * max(1, len(row.lines)) - 0.08
    colour = choose_arrow_colour(step, highlights)
    label_lines = highlights.add_sign(step, row.lines)
    if source == target:
        side = -_SELF if source > width - 1.2 else _SELF
        axes.plot([source, source + side, source + side], [baseline + 0.06, baseline + 0.06, baseline - 0.06],
                  color=colour, linewidth=1.2, zorder=2)  # fmt: skip
        draw_arrow(axes, step, (source + side, baseline - 0.06), (source, baseline - 0.06), highlights)
        draw_label(axes, _clamp_to_page(source + side / 2, label_lines, width), baseline + 0.08, label_lines, colour)
    else:
        draw_label(
            axes, _clamp_to_page((source + target) / 2, label_lines, width), baseline + 0.05, label_lines, colour
        )
        stop = source + 0.66 * (target - source) if step.failed else target
        draw_arrow(axes, step, (source, baseline), (stop, baseline), highlights)
        if step.failed:
            axes.plot([stop], [baseline], "x", color=FAULT, markersize=6.5, markeredgewidth=1.9, zorder=4)
    if row.note:
        _draw_note(axes, row, min(source, target) if step.note_side == "left" else max(source, target), baseline, width)


def _draw_divider(axes: Axes, lines: tuple[str, ...], y: float, delay: bool, width: float) -> None:
    for offset in (0.0,) if delay else (-0.02, 0.02):
        axes.plot([0.08, width - 0.08], [y + offset, y + offset], color=FAINT, linewidth=0.8,
                  linestyle=(0, (1, 3)) if delay else "solid", zorder=1)  # fmt: skip
    draw_label(axes, width / 2, y, lines, FAINT, va="center")


def _draw_note(axes: Axes, row: _StepRow, x: float, baseline: float, width: float) -> None:
    axes.text(
        _clamp_to_page(x, row.note, width), baseline - 0.08, replace_missing_glyphs("\n".join(row.note)),
        font=load_font(7.6), color=FAINT,
        ha="center", va="top", parse_math=False, linespacing=1.05, zorder=4,
        bbox={"boxstyle": "square,pad=0.2", "facecolor": "#fff7d6", "edgecolor": RULE, "linewidth": 0.6},
    )  # fmt: skip


def _clamp_to_page(x: float, lines: Sequence[str], width: float) -> float:
    """Return the centre of a label, moved so that it stays on the page."""
    half_width = max((len(line) for line in lines), default=0) / CHARACTERS / 2 + 0.06
    return min(max(x, half_width), width - half_width)
