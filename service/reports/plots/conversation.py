"""Draws a conversation as a sequence diagram: one lane a party, time going down.

What is shown and what is left out is decided in ``sequence.py``.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from service.grading.grade import TrialResult
from service.reports.plots.sequence import Gap, SequenceDiagram, Step, conversation
from service.reports.plots.style import (
    FAINT,
    FAULT,
    HEAD,
    INK,
    LEFT,
    RIGHT,
    RULE,
    SECOND_ROBOT,
    WIDTH,
    axes_at,
    drawable,
    font,
    new_figure,
)  # fmt: skip
from service.reports.robots import SECOND

_TIMES = 0.44  # inches for the times at the left
_FIRST = 0.28  # from there to the robot's lane
_EDGE = 0.42  # from the last lane to the right edge
_LANE_HEADS = 0.44
_CHARACTERS = 14.9  # of 8 point type that fit into an inch
_BOLD_CHARACTERS = 12.6  # of the bold words for what befell a message
_LINE = 0.131  # inches a line of a label takes
_ARROW = 0.15  # inches below a label that its arrow takes
_NARROWEST = 1.5  # inches that a label may take, even if its arrow is shorter
_ROBOTS: Mapping[str, str] = MappingProxyType({"robot": LEFT, SECOND: SECOND_ROBOT})


@dataclass(frozen=True, slots=True)
class _MessageRow:
    """A step with its label broken into lines and its height, inches."""

    step: Step | Gap
    lines: tuple[str, ...]
    height: float


def draw_conversation(trial: TrialResult, title: str) -> Figure:
    """The sequence diagram of ``trial``; says how many exchanges it leaves out."""
    told = conversation(trial.recording)
    lanes = _lanes(told)
    rows = [_row(step, lanes) for step in told.steps]
    body = _LANE_HEADS + sum(row.height for row in rows) + 0.12
    figure = new_figure(HEAD - 0.04 + body + 0.22, title, _subtitle(trial, told))
    axes = axes_at(figure, 0, 0.22, WIDTH, body)
    axes.set_axis_off()
    axes.set_xlim(0, WIDTH)
    axes.set_ylim(body, 0)
    _draw_lanes(axes, lanes, body)
    y = _LANE_HEADS
    for row in rows:
        _draw_row(axes, row, lanes, y)
        y += row.height
    axes.text(
        0.08, body + 0.12, "solid: a message or a call;  dashed: what a call returned;  ✗: never arrived",
        font=font(7.4), color=FAINT, va="center",
    )  # fmt: skip
    return figure


def _subtitle(trial: TrialResult, told: SequenceDiagram) -> str:
    if not told.total:
        return f"trial {trial.index + 1}; nothing was sent"
    of = "" if told.shown == told.total else f"{told.shown} of "
    count = f"{of}{told.total} {'exchange' if told.total == 1 else 'exchanges'}"
    return f"trial {trial.index + 1}; {count}; times are seconds after the start"


def _lanes(told: SequenceDiagram) -> Mapping[str, float]:
    """Where each party's lane is, inches from the left; robots and responder stand further apart."""
    weights = [0.0, 2.1, *(2.1 if party == SECOND else 1.0 for party in told.parties[2:])]
    room = WIDTH - _TIMES - _FIRST - _EDGE
    scale = min(1.0, room / sum(weights)) if len(told.parties) > 2 else 1.0
    if len(told.parties) == 2:
        weights = [0.0, 3.2]
    lanes: dict[str, float] = {}
    x = _TIMES + _FIRST
    for party, weight in zip(told.parties, weights, strict=True):
        x += weight * scale
        lanes[party] = x
    return lanes


def _row(step: Step | Gap, lanes: Mapping[str, float]) -> _MessageRow:
    if isinstance(step, Gap):
        plural = f"{step.what} is" if step.count == 1 else f"{step.what}s are"
        return _MessageRow(step, (f"{step.count} more {plural} not shown",), 0.34)
    width = max(_NARROWEST, abs(lanes[step.source] - lanes[step.target]) - 0.06)
    label = f"{step.note}: {step.label}" if step.note and step.kind != "lost" else step.label
    lines = tuple(textwrap.wrap(label, int(width * _CHARACTERS), max_lines=2, placeholder="…"))
    return _MessageRow(step, lines, _LINE * max(1, len(lines)) + _ARROW + _below(step))


