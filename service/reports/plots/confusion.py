"""Drawing of confusion matrices: truths down, answers across, counts in the cells, totals at the right.

All numbers come from the criterion's ``Accuracy``.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from service.grading.grade import Accuracy, CriterionResult
from service.reports.display_text import to_one_line
from service.reports.plots.style import (
    FAINT,
    HEAD,
    INK,
    RULE,
    WIDTH,
    add_axes,
    create_figure,
    load_font,
    replace_missing_glyphs,
    write_text,
)

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


def draw_confusion(result: CriterionResult, accuracy: Accuracy, title: str) -> Figure:
    """Draw the confusion matrix of ``accuracy`` with its value, interval and n."""
    subtitle = (
        f"accuracy {accuracy.value:.2f}, 95 % interval {accuracy.low:.2f} to {accuracy.high:.2f}, "
        f"n = {accuracy.n} {select_unit(accuracy)}"
    )
    return draw_confusion_table(build_confusion_table(accuracy), title, subtitle)


def select_unit(accuracy: Accuracy) -> str:
    """Return the unit of ``n``: ``images`` or ``patterns``."""
    return accuracy.counts.of if accuracy.counts is not None else "images"


def draw_confusion_table(table: ConfusionTable, title: str, subtitle: str) -> Figure:
    """Draw the confusion matrix of ``table``."""
    column_count = len(table.answers) + _TOTALS_WIDTH
    labels = _LABEL_WIDTH if any(len(truth) > _MAX_SHORT_LENGTH for truth in table.truths) else _SHORT_LABEL_WIDTH
    cell = min(0.56, (WIDTH - labels - 0.14) / column_count)
    body_height = cell * (len(table.truths) + 0.85)
    is_upright = any(len(answer) > _MAX_SHORT_LENGTH for answer in table.answers)
    heading_height = _HEADING_HEIGHT if is_upright else _SHORT_HEADING_HEIGHT
    figure = create_figure(HEAD + heading_height + body_height + _FOOT_HEIGHT, title, subtitle)
    axes = add_axes(figure, labels, _FOOT_HEIGHT, cell * column_count, body_height + heading_height)
    axes.set_axis_off()
    axes.set_xlim(0, column_count)
    axes.set_ylim(body_height / cell, -heading_height / cell)
    size = 9.0 if cell > 0.4 else max(8.0, 22 * cell)
    _draw_names(axes, table, _reduce_size(size), is_upright=is_upright)
    _draw_cells(axes, table, size)
    legend_lines = (
        "precision: correct share of the answers",
        "✓: correct  ✗: wrong;  recall: correct share of the images",
        "rows: true class;  columns: answer",
    )
    for number, line in enumerate(legend_lines):
        write_text(figure, 0.08, 0.10 + 0.14 * number, line, size=8, colour=FAINT)
    return figure


def _draw_names(axes: Axes, table: ConfusionTable, size: float, *, is_upright: bool) -> None:
    """Draw all headings in one direction: horizontal if every name is short, otherwise upright."""
    for row, truth in enumerate((*table.truths, "precision")):
        _draw_name(axes, -0.12, row + 0.5, truth, size, ha="right", va="center")
    count = len(table.answers)
    headings = [
        *((column + 0.5, answer) for column, answer in enumerate(table.answers)),
        (count + _TOTAL_OFFSET, "total"),
    ]
    for x, name in (*headings, (count + _RECALL_OFFSET, "recall")):
        if is_upright:
            _draw_name(axes, x, -0.18, name, size, ha="left", va="center", rotation=90)
        else:
            _draw_name(axes, x, -0.14, name, size, ha="center", va="bottom")


def _draw_name(
    axes: Axes, x: float, y: float, name: str, size: float, *, ha: str, va: str, rotation: float = 0
) -> None:
    text = "\n".join(textwrap.wrap(to_one_line(name, 40), 15, max_lines=2, placeholder="…"))
    axes.text(
        x, y, replace_missing_glyphs(text), font=load_font(size), color=INK, ha=ha, va=va, rotation=rotation,
        rotation_mode="anchor", parse_math=False, linespacing=1.0, clip_on=False,
    )  # fmt: skip


def _draw_cells(axes: Axes, table: ConfusionTable, size: float) -> None:
    for row, counts in enumerate(table.counts):
        for column, count in enumerate(counts):
            share = count / table.totals[row] if table.totals[row] else 0.0
            is_correct = table.answers[column] == table.truths[row]
            _draw_cell(axes, (column, row), share, is_correct=is_correct)
            colour = "white" if share > 0.55 else (INK if count else FAINT)
            axes.text(
                column + 0.5, row + (0.66 if count else 0.5), str(count) if count else "·",
                font=load_font(size, bold=count > 0), ha="center",
                va="center", color=colour,
            )  # fmt: skip
            if count:
                axes.text(
                    column + 0.93, row + 0.06, "✓" if is_correct else "✗",
                    font=load_font(_reduce_size(size), bold=True),
                    ha="right", va="top", color=colour,
                )  # fmt: skip
        _draw_number(axes, len(counts) + _TOTAL_OFFSET, row, str(table.totals[row]), size)
        correct_count = counts[table.answers.index(table.truths[row])] if table.truths[row] in table.answers else 0
        _draw_number(
            axes, len(counts) + _RECALL_OFFSET, row, _format_share(correct_count, table.totals[row]), _reduce_size(size)
        )
    for column, answer in enumerate(table.answers):
        if answer in table.truths:
            answer_count = sum(counts[column] for counts in table.counts)
            correct_count = table.counts[table.truths.index(answer)][column]
            _draw_number(
                axes, column + 0.5, len(table.truths), _format_share(correct_count, answer_count), _reduce_size(size)
            )


def _reduce_size(size: float) -> float:
    """Return the size for text beside the counts, as small as a phone can show it."""
    return max(0.82 * size, min(size, 8.0))


def _draw_number(axes: Axes, x: float, row: int, text: str, size: float) -> None:
    axes.text(x, row + 0.5, text, font=load_font(size), ha="center", va="center", color=INK)


def _format_share(count: int, total: int) -> str:
    """Return a ratio as ``.83``, short enough for ten columns; a dash if the divisor is 0."""
    if not total:
        return "\N{EN DASH}"
    return str(count // total) if count in (0, total) else f"{count / total:.2f}".lstrip("0")


def _draw_cell(axes: Axes, corner: tuple[int, int], share: float, *, is_correct: bool) -> None:
    # One hue each, from white to dark, so that the order is visible in a greyscale print.
    darkest = (0.07, 0.27, 0.47) if is_correct else (0.64, 0.09, 0.16)
    shade = tuple(1 - share * (1 - channel) for channel in darkest)
    axes.add_patch(Rectangle(corner, 1, 1, facecolor=shade, edgecolor=RULE, linewidth=0.7))
    if is_correct:
        inner = (corner[0] + 0.05, corner[1] + 0.05)
        axes.add_patch(Rectangle(inner, 0.9, 0.9, facecolor="none", edgecolor=INK, linewidth=1.3, zorder=3))
