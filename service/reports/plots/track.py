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
_MAX_BINS = 12
_MARGIN = 60.0


def draw_track(
    predictions: Sequence[Prediction], trials: Sequence[TrialResult], title: str, floor: Pixels | None
) -> Figure:
    """Draw the worst trial's images over its floor, and the fraction correct along the path over all tracks."""
    track_trials = find_tracks(predictions, trials)
    images_by_trial = {index: collect_track_images(predictions, trials, index) for index in track_trials}
    worst_trial = find_worst_track(predictions, trials)
    images = [item for items in images_by_trial.values() for item in items]
    correct_count = sum(item.right for item in images)
    view = _choose_viewport(images_by_trial[worst_trial])
    width = WIDTH - _LEFT_EDGE - _RIGHT_EDGE
    height = width * view.height / view.width
    trial = trials[worst_trial]
    trial_word = "trial" if len(track_trials) == 1 else "trials"
    summary = f"{correct_count} of n = {len(images)} images correct, {len(track_trials)} {trial_word}"
    location = f"floor: {trial.scenario}, trial {trial.index + 1}"
    figure = create_figure(HEAD + height + _GAP + _ALONG + _FOOT, title, f"{summary}; {location}")
    track_axes = add_axes(figure, _LEFT_EDGE, _FOOT + _ALONG + _GAP, width, height)
    draw_floor_part(track_axes, floor, view)
    track_axes.set_xlim(view.left, view.right)
    track_axes.set_ylim(view.bottom, view.top)
    _draw_images(track_axes, images_by_trial[worst_trial], 0.045 * view.width)
    track_axes.set_xlabel("x, mm", font=load_font(8), labelpad=1)
    track_axes.set_ylabel("y, mm", font=load_font(8), labelpad=4)
    _draw_accuracy_curve(add_axes(figure, _LEFT_EDGE, _FOOT, width, _ALONG), images)
    write_text(figure, 0.08, 0.23, "beside each place: ○ correct  ✗ wrong  □ no answer", size=8, colour=FAINT)
    write_text(figure, 0.08, 0.09, "band: 95 % interval; above it: n", size=8, colour=FAINT)
    return figure


def compute_accuracy_curve(images: Sequence[TrackImage]) -> Curve:
    """Return the fraction correct in at most twelve sections of equal length, at the middle of each."""
    first_distance, last_distance = min(item.distance for item in images), max(item.distance for item in images)
    length = max((last_distance - first_distance) / _MAX_BINS, 1.0)
    bins: dict[int, list[bool]] = {}
    for item in images:
        bins.setdefault(min(int((item.distance - first_distance) / length), _MAX_BINS - 1), []).append(item.right)
    bin_numbers = sorted(bins)
    counts = [(sum(bins[place]), len(bins[place])) for place in bin_numbers]
    intervals = [compute_wilson_interval(*pair) for pair in counts]
    return Curve(
        "",
        tuple(first_distance + (place + 0.5) * length for place in bin_numbers),
        tuple(right / count for right, count in counts),
        tuple(low for low, _ in intervals),
        tuple(high for _, high in intervals),
        tuple(count for _, count in counts),
    )


def _draw_images(axes: Axes, images: Sequence[TrackImage], offset: float) -> None:
    """Draw the marks ``offset`` mm to the robot's left of the sensor, so that the floor stays visible."""
    axes.plot(
        [item.x for item in images], [item.y for item in images], color=LEFT, linewidth=0.8, linestyle=":", zorder=3
    )
    marks = []
    for item in images:
        angle = math.radians(item.heading + 90)
        x, y = item.x + offset * math.cos(angle), item.y + offset * math.sin(angle)
        axes.plot([item.x, x], [item.y, y], color=FAINT, linewidth=0.5, zorder=3)
        marks.append((x, y, *_choose_mark(item)))
    for x, y, marker, _ in marks:
        _draw_mark(axes, x, y, marker, "white", 5.4, 2.2)
    for x, y, marker, colour in marks:
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
