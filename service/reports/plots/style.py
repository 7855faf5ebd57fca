"""The common style of plots: page size, type, and colours that also differ in lightness.

It holds no state and never uses pyplot, so plots are the same in any process.
"""

from __future__ import annotations

import math
import textwrap
from functools import lru_cache
from pathlib import Path

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, get_font
from matplotlib.text import Text

from service.reports.display_text import to_one_line
from service.reports.plots.plot import DPI

# A file called matplotlibrc in the current folder must not change plots.
matplotlib.rcParams.update({name: value for name, value in matplotlib.rcParamsDefault.items() if "backend" not in name})

#: Inches. A phone shows it 390 pixels wide, with the smallest type 11 pixels high.
WIDTH = 3.9
MIN_FONT_SIZE = 8.0  # points
CHARACTERS = 15.2  # characters of a subtitle in an inch
MAX_PIXELS = 6_000_000

INK = "#1c2630"
FAINT = "#5d6873"
RULE = "#c9ced3"
LEFT = "#0b4a86"  # dark; the right side's orange is lighter and always dashed
RIGHT = "#d9791a"
PEN = "#e79b9b"
FAULT = "#a3162a"
SAID = "#3f7d3c"
SECOND_ROBOT = "#7a3e9d"
OFF_THE_FLOOR = "#a3aab1"

FONT_FILE = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
BOLD_FONT_FILE = FONT_FILE.with_name("DejaVuSans-Bold.ttf")


def lighten(value: int) -> int:
    """Return a channel of a floor's colour, 0 to 255, as plots show it.

    A path over black stays visible, and printing saves ink.
    """
    return round(72 + value * (183 / 255))


def create_figure(height: float, title: str, subtitle: str = "", width: float = WIDTH) -> Figure:
    """Return a white figure of ``width`` x ``height`` inches with its title at the top left, in ``HEAD`` inches.

    Very large figures get a lower resolution to save memory.
    """
    dpi = min(DPI, math.sqrt(MAX_PIXELS / (width * height)))
    figure = Figure(figsize=(width, height), dpi=dpi, facecolor="white")
    write_text(figure, 0.08, height - 0.08, to_one_line(title, int(width * 10)), size=10, bold=True, va="top")
    lines = textwrap.wrap(to_one_line(subtitle, 200), int(width * CHARACTERS), max_lines=2, placeholder=" …")
    for number, line in enumerate(lines):
        write_text(figure, 0.08, height - 0.29 - 0.135 * number, line, size=8, colour=FAINT, va="top")
    return figure


HEAD = 0.68


def write_text(
    figure: Figure,
    x: float,
    y: float,
    text: str,
    *,
    size: float = 8.5,
    colour: str = INK,
    bold: bool = False,
    ha: str = "left",
    va: str = "baseline",
) -> Text:
    """Write text at ``x``, ``y`` inches from the lower left corner of the figure."""
    width, height = figure.get_size_inches()
    return figure.text(
        x / width, y / height, replace_missing_glyphs(text), color=colour, ha=ha, va=va, font=load_font(size,
        bold=bold),
        parse_math=False,
    )  # fmt: skip


def add_axes(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Return axes without ticks and frame at a rectangle. Their coordinates are inches from its lower left corner."""
    figure_width, figure_height = figure.get_size_inches()
    axes = figure.add_axes((left / figure_width, bottom / figure_height, width / figure_width, height / figure_height))
    axes.set_axis_off()
    axes.set_xlim(0, width)
    axes.set_ylim(0, height)
    return axes


@lru_cache(maxsize=64)
def load_font(size: float, *, bold: bool = False) -> FontProperties:
    """Return the type bundled with matplotlib, independent of installed fonts, in a size readable on a phone."""
    return FontProperties(fname=str(BOLD_FONT_FILE if bold else FONT_FILE), size=max(size, MIN_FONT_SIZE))


def replace_missing_glyphs(text: str) -> str:
    """Replace every character that the type lacks, so that none is drawn as an empty box."""
    known_characters = _load_known_characters()
    return "".join(
        character if character == "\n" or ord(character) in known_characters else "\ufffd" for character in text
    )


@lru_cache(maxsize=1)
def _load_known_characters() -> frozenset[int]:
    # Both weights are used, and the bold one has fewer characters.
    return frozenset(get_font(str(FONT_FILE)).get_charmap()) & frozenset(get_font(str(BOLD_FONT_FILE)).get_charmap())
