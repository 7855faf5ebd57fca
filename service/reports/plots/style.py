"""The common style of plots: page size, type, and colours that also differ in lightness.

It holds no state and never uses pyplot, so plots are the same in any process.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import matplotlib
from matplotlib.font_manager import get_font

from service.reports.display_text import to_one_line

# A file called matplotlibrc in the current folder must not change plots.
matplotlib.rcParams.update({name: value for name, value in matplotlib.rcParamsDefault.items() if "backend" not in name})

#: Inches. A phone shows it 390 pixels wide, with the smallest type 11 pixels high.
WIDTH = 3.9
HEAD = 0.68  # height of the title and the subtitle
TITLE_LEFT = 0.08
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


@dataclass(frozen=True, slots=True)
class TitleLine:
    """A line of the title or the subtitle; ``top`` is the upper edge of its text in inches from the page's foot."""

    text: str
    top: float
    size: float  # points
    colour: str
    bold: bool


def lay_out_title(width: float, height: float, title: str, subtitle: str) -> list[TitleLine]:
    """Return the lines at the top left of a page of ``width`` x ``height`` inches, in ``HEAD`` inches."""
    title_line = TitleLine(to_one_line(title, int(width * 10)), height - 0.08, 10, INK, bold=True)
    lines = textwrap.wrap(to_one_line(subtitle, 200), int(width * CHARACTERS), max_lines=2, placeholder=" …")
    subtitle_lines = (
        TitleLine(line, height - 0.29 - 0.135 * number, 8, FAINT, bold=False) for number, line in enumerate(lines)
    )
    return [title_line, *subtitle_lines]


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
