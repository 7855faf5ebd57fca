"""Drawing of recognition along a track: image positions, correct answers, and the fraction correct.

Answers were judged during grading. The caller supplies the floor image.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.markers import MarkerStyle

from models.intervals import compute_wilson_interval
from service.grading.grade import Prediction, TrialResult
from service.reports.plots.curve import Curve, choose_limits, draw_curve
from service.reports.plots.drawing import Drawing, Rectangle, Stroke, create_drawing
from service.reports.plots.floor_image import Viewport, draw_floor_part
from service.reports.plots.panel import Panel
from service.reports.plots.style import FAINT, FAULT, HEAD, INK, LEFT, SAID, WIDTH
from service.reports.plots.track_images import TrackImage, collect_track_images, find_tracks, find_worst_track
from sim.floors.canvas import Pixels

_LEFT_EDGE, _RIGHT_EDGE, _FOOT = 0.62, 0.14, 0.74
_ALONG, _GAP = 1.15, 0.62  # inches: the curve, and the gap to the floor
_MAX_BINS = 12
_MARGIN = 60.0
_CIRCLE, _CROSS, _SQUARE = MarkerStyle("o"), MarkerStyle("x"), MarkerStyle("s")


def draw_track(
    predictions: Sequence[Prediction], trials: Sequence[TrialResult], title: str, floor: Pixels | None
) -> Drawing:
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
    drawing = create_drawing(HEAD + height + _GAP + _ALONG + _FOOT, title, f"{summary}; {location}")
    place = Rectangle(_LEFT_EDGE, _FOOT + _ALONG + _GAP, width, height)
    panel = Panel(drawing, place, (view.left, view.right), (view.bottom, view.top))
    draw_floor_part(panel, floor, view)
    _draw_images(panel, images_by_trial[worst_trial], 0.045 * view.width)
    panel.add_frame()
    panel.add_x_axis(label="x, mm")
    panel.add_y_axis(label="y, mm")
    _draw_accuracy_curve(drawing, Rectangle(_LEFT_EDGE, _FOOT, width, _ALONG), images)
    drawing.add_text(0.08, 0.23, "beside each place: ○ correct  ✗ wrong  □ no answer", size=8, colour=FAINT)
    drawing.add_text(0.08, 0.09, "band: 95 % interval; above it: n", size=8, colour=FAINT)
    return drawing


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


def _draw_images(panel: Panel, images: Sequence[TrackImage], offset: float) -> None:
    """Draw the marks ``offset`` mm to the robot's left of the sensor, so that the floor stays visible."""
    panel.add_line([(item.x, item.y) for item in images], Stroke(LEFT, 0.8, (0.8, 1.3)))
    places = []
    for item in images:
        angle = math.radians(item.heading + 90)
        place = (item.x + offset * math.cos(angle), item.y + offset * math.sin(angle))
        panel.add_line([(item.x, item.y), place], Stroke(FAINT, 0.5))
        places.append(place)
    for place, item in zip(places, images, strict=True):
        panel.add_marks([place], _choose_mark(item)[0], 5.4, edge=Stroke("white", 2.2))
    for place, item in zip(places, images, strict=True):
        marker, colour = _choose_mark(item)
        panel.add_marks([place], marker, 4.4, edge=Stroke(colour, 1.2))


def _choose_mark(item: TrackImage) -> tuple[MarkerStyle, str]:
    """Return marker and colour. Each alone identifies the result."""
    if item.right:
        return _CIRCLE, SAID
    return (_CROSS, FAULT) if item.answered else (_SQUARE, INK)


def _draw_accuracy_curve(drawing: Drawing, place: Rectangle, images: Sequence[TrackImage]) -> None:
    curve = compute_accuracy_curve(images)
    panel = Panel(drawing, place, choose_limits(curve.x), (-0.04, 1.16))
    y_ticks = (0, 0.5, 1)
    panel.add_grid((), y_ticks, opacity=1)
    draw_curve(panel, curve)
    for x, count in zip(curve.x, curve.n, strict=True):
        panel.add_text(x, 1.07, str(count), size=7.5, colour=FAINT, horizontal="center", vertical="bottom")
    panel.add_frame()
    panel.add_x_axis(label="distance driven, mm")
    panel.add_y_axis(y_ticks, label="accuracy")


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
