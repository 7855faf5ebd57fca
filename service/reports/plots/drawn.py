"""Which plots a grade has, what each is called and says, and all of them drawn.

The drawing is in one module a plot; nothing here is random, timed or kept between calls.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from types import MappingProxyType

from matplotlib.figure import Figure

from service.grading.grade import AccuracyCurve, CriterionResult, Grade
from service.reports.plots.confusion import draw_confusion
from service.reports.plots.curve import AccuracyPanel, Curve, draw_curves
from service.reports.plots.misread import draw_misread, misread
from service.reports.plots.own_diagrams import draw_own, own_diagrams
from service.reports.plots.path import Pixels, draw_path
from service.reports.plots.plot import Plot, hidden_suffix, slug, title_of, trial_name
from service.reports.plots.predictions import chosen_predictions, draw_predictions, is_right
from service.reports.plots.sensor import draw_sensors
from service.reports.plots.style import png
from service.reports.plots.track import draw_track, tracks, worst_track
from service.reports.readable import one_line
from service.reports.view import is_for_staff, scenarios, staff_view, student_view, tells_of_hidden, worst_trial
from sim.recorded import floor_of, stood_still
from sim.recording import Recording
from submissions.diagram_cells import DiagramCell
from submissions.sweep import CONDITIONS, Varied

_NO_IMAGES: Mapping[str, Pixels] = MappingProxyType({})


def plots_of(grade: Grade) -> tuple[Plot, ...]:
    """Path and sensors of every scenario's worst trial, and classifications, once for criteria that share them.

    Of a robot that stood still there is neither path nor sensors.
    """
    return (*_classifications(grade), *_trials(grade))


def draw_all(
    grade: Grade, images: Mapping[str, Pixels] = _NO_IMAGES, cells: Sequence[DiagramCell] = ()
) -> dict[str, bytes]:
    """Every plot of ``grade``, and the diagrams of the notebook's ``cells``, for staff and student, name -> PNG.

    ``images`` are floors that are not built in, by background name, (1143, 2362, 3) uint8 with row 0 at
    y = 1143 mm; a floor that is in neither is drawn white.
    """
    drawn: dict[str, bytes] = {}
    for view in (staff_view(grade), student_view(grade)):
        for plot in plots_of(view.grade):
            if plot.name not in drawn:
                drawn[plot.name] = png(_draw(view.grade, plot, images))
        for own in own_diagrams(view.grade, cells):
            for plot in own.plots:
                if plot.name not in drawn:
                    drawn[plot.name] = png(draw_own(own, view.grade, plot))
    return drawn


def _draw(grade: Grade, plot: Plot, images: Mapping[str, Pixels]) -> Figure:
    if plot.kind == "path":
        trial = grade.trials[plot.subject]
        return draw_path(trial, plot.title, _floor(trial.recording, images))
    if plot.kind == "sensors":
        return draw_sensors(grade.trials[plot.subject], plot.title)
    result = grade.criteria[plot.subject]
    if plot.kind == "confusion" and result.accuracy is not None:
        return draw_confusion(result, result.accuracy, plot.title)
    if plot.kind == "curves":
        return draw_curves([_panel(curve) for curve in result.curves], plot.title, one_line(result.title, 60))
    if plot.kind == "track":
        worst = worst_track(result.predictions, grade.trials)
        floor = _floor(grade.trials[worst].recording, images)
        return draw_track(result.predictions, grade.trials, plot.title, floor)
    if plot.kind == "misread":
        return draw_misread(misread(result.predictions), len(result.predictions), plot.title)
    return draw_predictions(result.predictions, plot.title)


def _panel(curve: AccuracyCurve) -> AccuracyPanel:
    about = CONDITIONS[curve.along] if curve.along in CONDITIONS else Varied(curve.along, "", 0, 0)
    levels = curve.levels
    drawn = Curve(
        "",
        tuple(level.at for level in levels),
        tuple(level.value for level in levels),
        tuple(level.low for level in levels),
        tuple(level.high for level in levels),
        tuple(level.n for level in levels),
    )
    return AccuracyPanel(about.words, about.unit, (drawn,), curve.asked)


def _floor(recording: Recording, images: Mapping[str, Pixels]) -> Pixels | None:
    """The floor as it was in the trial, with the same digits and label patches."""
    if recording.background in images:
        return images[recording.background]
    floor = floor_of(recording)
    return floor.pixels if floor else None


def same_answers(grade: Grade) -> tuple[tuple[int, ...], ...]:
    """The criteria that tell of recognition, those together that judge the same answers to the same images."""
    alike: dict[Hashable, list[int]] = {}
    for index, result in enumerate(grade.criteria):
        confusion = result.accuracy.confusion if result.accuracy is not None else ()
        if result.accuracy is not None or result.predictions:
            what = (confusion, result.predictions, result.curves, is_for_staff(result.visibility))
            alike.setdefault(what, []).append(index)
    return tuple(map(tuple, alike.values()))


def _classifications(grade: Grade) -> Iterator[Plot]:
    for index, *_ in same_answers(grade):
        result = grade.criteria[index]
        suffix = hidden_suffix(tells_of_hidden(grade, result))
        accuracy = result.accuracy
        if accuracy is not None and accuracy.confusion:
            right = sum(count for truth, answer, count in accuracy.confusion if truth == answer)
            yield Plot(
                f"confusion-{slug(result.id)}{suffix}", "confusion", index, "", title_of(grade, "what was answered"),
                f"What each image showed and what was answered, for “{one_line(result.title, 80)}”.",
                f"Confusion matrix: {right} of {accuracy.n} images on the diagonal, accuracy {accuracy.value:.2f}, "
                f"interval {accuracy.low:.2f} to {accuracy.high:.2f}.",
            )  # fmt: skip
        yield from _along(grade, index, result, suffix)
        if result.predictions:
            shown = len(chosen_predictions(result.predictions))
            wrong = [prediction for prediction in result.predictions if not is_right(prediction)]
            told = "; ".join(
                f"{one_line(prediction.truth, 40)} answered as {one_line(prediction.answer or 'nothing', 40)}"
                for prediction in wrong[:4]
            )
            yield Plot(
                f"predictions-{slug(result.id)}{suffix}",
                "predictions",
                index,
                "",
                title_of(grade, "what the sensor saw"),
                "What the left light sensor sent, whole and in the focus that a network is shown. "
                "A dashed frame marks the focus; a thick frame and ✗ mark a wrong answer.",
                f"{shown} sensor images, {len(wrong)} of {len(result.predictions)} answered wrongly"
                + (f": {told}." if told else "."),
            )  # fmt: skip


def _along(grade: Grade, index: int, result: CriterionResult, suffix: str) -> Iterator[Plot]:
    """How accuracy changes along what is swept and along the way, and what was misread."""
    title = one_line(result.title, 80)
    if result.curves:
        told = "; ".join(
            f"{one_line(curve.along, 20)}: "
            + ", ".join(f"{level.value:.2f} at {level.at:g}" for level in curve.levels[:9])
            for curve in result.curves
        )
        yield Plot(
            f"curves-{slug(result.id)}{suffix}", "curves", index, "", title_of(grade, "robustness"),
            f"How often images were named rightly as conditions got harder, for “{title}”.",
            f"Curves of accuracy. {told}.",
        )  # fmt: skip
    on_track = tracks(result.predictions, grade.trials)
    if on_track:
        right = sum(is_right(prediction) for prediction in result.predictions)
        yield Plot(
            f"track-{slug(result.id)}{suffix}", "track", index, "", title_of(grade, "along the track"),
            "Where images were taken and whether they were named rightly: in the trial with most mistakes over the "
            "floor, and in all trials by the way driven.",
            f"{right} of {len(result.predictions)} images right along the track in {len(on_track)} trials.",
        )  # fmt: skip
    wrong = misread(result.predictions)
    if wrong:
        yield Plot(
            f"misread-{slug(result.id)}{suffix}", "misread", index, "", title_of(grade, "what was misread"),
            "Images that were misread, each beside the nearest one of the same truth that was read rightly, and the "
            "nearest right one of what it was taken for.",
            f"{len(wrong)} of {len(result.predictions)} images were misread.",
        )  # fmt: skip


def _trials(grade: Grade) -> Iterator[Plot]:
    for scenario in scenarios(grade):
        index = worst_trial(grade, scenario)
        trial = grade.trials[index]
        recording = trial.recording
        if stood_still(recording):
            continue
        name = trial_name(trial)
        title = title_of(grade, scenario)
        start, end = recording.start, recording.end
        yield Plot(
            f"path-{name}", "path", index, scenario, f"{title}: path",
            "Where the robot went. The dashed outline is the robot at the start, the solid one at the end; "
            "darts point where it was heading. The circles are its light sensors, left blue, right orange.",
            f"Path over the floor {one_line(recording.background, 40)} from ({start.x:.0f}, {start.y:.0f}) mm, heading "
            f"{start.heading:.0f} degrees, to ({end.x:.0f}, {end.y:.0f}) mm, heading {end.heading:.0f} degrees, "
            f"in {recording.end_t:.1f} seconds; {len(recording.touches)} touches." + _partners_way(recording.partner),
        )  # fmt: skip
        light = recording.ticks.left_rgb[:, 0]
        heard = f"left light between {light.min():.0f} and {light.max():.0f}" if len(light) else "no readings"
        yield Plot(
            f"sensors-{name}", "sensors", index, scenario, f"{title}: sensors",
            "What the sensors read at every moment, whether or not the program asked. Marks at the top: "
            "messages sent, answers received, speech, touches and faults.",
            f"Sensor readings over {recording.end_t:.1f} seconds: {heard}, with messages and speech marked.",
        )  # fmt: skip


def _partners_way(partner: Recording | None) -> str:
    if partner is None:
        return ""
    return (
        f" The second robot's from ({partner.start.x:.0f}, {partner.start.y:.0f}) mm to "
        f"({partner.end.x:.0f}, {partner.end.y:.0f}) mm."
    )
