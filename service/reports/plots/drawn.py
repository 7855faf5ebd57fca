"""The plots of a grade with their titles and descriptions, and the drawing of all of them.

The modules of each kind draw them. Nothing here is random, depends on time, or is kept between calls.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from types import MappingProxyType

from service.grading.grade import CriterionResult, Grade, Prediction
from service.language import ENGLISH, Language
from service.reports.plots.own_diagrams import OwnDiagram, own_diagrams
from service.reports.plots.plot import Plot, hidden_suffix, slug, title_of, trial_name
from service.reports.plots.sensor_images import chosen_predictions, is_right, misread
from service.reports.plots.taken import tracks
from service.reports.readable import one_line, turned
from service.reports.view import is_for_staff, scenarios, staff_view, student_view, tells_of_hidden, worst_trial
from sim.floors.canvas import Pixels
from sim.recorded import stood_still
from sim.recording import Pose, Recording
from submissions.diagram_cells import DiagramCell

_NO_IMAGES: Mapping[str, Pixels] = MappingProxyType({})


def plots_of(grade: Grade, language: Language = ENGLISH) -> tuple[Plot, ...]:
    """Return path and sensor plots of every scenario's worst trial, and classification plots.

    Criteria that share a classification share its plots. Robots that did not move have no path or sensor plots. Text
    inside plots is in English.
    """
    return (*_classifications(grade, language), *_trials(grade, language))


def draw_all(
    grade: Grade, images: Mapping[str, Pixels] = _NO_IMAGES, cells: Sequence[DiagramCell] = ()
) -> dict[str, bytes]:
    """Draw every plot of ``grade`` and of the notebook's ``cells``, for staff and student, as name -> PNG.

    ``images`` are floors that are not built in, by background name, (1143, 2362, 3) uint8 with row 0 at y = 1143 mm. A
    floor that is in neither is drawn white.
    """
    drawn: dict[str, bytes] = {}
    for view in (staff_view(grade), student_view(grade)):
        for plot in plots_of(view.grade):
            if plot.name not in drawn:
                drawn[plot.name] = _picture(view.grade, plot, images)
        for own in own_diagrams(view.grade, cells):
            for plot in own.plots:
                if plot.name not in drawn:
                    drawn[plot.name] = _own_picture(own, view.grade, plot)
    return drawn


def _picture(grade: Grade, plot: Plot, images: Mapping[str, Pixels]) -> bytes:
    # The drawing library is loaded only if there is something to draw.
    from service.reports.plots.figures import figure_of
    from service.reports.plots.style import png

    return png(figure_of(grade, plot, images))


def _own_picture(own: OwnDiagram, grade: Grade, plot: Plot) -> bytes:
    from service.reports.plots.drawn_diagrams import draw_own
    from service.reports.plots.style import png

    return png(draw_own(own, grade, plot))


def same_answers(grade: Grade) -> tuple[tuple[int, ...], ...]:
    """Return groups of recognition criteria that judge the same answers to the same images."""
    alike: dict[Hashable, list[int]] = {}
    for index, result in enumerate(grade.criteria):
        confusion = result.accuracy.confusion if result.accuracy is not None else ()
        if result.accuracy is not None or result.predictions:
            what = (confusion, result.predictions, result.curves, is_for_staff(result.visibility))
            alike.setdefault(what, []).append(index)
    return tuple(map(tuple, alike.values()))


def _classifications(grade: Grade, language: Language) -> Iterator[Plot]:
    say = language.say
    for index, *_ in same_answers(grade):
        result = grade.criteria[index]
        suffix = hidden_suffix(tells_of_hidden(grade, result))
        accuracy = result.accuracy
        if accuracy is not None and accuracy.confusion:
            right = sum(count for truth, answer, count in accuracy.confusion if truth == answer)
            yield Plot(
                f"confusion-{slug(result.id)}{suffix}", "confusion", index, "", title_of(say("answers")),
                say(
                    "True class and answer for each image, for “%(criterion)s”.",
                    criterion=one_line(result.title, 80),
                ),
                say(
                    "Confusion matrix: %(right)s of %(all)s images on the diagonal, accuracy %(value)s, "
                    "interval %(low)s to %(high)s.",
                    right=right, all=accuracy.n, value=f"{accuracy.value:.2f}", low=f"{accuracy.low:.2f}",
                    high=f"{accuracy.high:.2f}",
                ),
            )  # fmt: skip
        yield from _along(grade, index, result, suffix, language)
        if result.predictions:
            wrong = [prediction for prediction in result.predictions if not is_right(prediction)]
            yield Plot(
                f"predictions-{slug(result.id)}{suffix}",
                "predictions",
                index,
                "",
                title_of(say("sensor images")),
                say(
                    "Images from the left light sensor: the whole image and the part that a network receives. A "
                    "dashed frame marks this part. A thick frame and ✗ mark a wrong answer."
                ),
                _told_of_predictions(result, wrong, language),
            )  # fmt: skip


def _told_of_predictions(result: CriterionResult, wrong: Sequence[Prediction], language: Language) -> str:
    answered = "; ".join(
        language.say(
            "%(truth)s identified as %(answer)s",
            truth=one_line(prediction.truth, 40),
            answer=one_line(prediction.answer or language.say("nothing"), 40),
        )
        for prediction in wrong[:4]
    )
    told = language.say(
        "%(shown)s sensor images, %(wrong)s of %(all)s with a wrong answer",
        shown=len(chosen_predictions(result.predictions)),
        wrong=len(wrong),
        all=len(result.predictions),
    )
    return f"{told}: {answered}." if answered else f"{told}."


def _along(grade: Grade, index: int, result: CriterionResult, suffix: str, language: Language) -> Iterator[Plot]:
    """Yield the plots of accuracy along the swept conditions and along the path, and of misread images."""
    say = language.say
    title = one_line(result.title, 80)
    if result.curves:
        told = "; ".join(
            f"{one_line(curve.along, 20)}: "
            + ", ".join(
                say("%(accuracy)s at %(level)s", accuracy=f"{level.value:.2f}", level=f"{level.at:g}")
                for level in curve.levels[:9]
            )
            for curve in result.curves
        )
        yield Plot(
            f"curves-{slug(result.id)}{suffix}", "curves", index, "", title_of(say("robustness")),
            say("Share of images identified correctly as conditions get harder, for “%(criterion)s”.", criterion=title),
            say("Accuracy curves. %(curves)s.", curves=told),
        )  # fmt: skip
    on_track = tracks(result.predictions, grade.trials)
    if on_track:
        right = sum(is_right(prediction) for prediction in result.predictions)
        yield Plot(
            f"track-{slug(result.id)}{suffix}", "track", index, "", title_of(say("along the track")),
            say(
                "Places of the images, with correct and wrong answers. The floor shows the trial with the most "
                "mistakes. The curve shows all trials by distance driven."
            ),
            say(
                "%(right)s of %(all)s images identified correctly along the track in %(trials)s trials.",
                right=right, all=len(result.predictions), trials=len(on_track),
            ),
        )  # fmt: skip
    wrong = misread(result.predictions)
    if wrong:
        yield Plot(
            f"misread-{slug(result.id)}{suffix}", "misread", index, "", title_of(say("misread images")),
            say(
                "Each misread image beside two correct ones: the most similar image of its true class, and the most "
                "similar image of the class in the answer."
            ),
            say("%(wrong)s of %(all)s images were misread.", wrong=len(wrong), all=len(result.predictions)),
        )  # fmt: skip


def _trials(grade: Grade, language: Language) -> Iterator[Plot]:
    say = language.say
    for scenario in scenarios(grade):
        index = worst_trial(grade, scenario)
        trial = grade.trials[index]
        recording = trial.recording
        if stood_still(recording):
            continue
        name = trial_name(trial)
        title = title_of(scenario)
        yield Plot(
            f"path-{name}", "path", index, scenario, say("%(scenario)s: path", scenario=title),
            say(
                "Path of the robot. The dashed outline is the robot at the start, the solid outline at the end. "
                "Arrowheads show its heading. The circles are its light sensors: left blue, right orange."
            ),
            _told_of_path(recording, language),
        )  # fmt: skip
        light = recording.ticks.left_rgb[:, 0]
        heard = say("no readings")
        if len(light):
            heard = say("left light between %(low)s and %(high)s", low=f"{light.min():.0f}", high=f"{light.max():.0f}")
        yield Plot(
            f"sensors-{name}", "sensors", index, scenario, say("%(scenario)s: sensors", scenario=title),
            say(
                "Sensor readings over time, including those that the program did not request. Marks at the top: "
                "messages sent, answers received, speech, touches and faults."
            ),
            say(
                "Sensor readings over %(seconds)s seconds: %(readings)s, with messages and speech marked.",
                seconds=f"{recording.end_t:.1f}", readings=heard,
            ),
        )  # fmt: skip


def _told_of_path(recording: Recording, language: Language) -> str:
    start, end, partner = recording.start, recording.end, recording.partner
    told = language.say(
        "Path over the floor %(floor)s from %(start)s mm, heading %(heading)s degrees, to %(end)s mm, heading "
        "%(end_heading)s degrees. Seconds: %(seconds)s. Touches: %(touches)s.",
        floor=one_line(recording.background, 40),
        start=_at(start),
        heading=turned(start.heading),
        end=_at(end),
        end_heading=turned(end.heading),
        seconds=f"{recording.end_t:.1f}",
        touches=len(recording.touches),
    )
    if partner is None:
        return told
    other = language.say(
        "Path of the second robot from %(start)s mm to %(end)s mm.", start=_at(partner.start), end=_at(partner.end)
    )
    return f"{told} {other}"


def _at(pose: Pose) -> str:
    return f"({pose.x:.0f}, {pose.y:.0f})"
