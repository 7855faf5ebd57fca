"""Drawings: coordinates, ticks, and the pixels of lines, areas, marks, images and texts."""

from __future__ import annotations

import io
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.markers import MarkerStyle
from numpy.typing import NDArray
from PIL import Image

from service.reports.plots.drawing import Drawing, Rectangle, Stroke, Vertical, create_drawing
from service.reports.plots.panel import Panel, choose_ticks, format_ticks
from service.reports.plots.plot import DPI
from service.reports.plots.png import render_png
from service.reports.plots.raster import rasterise
from service.reports.plots.style import FAULT, INK, LEFT, RIGHT, SAID

pytestmark = pytest.mark.fast

PLACE = Rectangle(0.5, 0.25, 2.0, 1.0)


def draw_panel(x_limits: tuple[float, float] = (0, 10), y_limits: tuple[float, float] = (0, 5)) -> Panel:
    """Return a panel in a drawing of 3 x 2 inches."""
    return Panel(Drawing(3.0, 2.0), PLACE, x_limits, y_limits)


def read_pixel(drawing: Drawing, x: float, y: float) -> tuple[int, ...]:
    """Return red, green and blue at ``x``, ``y`` inches."""
    pixels = rasterise(drawing)
    return tuple(pixels[pixels.shape[0] - 1 - int(y * DPI), int(x * DPI), :3].tolist())


def find_ink(drawing: Drawing) -> NDArray[np.bool_]:
    """Return where the drawing is not white, the first row at the bottom."""
    return np.asarray((rasterise(drawing)[::-1, :, :3] < 128).any(axis=2))


def test_coordinates_are_linear_in_both_directions() -> None:
    assert draw_panel().to_inches([(0, 0), (10, 5)]).tolist() == [[0.5, 0.25], [2.5, 1.25]]
    upside_down = draw_panel(y_limits=(5, 0)).to_inches([(5, 5), (5, 0)])
    assert upside_down.tolist() == [[1.5, 0.25], [1.5, 1.25]]


def test_what_leaves_a_panel_is_cut() -> None:
    panel = draw_panel()
    panel.add_line([(-100, 2.5), (100, 2.5)], Stroke(INK, 2))
    panel.add_rectangle((8, 1), 50, 1, fill=LEFT)
    panel.add_picture(np.zeros((4, 4, 3), np.uint8), -5, 3, 2, 20)
    rows, columns = np.nonzero(find_ink(panel.drawing))
    assert columns.min() >= 0.5 * DPI - 1
    assert columns.max() <= 2.5 * DPI + 1
    assert rows.max() <= 1.25 * DPI + 1


def test_later_items_cover_earlier_ones() -> None:
    panel = draw_panel()
    panel.add_rectangle((0, 0), 10, 5, fill=LEFT)
    panel.add_rectangle((2, 2), 2, 2, fill=RIGHT)
    assert read_pixel(panel.drawing, 1.1, 0.85) == (0xD9, 0x79, 0x1A)
    assert read_pixel(panel.drawing, 2.0, 0.85) == (0x0B, 0x4A, 0x86)


def test_an_image_keeps_its_orientation() -> None:
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[0, 0], pixels[0, 1], pixels[1, 0], pixels[1, 1] = (255, 0, 0), (0, 255, 0), (0, 0, 255), (9, 9, 9)
    for y_limits, low, high in (((0, 5), 0, 5), ((5, 0), 0, 5)):
        panel = draw_panel(y_limits=y_limits)
        panel.add_picture(pixels, 0, low, 10, high)
        assert read_pixel(panel.drawing, 0.7, 1.1) == (255, 0, 0)
        assert read_pixel(panel.drawing, 2.3, 1.1) == (0, 255, 0)
        assert read_pixel(panel.drawing, 0.7, 0.4) == (0, 0, 255)
        assert read_pixel(panel.drawing, 2.3, 0.4) == (9, 9, 9)


@pytest.mark.parametrize("rotation", [0, 90])
@pytest.mark.parametrize("text", ["Hxp", "H\nxp"])
def test_text_stands_at_its_anchor(text: str, rotation: int) -> None:
    extents = {}
    for name in ("left", "center", "right"):
        drawing = Drawing(2.0, 2.0)
        drawing.add_text(1.0, 1.0, text, size=20, horizontal=name, rotation=rotation)  # type: ignore[arg-type]
        along = np.nonzero(find_ink(drawing).any(axis=0 if rotation == 0 else 1))[0] / DPI
        extents[name] = (along.min(), along.max())
    assert extents["left"][0] == pytest.approx(1.0, abs=0.04)
    assert extents["right"][1] == pytest.approx(1.0, abs=0.04)
    assert sum(extents["center"]) / 2 == pytest.approx(1.0, abs=0.04)


