"""The drawing of one plot of a grade, by the module for its kind.

It loads the drawing library; ``grade_plots.py``, which lists the plots of a grade, does not.
"""

from __future__ import annotations

from collections.abc import Mapping

from service.grading.grade import AccuracyCurve, Grade
from service.reports.display_text import to_one_line
from service.reports.plots.confusion import draw_confusion
from service.reports.plots.curve import AccuracyPanel, Curve, draw_curves
from service.reports.plots.drawing import Drawing
from service.reports.plots.misread_images import draw_misread
from service.reports.plots.path import draw_path
from service.reports.plots.plot import Plot
from service.reports.plots.predictions import draw_predictions
from service.reports.plots.sensor import draw_sensors
from service.reports.plots.sensor_images import find_misread
from service.reports.plots.track import draw_track
from service.reports.plots.track_images import find_worst_track
from sim.floors.canvas import Pixels
from sim.recording import Recording
from sim.recording_values import rebuild_floor
from submissions.assignment.scenario import CONDITIONS, VariedCondition


def draw_plot(grade: Grade, plot: Plot, images: Mapping[str, Pixels]) -> Drawing:
    """Draw the plot."""
    if plot.kind == "path":
        trial = grade.trials[plot.subject]
        return draw_path(trial, plot.title, _find_floor(trial.recording, images))
    if plot.kind == "sensors":
        return draw_sensors(grade.trials[plot.subject], plot.title)
    result = grade.criteria[plot.subject]
    if plot.kind == "confusion" and result.accuracy is not None:
        return draw_confusion(result, result.accuracy, plot.title)
    if plot.kind == "curves":
        return draw_curves([_build_panel(curve) for curve in result.curves], plot.title, to_one_line(result.title, 60))
    if plot.kind == "track":
        worst_trial = find_worst_track(result.predictions, grade.trials)
        floor = _find_floor(grade.trials[worst_trial].recording, images)
        return draw_track(result.predictions, grade.trials, plot.title, floor)
    if plot.kind == "misread":
        return draw_misread(find_misread(result.predictions), len(result.predictions), plot.title)
    return draw_predictions(result.predictions, plot.title)


def _build_panel(curve: AccuracyCurve) -> AccuracyPanel:
    condition = CONDITIONS[curve.along] if curve.along in CONDITIONS else VariedCondition(curve.along, "", 0, 0)
    levels = curve.levels
    accuracy_curve = Curve(
        "",
        tuple(level.at for level in levels),
        tuple(level.value for level in levels),
        tuple(level.low for level in levels),
        tuple(level.high for level in levels),
        tuple(level.n for level in levels),
    )
    return AccuracyPanel(condition.words, condition.unit, (accuracy_curve,), curve.asked)


def _find_floor(recording: Recording, images: Mapping[str, Pixels]) -> Pixels | None:
    """Return the floor of the trial, with the same digits and label patches."""
    if recording.background in images:
        return images[recording.background]
    floor = rebuild_floor(recording)
    return floor.pixels if floor else None
