"""The plots of a classifier's evaluation: confusion matrix, misread images, and robustness curves.

``models/evaluation.py`` measures the values. Tables and curves are drawn by the same code as for grades.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import numpy as np

from models.cards import CardCurve, Tally
from models.evaluation import ClassifiedImage, Evaluation
from models.preprocessing import Grey
from service.reports.plots.confusion import ConfusionTable, draw_confusion_table
from service.reports.plots.curve import AccuracyPanel, Curve, draw_curves
from service.reports.plots.drawing import Drawing, Rectangle, Stroke, Vertical, create_drawing
from service.reports.plots.panel import Panel
from service.reports.plots.png import render_png
from service.reports.plots.style import FAINT, FAULT, HEAD, INK, RULE, SAID, WIDTH

MAX_MISREAD = 10
_SIDE, _GAP, _ROW = 0.74, 0.12, 0.92
_TEXT = 3 * (_SIDE + _GAP) + 0.04
_LINE = 16  # characters per line beside the images


def render_evaluation_plots(evaluation: Evaluation) -> dict[str, bytes]:
    """Return PNG files by name: ``NAME-confusion.png``, ``NAME-misread.png`` and ``NAME-robustness.png``."""
    name = evaluation.card.name
    return {
        f"{name}-confusion.png": render_png(draw_evaluation_confusion(evaluation)),
        f"{name}-misread.png": render_png(draw_evaluation_misread(evaluation)),
        f"{name}-robustness.png": render_png(draw_robustness(evaluation)),
    }


def draw_evaluation_confusion(evaluation: Evaluation) -> Drawing:
    """Draw the confusion matrix."""
    measured, classes = evaluation.measured, evaluation.card.classes
    table = ConfusionTable(classes, classes, measured.confusion, tuple(sum(row) for row in measured.confusion))
    return draw_confusion_table(table, f"{evaluation.card.name}: confusion matrix", describe_tally(measured.accuracy))


def describe_tally(tally: Tally) -> str:
    """Return a tally as ``accuracy 0.966, 95 % interval 0.955 to 0.975, n = 1320 images``."""
    low, high = tally.interval
    return f"accuracy {tally.share:.3f}, 95 % interval {low:.3f} to {high:.3f}, n = {tally.n} images"


def draw_robustness(evaluation: Evaluation) -> Drawing:
    """Draw one panel for each varied condition."""
    panels: dict[str, list[CardCurve]] = {}
    for curve in evaluation.measured.curves:
        panels.setdefault(curve.varied, []).append(curve)
    return draw_curves(
        [
            AccuracyPanel(varied, curves[0].unit, tuple(_build_curve(curve) for curve in curves))
            for varied, curves in panels.items()
        ],
        f"{evaluation.card.name}: robustness",
        "accuracy for images of the left sensor under harder conditions",
    )


def render_comparison_plot(names: Sequence[str], curve_groups: Sequence[Sequence[CardCurve]]) -> bytes:
    """Return a PNG with one panel per condition, and in it one curve for each classifier in ``names``."""
    drawing = draw_curves(
        [
            AccuracyPanel(
                f"{curves[0].varied}, {curves[0].under}",
                curves[0].unit,
                tuple(_build_curve(curve, name) for name, curve in zip(names, curves, strict=True)),
            )
            for curves in curve_groups
        ],
        f"{', '.join(names[:-1])} and {names[-1]}: robustness",
        "same places and same noise for each model",
    )
    return render_png(drawing)


def _build_curve(card_curve: CardCurve, label: str | None = None) -> Curve:
    intervals = [tally.interval for tally in card_curve.tallies]
    counts = {tally.n for tally in card_curve.tallies}
    condition = label or card_curve.under
    return Curve(
        label=f"{condition}, n = {counts.pop()}" if len(counts) == 1 else condition,
        x=card_curve.values,
        share=tuple(tally.share for tally in card_curve.tallies),
        low=tuple(low for low, _ in intervals),
        high=tuple(high for _, high in intervals),
        n=tuple(tally.n for tally in card_curve.tallies),
    )


def draw_evaluation_misread(evaluation: Evaluation) -> Drawing:
    """Draw at most ``MAX_MISREAD`` misread images, each beside its nearest correctly read neighbours.

    One neighbour is of the true class, one of the answered class. Distance is the mean square of the differences of
    greys.
    """
    misread = [each for each in evaluation.answered if not each.right]
    shown_images = _rank_mistakes(misread)[:MAX_MISREAD]
    count, total_count = len(misread), len(evaluation.answered)
    count_text = f"{len(shown_images)} of {count}" if len(shown_images) < count else f"all {count}" if count else "none"
    title = f"{evaluation.card.name}: misread images"
    if not shown_images:
        drawing = create_drawing(HEAD + 0.3, title, f"none of n = {total_count} images was misread")
        drawing.add_text(0.08, 0.1, "No misread images.", size=9)
        return drawing
    heading_height = 0.40
    height = heading_height + _ROW * len(shown_images)
    drawing = create_drawing(
        HEAD + height + 0.06, title, f"{count_text} misread, of n = {total_count} images; 14 × 14 grey pixels"
    )
    panel = Panel(drawing, Rectangle(0.08, 0.06, WIDTH - 0.16, height), (-0.05, WIDTH - 0.21), (height, 0))
    for column, heading in enumerate(("misread", "nearest correct\nof that class", "nearest correct\nof that answer")):
        _draw_text(panel, column * (_SIDE + _GAP), heading_height - 0.20, heading, FAINT, 7.4, vertical="center")
    correct_images = [each for each in evaluation.answered if each.right]
    for row, image in enumerate(shown_images):
        _draw_row(panel, evaluation.card.classes, image, correct_images, heading_height + row * _ROW)
    return drawing


def _rank_mistakes(misread: Sequence[ClassifiedImage]) -> list[ClassifiedImage]:
    """Return the images so that each kind of mistake comes once before any repeats, without duplicates."""
    seen_images: set[bytes] = set()
    kinds: dict[tuple[int, int], int] = {}
    ranked_images = []
    for number, classified_image in enumerate(misread):
        image = classified_image.grey.tobytes()
        if image in seen_images:
            continue
        seen_images.add(image)
        kind = (classified_image.place.label, classified_image.answer)
        kinds[kind] = kinds.get(kind, 0) + 1
        ranked_images.append((kinds[kind], number, classified_image))
    return [each for _, _, each in sorted(ranked_images, key=lambda entry: entry[:2])]


def _draw_row(
    panel: Panel,
    classes: tuple[str, ...],
    misread_image: ClassifiedImage,
    correct_images: Sequence[ClassifiedImage],
    y: float,
) -> None:
    true_label, answer_label = misread_image.place.label, misread_image.answer
    for column, (image, colour) in enumerate(
        (
            (misread_image, FAULT),
            (_find_nearest(misread_image, correct_images, true_label), SAID),
            (_find_nearest(misread_image, correct_images, answer_label), SAID),
        )
    ):
        if image is not None:
            _draw_grey(panel, image.grey, column * (_SIDE + _GAP), y, colour, dashed=column > 0)
    lines = [
        (f"shows {classes[true_label]}", INK, True),
        (f"✗ read as {classes[answer_label]}", FAULT, True),
        (_describe_place(misread_image), FAINT, False),
    ]
    line_count = 0
    for text, colour, bold in lines:
        wrapped_lines = textwrap.wrap(text, _LINE)
        _draw_text(panel, _TEXT, y + 0.02 + 0.14 * line_count, "\n".join(wrapped_lines), colour, 8, bold=bold)
        line_count += len(wrapped_lines)


def _describe_place(classified_image: ClassifiedImage) -> str:
    place = classified_image.place
    sheet = f", sheet {place.sheet}" if place.sheet else ""
    noise = f", noise {classified_image.noise:g}" if classified_image.noise else ""
    return f"x {place.pose.x:g}, y {place.pose.y:g} mm{sheet}{noise}"


def _find_nearest(
    target_image: ClassifiedImage, candidates: Sequence[ClassifiedImage], label: int
) -> ClassifiedImage | None:
    same_label_images = [each for each in candidates if each.place.label == label]
    if not same_label_images:
        return None
    greys = np.array([each.grey for each in same_label_images], np.float64)
    return same_label_images[int(((greys - target_image.grey) ** 2).mean(axis=(1, 2)).argmin())]


def _draw_grey(panel: Panel, grey: Grey, x: float, y: float, colour: str, *, dashed: bool) -> None:
    panel.add_picture(np.repeat(np.asarray(grey, np.uint8)[:, :, None], 3, axis=2), x, y, x + _SIDE, y + _SIDE)
    panel.add_rectangle((x, y), _SIDE, _SIDE, edge=Stroke(RULE, 0.8))
    edge = Stroke(colour, 1.0, (2.5, 1.5)) if dashed else Stroke(colour, 1.8)
    panel.add_rectangle((x - 0.03, y - 0.03), _SIDE + 0.06, _SIDE + 0.06, edge=edge)


def _draw_text(
    panel: Panel, x: float, y: float, text: str, colour: str, size: float,
    *, bold: bool = False, vertical: Vertical = "top",
) -> None:  # fmt: skip
    panel.add_text(x, y, text, colour=colour, size=size, bold=bold, vertical=vertical)