def test_vertical_anchors_go_from_top_to_bottom() -> None:
    tops = []
    anchors: tuple[Vertical, ...] = ("top", "middle", "baseline", "bottom")
    for name in anchors:
        drawing = Drawing(2.0, 2.0)
        drawing.add_text(1.0, 1.0, "H", size=20, vertical=name)
        rows = np.nonzero(find_ink(drawing).any(axis=1))[0] / DPI
        tops.append((rows.min(), rows.max()))
    assert tops[0][1] <= 1.01
    assert sum(tops[1]) / 2 == pytest.approx(1.0, abs=0.02)
    assert tops[2][0] == pytest.approx(1.0, abs=0.02)
    assert tops[3][0] >= 1.0


def test_text_is_never_interpreted_and_lacking_characters_are_replaced() -> None:
    drawing = Drawing(3.0, 1.0)
    for text in ("$\\frac{1}{2}$", "\ud800\x00\x1b[31m", "\u202eabc", "\U0001f600", ""):
        drawing.add_text(0.1, 0.5, text)
    assert render_png(drawing)


def test_marks_are_centred_and_open_ones_have_no_fill() -> None:
    drawing = Drawing(2.0, 2.0)
    drawing.add_marks([(1.0, 1.0)], MarkerStyle("s"), 20, None, Stroke(FAULT, 2))
    drawing.add_marks([(0.4, 0.4)], MarkerStyle("o"), 10, SAID, None)
    rows, columns = np.nonzero(find_ink(drawing)[150:, 150:])
    assert rows.mean() + 150 == pytest.approx(DPI, abs=1)
    assert columns.mean() + 150 == pytest.approx(DPI, abs=1)
    assert read_pixel(drawing, 1.0, 1.0) == (255, 255, 255)
    assert read_pixel(drawing, 0.4, 0.4) == (0x3F, 0x7D, 0x3C)


def test_colours_of_floors_and_photographs_are_kept() -> None:
    noise = np.random.default_rng(1).integers(0, 256, (100, 100, 3), np.uint8)
    bands = np.repeat(np.array([[(255, 72, 72), (255, 255, 72), (72, 72, 255), (72, 255, 72)]], np.uint8), 20, axis=1)
    for pixels, tolerance in ((noise, 40), (bands, 8)):
        drawing = create_drawing(2.0, "A title")
        panel = Panel(drawing, Rectangle(0.5, 0.2, 0.5, 0.5), (0, 1), (0, 1))
        panel.add_picture(pixels, 0, 0, 1, 1)
        before = rasterise(drawing)[:, :, :3].astype(int)
        with Image.open(io.BytesIO(render_png(drawing))) as image:
            after = np.asarray(image.convert("RGB")).astype(int)
        assert np.abs(after - before).mean(axis=2).max() <= tolerance
        assert (after[0, 0] == 255).all()


@given(st.floats(-1e100, 1e100), st.floats(1e-6, 1e6), st.integers(1, 12))
def test_ticks_are_few_inside_and_have_different_labels(middle: float, relative_size: float, count: int) -> None:
    size = max(relative_size, 1e-6 * abs(middle))
    ticks = choose_ticks((middle - size, middle + size), count)
    assert len(ticks) <= max(count, 2) + 1
    assert all(middle - 1.001 * size <= tick <= middle + 1.001 * size for tick in ticks)
    labels = format_ticks(ticks)
    assert len(set(labels)) == len(set(ticks))
    for tick, label in zip(ticks, labels, strict=True):
        assert math.isclose(float(label.replace("\N{MINUS SIGN}", "-")), tick, rel_tol=1e-3, abs_tol=1e-3 * size)


@pytest.mark.parametrize(
    ("ticks", "labels"),
    [
        ([0, 500, 1000], ["0", "500", "1000"]),
        ([-0.5, 0, 0.5], ["\N{MINUS SIGN}0.5", "0.0", "0.5"]),
        ([0, 0.25, 0.5], ["0.00", "0.25", "0.50"]),
        ([1e100, 2e100], ["1e+100", "2e+100"]),
        ([], []),
    ],
)
def test_tick_labels(ticks: list[float], labels: list[str]) -> None:
    assert format_ticks(ticks) == labels


def test_a_very_large_drawing_has_a_lower_resolution() -> None:
    rows, columns = rasterise(Drawing(40.0, 40.0)).shape[:2]
    assert rows * columns <= 6_100_000