def _below(step: Step) -> float:
    """Room between label and arrow for the word that says what befell a message, inches."""
    return 0.06 if step.kind == "lost" else 0.0


def _draw_lanes(axes: Axes, lanes: Mapping[str, float], body: float) -> None:
    for party, x in lanes.items():
        axes.plot([x, x], [_LANE_HEADS - 0.14, body], color=RULE, linewidth=1.0, zorder=0)
        axes.text(
            x, 0.14, party, font=font(7.8, bold=True), color="white" if party in _ROBOTS else INK,
            ha="center", va="center", zorder=3,
            bbox={"boxstyle": "round,pad=0.35", "facecolor": _ROBOTS.get(party, "#eef1f4"),
                  "edgecolor": _ROBOTS.get(party, RULE), "linewidth": 0.8},
        )  # fmt: skip


def _draw_row(axes: Axes, row: _MessageRow, lanes: Mapping[str, float], y: float) -> None:
    step = row.step
    if isinstance(step, Gap):
        axes.plot([0.08, WIDTH - 0.08], [y + 0.17, y + 0.17], color=FAINT, linewidth=0.8, linestyle=(0, (1, 3)))
        _label(axes, WIDTH / 2, y + 0.17, row.lines, FAINT, va="center")
        return
    source, target = lanes[step.source], lanes[step.target]
    baseline = y + _LINE * len(row.lines) + 0.045 + _below(step)
    if step.t is not None:
        axes.text(_TIMES - 0.06, baseline, f"{step.t:.2f}", font=font(7.6), color=FAINT, ha="right", va="center")
    if step.kind == "silence":
        _label(axes, (source + target) / 2, baseline, row.lines, FAULT, va="center")
        return
    middle = (source + target) / 2
    wrong = step.kind == "lost" or bool(step.note)
    if source == target:
        axes.plot([source, source + 0.14], [baseline, baseline], color=INK, linewidth=1.0)
        _label(axes, source + 0.45, baseline - 0.02, row.lines, INK)
        return
    longest = max((len(line) for line in row.lines), default=0) / _CHARACTERS
    middle = min(middle, WIDTH - 0.06 - longest / 2)
    _label(axes, middle, baseline - 0.025 - _below(step), row.lines, FAULT if wrong else INK)
    _arrow(axes, step, source, target, baseline)


def _arrow(axes: Axes, step: Step, source: float, target: float, y: float) -> None:
    crossing = step.kind in ("message", "lost")
    colour = FAULT if step.kind == "lost" else (_ROBOTS.get(step.source, INK) if crossing else INK)
    if crossing and step.source == "responder" and step.kind == "message":
        colour = RIGHT
    if step.kind == "lost":
        room = 1 - (0.16 + len(step.note) / _BOLD_CHARACTERS) / abs(target - source)
        stop = source + min(0.62, room) * (target - source)
        axes.plot([source, stop], [y, y], color=colour, linewidth=1.3, linestyle=(0, (1.2, 1.6)))
        axes.plot([stop], [y], "x", color=colour, markersize=6.5, markeredgewidth=1.9)
        axes.text(
            stop + (0.09 if target > source else -0.09), y, drawable(step.note), color=colour,
            font=font(7.8, bold=True),
            ha="left" if target > source else "right", va="center", parse_math=False,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8},
        )  # fmt: skip
        return
    back = -0.05 if target > source else 0.05
    axes.plot(
        [source, target + back], [y, y], color=colour, linewidth=1.5 if crossing else 0.9, solid_capstyle="butt",
        linestyle=(0, (3.2, 1.8)) if step.kind == "return" else "solid",
    )  # fmt: skip
    axes.add_patch(
        Polygon([(target, y), (target + 1.8 * back, y - 0.038), (target + 1.8 * back, y + 0.038)], color=colour,
                linewidth=0, zorder=2.5)
    )  # fmt: skip


def _label(axes: Axes, x: float, y: float, lines: tuple[str, ...], colour: str, va: str = "bottom") -> None:
    axes.text(
        x, y, drawable("\n".join(lines)), font=font(8), color=colour, ha="center", va=va, parse_math=False,
        linespacing=1.05, zorder=2, bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.4},
    )  # fmt: skip
