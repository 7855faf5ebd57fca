"""Draws who was taken for whom: truths down, answers across, counts in the cells, totals at the right.

It counts nothing anew; all numbers are those of the criterion's ``Accuracy``.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from service.grading.grade import Accuracy, CriterionResult
from service.reports.figure import FAINT, HEAD, INK, RULE, WIDTH, axes_at, drawable, font, new_figure, write
from service.reports.readable import one_line

NO_ANSWER = "no answer"
_LABELS = 1.22  # inches for the truths at the left
_HEADS = 0.86  # for the answers at the top


@dataclass(frozen=True, slots=True)
class Table:
    """Counts, one row a truth, one column an answer; ``totals`` are the rows' sums."""

    truths: tuple[str, ...]
    answers: tuple[str, ...]
    counts: tuple[tuple[int, ...], ...]
    totals: tuple[int, ...]


def confusion_table(accuracy: Accuracy) -> Table:
    """All labels in their order, then answers that are no label, then ``no answer`` if there was one."""
    seen = dict.fromkeys(truth for truth, _, _ in accuracy.confusion)
    truths = tuple(dict.fromkeys((*accuracy.labels, *seen)))
    given = dict.fromkeys(answer for _, answer, _ in accuracy.confusion if answer is not None)
    answers = tuple(dict.fromkeys((*truths, *given)))
    counts = {(truth, answer): 0 for truth in truths for answer in (*answers, None)}
    for truth, answer, count in accuracy.confusion:
        counts[truth, answer] += count
    columns: tuple[str | None, ...] = (*answers, None) if any(counts[t, None] for t in truths) else answers
    rows = tuple(tuple(counts[truth, column] for column in columns) for truth in truths)
    names = tuple(NO_ANSWER if column is None else column for column in columns)
    return Table(truths, names, rows, tuple(sum(row) for row in rows))


def draw_confusion(result: CriterionResult, accuracy: Accuracy, title: str) -> Figure:
    """The confusion matrix of ``accuracy`` with its value, interval and n."""
    table = confusion_table(accuracy)
    across = len(table.answers) + 1.25
    cell = min(0.56, (WIDTH - _LABELS - 0.14) / across)
    body = cell * len(table.truths)
    subtitle = (
        f"accuracy {accuracy.value:.2f}, 95 % interval {accuracy.low:.2f} to {accuracy.high:.2f}, "
        f"n = {accuracy.n} pictures; {one_line(result.title, 34)}"
    )
    figure = new_figure(HEAD + _HEADS + body + 0.30, title, subtitle)
    axes = axes_at(figure, _LABELS, 0.30, cell * across, body + _HEADS)
    axes.set_axis_off()
    axes.set_xlim(0, across)
    axes.set_ylim(body / cell, -_HEADS / cell)
    size = 9.0 if cell > 0.4 else max(5.0, 22 * cell)
    _draw_names(axes, table, size * 0.82)
    _draw_cells(axes, table, size)
    write(figure, 0.08, 0.10, "rows: what it was;  columns: what was answered;  framed: right", size=7.2, colour=FAINT)
    return figure


def _draw_names(axes: Axes, table: Table, size: float) -> None:
    for row, truth in enumerate(table.truths):
        _name(axes, -0.12, row + 0.5, truth, size, ha="right", va="center", rotation=0)
    for column, answer in enumerate(table.answers):
        _name(axes, column + 0.42, -0.14, answer, size, ha="left", va="bottom", rotation=52)
    _name(axes, len(table.answers) + 0.67, -0.14, "in all", size, ha="left", va="bottom", rotation=52)


def _name(axes: Axes, x: float, y: float, name: str, size: float, *, ha: str, va: str, rotation: float) -> None:
    text = "\n".join(textwrap.wrap(one_line(name, 40), 15, max_lines=2, placeholder="…"))
    axes.text(
        x, y, drawable(text), font=font(size), color=INK, ha=ha, va=va, rotation=rotation,
        rotation_mode="anchor", parse_math=False, linespacing=1.0, clip_on=False,
    )  # fmt: skip


def _draw_cells(axes: Axes, table: Table, size: float) -> None:
    for row, counts in enumerate(table.counts):
        for column, count in enumerate(counts):
            share = count / table.totals[row] if table.totals[row] else 0.0
            right = table.answers[column] == table.truths[row]
            _draw_cell(axes, (column, row), share, right=right)
            axes.text(
                column + 0.5, row + 0.5, str(count) if count else "·", font=font(size, bold=count > 0), ha="center",
                va="center", color="white" if share > 0.55 else (INK if count else FAINT),
            )  # fmt: skip
        axes.text(
            len(counts) + 0.75, row + 0.5, str(table.totals[row]), font=font(size), ha="center", va="center", color=INK
        )


def _draw_cell(axes: Axes, corner: tuple[int, int], share: float, *, right: bool) -> None:
    # One hue from white to dark blue, so that the order survives a greyscale print.
    shade = tuple(1 - share * (1 - channel) for channel in (0.07, 0.27, 0.47))
    axes.add_patch(Rectangle(corner, 1, 1, facecolor=shade, edgecolor=RULE, linewidth=0.7))
    if right:
        inner = (corner[0] + 0.05, corner[1] + 0.05)
        axes.add_patch(Rectangle(inner, 0.9, 0.9, facecolor="none", edgecolor=INK, linewidth=1.3, zorder=3))
