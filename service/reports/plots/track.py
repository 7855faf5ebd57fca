"""Drawing of recognition along a track: image positions, correct answers, and the fraction correct.

Answers were judged during grading. The caller supplies the floor image.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from models.intervals import compute_wilson_interval
from service.grading.grade import Prediction, TrialResult
from service.reports.plots.curve import Curve, draw_curve
from service.reports.plots.path import Pixels, Viewport, draw_floor_part
from service.reports.plots.style import (
    FAINT,
    FAULT,
    HEAD,
    INK,
    LEFT,
    RULE,
    SAID,
    WIDTH,
    add_axes,
    create_figure,
    load_font,
    set_tick_size,
    write_text,
)
from service.reports.plots.track_images import TrackImage, collect_track_images, find_tracks, find_worst_track

_LEFT_EDGE, _RIGHT_EDGE, _FOOT = 0.62, 0.14, 0.74
_ALONG, _GAP = 1.15, 0.62  # inches: the curve, and the gap to the floor
_MOST_BINS = 12
_MARGIN = 60.0


def draw_track(
    predictions: Sequence[Prediction], trials: Sequence[TrialResult], title: str, floor: Pixels | None
) -> Figure:
    """Draw the worst trial's images over its floor, and the fraction correct along the path over all tracks."""
    own = find_tracks(predictions, trials)
    by_trial = {index: collect_track_images(predictions, trials, index) for index in own}
    worst = find_worst_track(predictions, trials)
    images = [item for items in by_trial.values() for item in items]
    right = sum(item.right for item in images)
    view = _choose_viewport(by_trial[worst])
    width = WIDTH - _LEFT_EDGE - _RIGHT_EDGE
    height = width * view.height / view.width
    trial = trials[worst]
    what = f"{right} of n = {len(images)} images correct, {len(own)} {'trial' if len(own) == 1 else 'trials'}"
    where = f"floor: {trial.scenario}, trial {trial.index + 1}"
    figure = create_figure(HEAD + height + _GAP + _ALONG + _FOOT, title, f"{what}; {where}")
    top = add_axes(figure, _LEFT_EDGE, _FOOT + _ALONG + _GAP, width, height)
    draw_floor_part(top, floor, view)
    top.set_xlim(view.left, view.right)
    top.set_ylim(view.bottom, view.top)
    _draw_images(top, by_trial[worst], 0.045 * view.width)
    top.set_xlabel("x, mm", font=load_font(8), labelpad=1)
    top.set_ylabel("y, mm", font=load_font(8), labelpad=4)
    _draw_accuracy_curve(add_axes(figure, _LEFT_EDGE, _FOOT, width, _ALONG), images)
    write_text(figure, 0.08, 0.23, "beside each place: ○ correct  ✗ wrong  □ no answer", size=8, colour=FAINT)
    write_text(figure, 0.08, 0.09, "band: 95 % interval; above it: n", size=8, colour=FAINT)
    return figure


def compute_accuracy_curve(images: Sequence[TrackImage]) -> Curve:
    """Return the fraction correct in at most twelve sections of equal length, at the middle of each."""
    first, last = min(item.distance for item in images), max(item.distance for item in images)
    length = max((last - first) / _MOST_BINS, 1.0)
    bins: dict[int, list[bool]] = {}
    for item in images:
        bins.setdefault(min(int((item.distance - first) / length), _MOST_BINS - 1), []).append(item.right)
    places = sorted(bins)
    counts = [(sum(bins[place]), len(bins[place])) for place in places]
    intervals = [compute_wilson_interval(*pair) for pair in counts]
    return Curve(
        "",
        tuple(first + (place + 0.5) * length for place in places),
        tuple(right / count for right, count in counts),
        tuple(low for low, _ in intervals),
        tuple(high for _, high in intervals),
        tuple(count for _, count in counts),
    )


def _draw_images(axes: Axes, images: Sequence[TrackImage], beside: float) -> None:
    """Draw the marks ``beside`` mm to the robot's left of the sensor, so that the floor stays visible."""
    axes.plot(
        [item.x for item in images], [item.y for item in images], color=LEFT, linewidth=0.8, linestyle=":", zorder=3
    )
    shown = []
    for item in images:
        angle = math.radians(item.heading + 90)
        x, y = item.x + beside * math.cos(angle), item.y + beside * math.sin(angle)
        axes.plot([item.x, x], [item.y, y], color=FAINT, linewidth=0.5, zorder=3)
        shown.append((x, y, *_choose_mark(item)))
    for x, y, marker, _ in shown:
        _draw_mark(axes, x, y, marker, "white", 5.4, 2.2)
    for x, y, marker, colour in shown:
        _draw_mark(axes, x, y, marker, colour, 4.4, 1.2)


def _choose_mark(item: TrackImage) -> tuple[str, str]:
    """Return marker and colour. Each alone identifies the result."""
    if item.right:
        return "o", SAID
    return ("x", FAULT) if item.answered else ("s", INK)


def _draw_mark(axes: Axes, x: float, y: float, marker: str, colour: str, size: float, width: float) -> None:
    axes.plot(
        [x], [y], marker=marker, markersize=size, markerfacecolor="none", markeredgecolor=colour,
        markeredgewidth=width, linestyle="none", zorder=5,
    )  # fmt: skip


def _draw_accuracy_curve(axes: Axes, images: Sequence[TrackImage]) -> None:
    curve = compute_accuracy_curve(images)
    axes.set_ylim(-0.04, 1.16)
    axes.set_yticks([0, 0.5, 1])
    axes.grid(axis="y", color=RULE, linewidth=0.5)
    axes.set_axisbelow(True)
    draw_curve(axes, curve)
    for x, count in zip(curve.x, curve.n, strict=True):
        axes.text(x, 1.07, str(count), font=load_font(7.5), color=FAINT, ha="center", va="bottom", clip_on=False)
    axes.set_xlabel("distance driven, mm", font=load_font(8), labelpad=1)
    axes.set_ylabel("accuracy", font=load_font(8), labelpad=3)
    set_tick_size(axes)


def _choose_viewport(images: Sequence[TrackImage]) -> Viewport:
    xs, ys = [item.x for item in images], [item.y for item in images]
    left, right, bottom, top = min(xs) - _MARGIN, max(xs) + _MARGIN, min(ys) - _MARGIN, max(ys) + _MARGIN
    width, height = right - left, top - bottom
    if height < 0.22 * width:
        middle, height = (bottom + top) / 2, 0.22 * width
        bottom, top = middle - height / 2, middle + height / 2
    if width < 0.9 * height:
        middle, width = (left + right) / 2, 0.9 * height
        left, right = middle - width / 2, middle + width / 2
    return Viewport(left, bottom, right, top)
