"""The plots of a grade with their titles and descriptions, and the drawing of all of them.

The modules of each kind draw them. Nothing here is random, depends on time, or is kept between calls.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Hashable, Iterator, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, TypeVar

from service.grading.grade import CriterionResult, Grade, Prediction
from service.language import ENGLISH, Language
from service.reports.display_text import format_heading, to_one_line
from service.reports.plots.own_diagrams import OwnDiagram, list_own_diagrams
from service.reports.plots.plot import (
    VECTOR_KINDS,
    Plot,
    PlotKind,
    build_hidden_suffix,
    build_trial_name,
    format_title,
    slugify,
)
from service.reports.plots.sensor_images import find_misread, is_right, select_predictions
from service.reports.plots.track_images import find_tracks
from service.reports.view import (
    build_staff_view,
    build_student_view,
    find_worst_trial,
    has_hidden_content,
    is_for_staff,
    list_scenarios,
)
from sim.floors.canvas import Pixels
from sim.recording import Pose, Recording
from sim.recording_values import is_stationary
from submissions.diagram_cells import DiagramCell

if TYPE_CHECKING:
    from service.reports.plots.drawing import Drawing

_log = logging.getLogger(__name__)

Drawn = TypeVar("Drawn")
Rendered = TypeVar("Rendered")
_NO_IMAGES: Mapping[str, Pixels] = MappingProxyType({})


def list_plots(grade: Grade, language: Language = ENGLISH) -> tuple[Plot, ...]:
    """Return path and sensor plots of every scenario's worst trial, and classification plots.

    Criteria that share a classification share its plots. Robots that did not move have no path or sensor plots. Text
    inside plots is in English.
    """
    return (*_list_recognition_plots(grade, language), *_list_trial_plots(grade, language))


def draw_all_plots(
    grade: Grade,
    images: Mapping[str, Pixels] = _NO_IMAGES,
    cells: Sequence[DiagramCell] = (),
    *,
    omitted_kinds: Collection[PlotKind] = (),
) -> dict[str, bytes]:
    """Draw every plot of ``grade`` and of the notebook's ``cells``, for staff and student, as name -> PNG.

    ``images`` are floors that are not built in, by background name, (1143, 2362, 3) uint8 with row 0 at y = 1143 mm. A
    floor that is in neither is drawn white. A plot that cannot be drawn is an image with a sentence that says so. Plots
    of ``omitted_kinds`` are not drawn.
    """
    png_files: dict[str, bytes] = {}
    for view in (build_staff_view(grade), build_student_view(grade)):
        for plot in list_plots(view.grade):
            if plot.name not in png_files and plot.kind not in omitted_kinds:
                png_files[plot.name] = _render_plot(view.grade, plot, images)
        for own_diagram in list_own_diagrams(view.grade, cells) if cells else ():
            for plot in own_diagram.plots:
                if plot.name not in png_files:
                    png_files[plot.name] = _render_own_plot(own_diagram, view.grade, plot)
    return png_files


def draw_vector_plots(grade: Grade, images: Mapping[str, Pixels] = _NO_IMAGES) -> dict[str, str]:
    """Draw the plots of ``grade`` that reports show as SVG, as name -> document. ``images`` are the floors as above."""
    return {
        plot.name: _render_vector_plot(grade, plot, images) for plot in list_plots(grade) if plot.kind in VECTOR_KINDS
    }


def _render_plot(grade: Grade, plot: Plot, images: Mapping[str, Pixels]) -> bytes:
    # The drawing library is loaded only if there is something to draw.
    from service.reports.plots.figures import draw_plot
    from service.reports.plots.png import render_png

    return _render_or_explain(plot, partial(draw_plot, grade, plot, images), render_png)


def _render_own_plot(own_diagram: OwnDiagram, grade: Grade, plot: Plot) -> bytes:
    from service.reports.plots.diagram_drawing import draw_own_diagram
    from service.reports.plots.png import render_png

    return _render_or_explain(plot, partial(draw_own_diagram, own_diagram, grade, plot), render_png)


def _render_vector_plot(grade: Grade, plot: Plot, images: Mapping[str, Pixels]) -> str:
    from service.reports.plots.figures import draw_plot
    from service.reports.plots.svg import render_svg

    return _render_or_explain(plot, partial(draw_plot, grade, plot, images), partial(render_svg, title=plot.title))


def _render_or_explain(
    plot: Plot, draw: Callable[[], Drawn], render: Callable[[Drawn | Drawing], Rendered]
) -> Rendered:
    """Return the rendered plot from ``draw``, or an image with one sentence if it fails. The log has the cause.

    Raises:
        MemoryError: If memory is short, so that the plot can be drawn later.
    """
    from service.reports.plots.drawing import create_drawing
    from service.reports.plots.style import HEAD

    try:
        return render(draw())
    except MemoryError:
        raise
    except Exception:
        _log.exception("the plot %s cannot be drawn", plot.name)
    return render(create_drawing(HEAD, "This plot cannot be drawn because of an error in Robomark."))


def group_same_answers(grade: Grade) -> tuple[tuple[int, ...], ...]:
    """Return groups of recognition criteria that judge the same answers to the same images."""
    groups: dict[Hashable, list[int]] = {}
    for index, result in enumerate(grade.criteria):
        confusion = result.accuracy.confusion if result.accuracy is not None else ()
        if result.accuracy is not None or result.predictions:
            answer_key = (confusion, result.predictions, result.curves, is_for_staff(result.visibility))
            groups.setdefault(answer_key, []).append(index)
    return tuple(map(tuple, groups.values()))


def _list_recognition_plots(grade: Grade, language: Language) -> Iterator[Plot]:
    say = language.say
    for index, *_ in group_same_answers(grade):
        result = grade.criteria[index]
        suffix = build_hidden_suffix(has_hidden_content(grade, result))
        accuracy = result.accuracy
        if accuracy is not None and accuracy.confusion:
            correct_count = sum(count for truth, answer, count in accuracy.confusion if truth == answer)
            yield Plot(
                f"confusion-{slugify(result.id)}{suffix}", "confusion", index, "", format_title(say("answers")),
                say(
                    "True class and answer for each image, for “%(criterion)s”.",
                    criterion=to_one_line(result.title, 80),
                ),
                say(
                    "Confusion matrix: %(right)s of %(all)s images on the diagonal, accuracy %(value)s, "
                    "interval %(low)s to %(high)s.",
                    right=correct_count, all=accuracy.n, value=f"{accuracy.value:.2f}", low=f"{accuracy.low:.2f}",
                    high=f"{accuracy.high:.2f}",
                ),
            )  # fmt: skip
        yield from _list_accuracy_plots(grade, index, result, suffix, language)
        if result.predictions:
            wrong_predictions = [prediction for prediction in result.predictions if not is_right(prediction)]
            yield Plot(
                f"predictions-{slugify(result.id)}{suffix}",
                "predictions",
                index,
                "",
                format_title(say("sensor images")),
                say(
                    "Images from the left light sensor: the whole image and the part that a network receives. A "
                    "dashed frame marks this part. A thick frame and ✗ mark a wrong answer."
                ),
                _describe_predictions(result, wrong_predictions, language),
            )  # fmt: skip


def _describe_predictions(result: CriterionResult, wrong_predictions: Sequence[Prediction], language: Language) -> str:
    mistakes = "; ".join(
        language.say(
            "%(truth)s identified as %(answer)s",
            truth=to_one_line(prediction.truth, 40),
            answer=to_one_line(prediction.answer or language.say("nothing"), 40),
        )
        for prediction in wrong_predictions[:4]
    )
    summary = language.say(
        "%(shown)s sensor images, %(wrong)s of %(all)s with a wrong answer",
        shown=len(select_predictions(result.predictions)),
        wrong=len(wrong_predictions),
        all=len(result.predictions),
    )
    return f"{summary}: {mistakes}." if mistakes else f"{summary}."


def _list_accuracy_plots(
    grade: Grade, index: int, result: CriterionResult, suffix: str, language: Language
) -> Iterator[Plot]:
    """Yield the plots of accuracy along the swept conditions and along the path, and of misread images."""
    say = language.say
    title = to_one_line(result.title, 80)
    if result.curves:
        curve_text = "; ".join(
            f"{to_one_line(curve.along, 20)}: "
            + ", ".join(
                say("%(accuracy)s at %(level)s", accuracy=f"{level.value:.2f}", level=f"{level.at:g}")
                for level in curve.levels[:9]
            )
            for curve in result.curves
        )
        yield Plot(
            f"curves-{slugify(result.id)}{suffix}", "curves", index, "", format_title(say("robustness")),
            say("Share of images identified correctly as conditions get harder, for “%(criterion)s”.", criterion=title),
            say("Accuracy curves. %(curves)s.", curves=curve_text),
        )  # fmt: skip
    tracks = find_tracks(result.predictions, grade.trials)
    if tracks:
        correct_count = sum(is_right(prediction) for prediction in result.predictions)
        yield Plot(
            f"track-{slugify(result.id)}{suffix}", "track", index, "", format_title(say("along the track")),
            say(
                "Places of the images, with correct and wrong answers. The floor shows the trial with the most "
                "mistakes. The curve shows all trials by distance driven."
            ),
            say(
                "%(right)s of %(all)s images identified correctly along the track in %(trials)s trials.",
                right=correct_count, all=len(result.predictions), trials=len(tracks),
            ),
        )  # fmt: skip
    misread_images = find_misread(result.predictions)
    if misread_images:
        yield Plot(
            f"misread-{slugify(result.id)}{suffix}", "misread", index, "", format_title(say("misread images")),
            say(
                "Each misread image beside two correct ones: the most similar image of its true class, and the most "
                "similar image of the class in the answer."
            ),
            say("%(wrong)s of %(all)s images were misread.", wrong=len(misread_images), all=len(result.predictions)),
        )  # fmt: skip


def _list_trial_plots(grade: Grade, language: Language) -> Iterator[Plot]:
    say = language.say
    for scenario in list_scenarios(grade):
        index = find_worst_trial(grade, scenario)
        trial = grade.trials[index]
        recording = trial.recording
        if is_stationary(recording):
            continue
        name = build_trial_name(trial)
        title = format_title(scenario)
        yield Plot(
            f"path-{name}", "path", index, scenario, say("%(scenario)s: path", scenario=title),
            say(
                "Path of the robot. The dashed outline is the robot at the start, the solid outline at the end. "
                "Arrowheads show its heading. The circles are its light sensors: left blue, right orange."
            ),
            _describe_path(recording, language),
        )  # fmt: skip
        light = recording.ticks.left_rgb[:, 0]
        readings = say("no readings")
        if len(light):
            readings = say(
                "left light between %(low)s and %(high)s", low=f"{light.min():.0f}", high=f"{light.max():.0f}"
            )
        yield Plot(
            f"sensors-{name}", "sensors", index, scenario, say("%(scenario)s: sensors", scenario=title),
            say(
                "Sensor readings over time, including those that the program did not request. Marks at the top: "
                "messages sent, answers received, speech, touches and faults."
            ),
            say(
                "Sensor readings over %(seconds)s seconds: %(readings)s, with messages and speech marked.",
                seconds=f"{recording.end_t:.1f}", readings=readings,
            ),
        )  # fmt: skip


def _describe_path(recording: Recording, language: Language) -> str:
    start, end, partner = recording.start, recording.end, recording.partner
    description = language.say(
        "Path over the floor %(floor)s from %(start)s mm, heading %(heading)s degrees, to %(end)s mm, heading "
        "%(end_heading)s degrees. Seconds: %(seconds)s. Touches: %(touches)s.",
        floor=to_one_line(recording.background, 40),
        start=_format_position(start),
        heading=format_heading(start.heading),
        end=_format_position(end),
        end_heading=format_heading(end.heading),
        seconds=f"{recording.end_t:.1f}",
        touches=len(recording.touches),
    )
    if partner is None:
        return description
    partner_description = language.say(
        "Path of the second robot from %(start)s mm to %(end)s mm.",
        start=_format_position(partner.start),
        end=_format_position(partner.end),
    )
    return f"{description} {partner_description}"


def _format_position(pose: Pose) -> str:
    return f"({pose.x:.0f}, {pose.y:.0f})"
