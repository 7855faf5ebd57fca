"""Drawing of confusion matrices: truths down, answers across, counts in the cells, totals at the right.

All numbers come from the criterion's ``Accuracy``.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from typing import Literal

from matplotlib.colors import to_hex

from service.grading.grade import Accuracy, CriterionResult
from service.reports.display_text import to_one_line
from service.reports.plots.drawing import Drawing, Horizontal, Rectangle, Stroke, Vertical, create_drawing
from service.reports.plots.panel import Panel
from service.reports.plots.style import FAINT, HEAD, INK, RULE, WIDTH

NO_ANSWER = "no answer"
_LABEL_WIDTH, _SHORT_LABEL_WIDTH = 1.22, 0.62  # inches for the true labels at the left
_MAX_SHORT_LENGTH = 6  # largest number of characters in a short name
_FOOT_HEIGHT = 0.56  # inches
_TOTALS_WIDTH, _TOTAL_OFFSET, _RECALL_OFFSET = (
    3.2,
    0.85,
    2.4,
)  # widths in cells: the columns right of the counts, and positions in them
_HEADING_HEIGHT, _SHORT_HEADING_HEIGHT = 1.06, 0.24  # for the answers at the top


@dataclass(frozen=True, slots=True)
class ConfusionTable:
    """Counts, with one row per truth and one column per answer; ``totals`` are the sums of the rows."""

    truths: tuple[str, ...]
    answers: tuple[str, ...]
    counts: tuple[tuple[int, ...], ...]
    totals: tuple[int, ...]


def build_confusion_table(accuracy: Accuracy) -> ConfusionTable:
    """Return all labels in order, then answers that are not labels, then ``no answer`` if there was one."""
    seen_truths = dict.fromkeys(truth for truth, _, _ in accuracy.confusion)
    truths = tuple(dict.fromkeys((*accuracy.labels, *seen_truths)))
    given_answers = dict.fromkeys(answer for _, answer, _ in accuracy.confusion if answer is not None)
    answers = tuple(dict.fromkeys((*truths, *given_answers)))
    counts = {(truth, answer): 0 for truth in truths for answer in (*answers, None)}
    for truth, answer, count in accuracy.confusion:
        counts[truth, answer] += count
    columns: tuple[str | None, ...] = (*answers, None) if any(counts[t, None] for t in truths) else answers
    rows = tuple(tuple(counts[truth, column] for column in columns) for truth in truths)
    names = tuple(NO_ANSWER if column is None else column for column in columns)
    return ConfusionTable(truths, names, rows, tuple(sum(row) for row in rows))


def draw_confusion(result: CriterionResult, accuracy: Accuracy, title: str) -> Drawing:
    """Draw the confusion matrix of ``accuracy`` with its value, interval and n."""
    subtitle = (
        f"accuracy {accuracy.value:.2f}, 95 % interval {accuracy.low:.2f} to {accuracy.high:.2f}, "
        f"n = {accuracy.n} {select_unit(accuracy)}"
    )
    return draw_confusion_table(build_confusion_table(accuracy), title, subtitle)


def select_unit(accuracy: Accuracy) -> str:
    """Return the unit of ``n``: ``images`` or ``patterns``."""
    return accuracy.counts.of if accuracy.counts is not None else "images"


def draw_confusion_table(table: ConfusionTable, title: str, subtitle: str) -> Drawing:
    """Draw the confusion matrix of ``table``."""
    column_count = len(table.answers) + _TOTALS_WIDTH
    labels = _LABEL_WIDTH if any(len(truth) > _MAX_SHORT_LENGTH for truth in table.truths) else _SHORT_LABEL_WIDTH
    cell = min(0.56, (WIDTH - labels - 0.14) / column_count)
    body_height = cell * (len(table.truths) + 0.85)
    is_upright = any(len(answer) > _MAX_SHORT_LENGTH for answer in table.answers)
    heading_height = _HEADING_HEIGHT if is_upright else _SHORT_HEADING_HEIGHT
    drawing = create_drawing(HEAD + heading_height + body_height + _FOOT_HEIGHT, title, subtitle)
    place = Rectangle(labels, _FOOT_HEIGHT, cell * column_count, body_height + heading_height)
    panel = Panel(drawing, place, (0, column_count), (body_height / cell, -heading_height / cell))
    size = 9.0 if cell > 0.4 else max(8.0, 22 * cell)
    _draw_names(panel, table, _reduce_size(size), is_upright=is_upright)
    _draw_cells(panel, table, size)
    legend_lines = (
        "precision: correct share of the answers",
        "✓: correct  ✗: wrong;  recall: correct share of the images",
        "rows: true class;  columns: answer",
    )
    for number, line in enumerate(legend_lines):
        drawing.add_text(0.08, 0.10 + 0.14 * number, line, size=8, colour=FAINT)
    return drawing


def _draw_names(panel: Panel, table: ConfusionTable, size: float, *, is_upright: bool) -> None:
    """Draw all headings in one direction: horizontal if every name is short, otherwise upright."""
    for row, truth in enumerate((*table.truths, "precision")):
        _draw_name(panel, -0.12, row + 0.5, truth, size, "right", "center")
    count = len(table.answers)
    headings = [
        *((column + 0.5, answer) for column, answer in enumerate(table.answers)),
        (count + _TOTAL_OFFSET, "total"),
    ]
    for x, name in (*headings, (count + _RECALL_OFFSET, "recall")):
        if is_upright:
            _draw_name(panel, x, -0.18, name, size, "left", "center", rotation=90)
        else:
            _draw_name(panel, x, -0.14, name, size, "center", "bottom")


def _draw_name(
    panel: Panel, x: float, y: float, name: str, size: float, horizontal: Horizontal, vertical: Vertical,
    *, rotation: Literal[0, 90] = 0,
) -> None:  # fmt: skip
    text = "\n".join(textwrap.wrap(to_one_line(name, 40), 15, max_lines=2, placeholder="…"))
    panel.add_text(x, y, text, size=size, horizontal=horizontal, vertical=vertical, rotation=rotation)


def _draw_cells(panel: Panel, table: ConfusionTable, size: float) -> None:
    for row, counts in enumerate(table.counts):
        for column, count in enumerate(counts):
            share = count / table.totals[row] if table.totals[row] else 0.0
            is_correct = table.answers[column] == table.truths[row]
            _draw_cell(panel, (column, row), count, share, size, is_correct=is_correct)
        _draw_number(panel, len(counts) + _TOTAL_OFFSET, row, str(table.totals[row]), size)
        correct_count = counts[table.answers.index(table.truths[row])] if table.truths[row] in table.answers else 0
        recall = _format_share(correct_count, table.totals[row])
        _draw_number(panel, len(counts) + _RECALL_OFFSET, row, recall, _reduce_size(size))
    for column, answer in enumerate(table.answers):
        if answer in table.truths:
            answer_count = sum(counts[column] for counts in table.counts)
            correct_count = table.counts[table.truths.index(answer)][column]
            precision = _format_share(correct_count, answer_count)
            _draw_number(panel, column + 0.5, len(table.truths), precision, _reduce_size(size))


def _reduce_size(size: float) -> float:
    """Return the size for text beside the counts, as small as a phone can show it."""
    return max(0.82 * size, min(size, 8.0))


def _draw_number(panel: Panel, x: float, row: int, text: str, size: float) -> None:
    panel.add_text(x, row + 0.5, text, size=size, horizontal="center", vertical="center")


def _format_share(count: int, total: int) -> str:
    """Return a ratio as ``.83``, short enough for ten columns; a dash if the divisor is 0."""
    if not total:
        return "\N{EN DASH}"
    return str(count // total) if count in (0, total) else f"{count / total:.2f}".lstrip("0")


def _draw_cell(
    panel: Panel, corner: tuple[int, int], count: int, share: float, size: float, *, is_correct: bool
) -> None:
    # One hue each, from white to dark, so that the order is visible in a greyscale print.
    darkest = (0.07, 0.27, 0.47) if is_correct else (0.64, 0.09, 0.16)
    shade = to_hex((1 - share * (1 - darkest[0]), 1 - share * (1 - darkest[1]), 1 - share * (1 - darkest[2])))
    column, row = corner
    panel.add_rectangle(corner, 1, 1, fill=shade, edge=Stroke(RULE, 0.7))
    if is_correct:
        panel.add_rectangle((column + 0.05, row + 0.05), 0.9, 0.9, edge=Stroke(INK, 1.3))
    colour = "white" if share > 0.55 else (INK if count else FAINT)
    panel.add_text(
        column + 0.5, row + (0.66 if count else 0.5), str(count) if count else "·", size=size, bold=count > 0,
        colour=colour, horizontal="center", vertical="center",
    )  # fmt: skip
    if count:
        panel.add_text(
            column + 0.93, row + 0.06, "✓" if is_correct else "✗", size=_reduce_size(size), bold=True, colour=colour,
            horizontal="right", vertical="top",
        )  # fmt: skip
