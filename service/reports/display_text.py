"""Conversion of student-written text for display: visible, in one direction, limited in length.

It does not escape for HTML, XML or terminal markup. The writers of those formats do that.
"""

from __future__ import annotations

import math
import re
import unicodedata
from decimal import Decimal

#: Joiners that emoji and several scripts need. All other invisible format characters are spelled out.
_JOINERS = "\u200c\u200d"
_MAX_COMBINING_MARKS = 6  # combining marks on one letter; living scripts need no more
_HIDDEN_CATEGORIES = frozenset({"Cc", "Cf", "Cs", "Cn", "Zl", "Zp"})


def to_display_text(text: str, limit: int = 2000, *, lines: int = 40) -> str:
    r"""Return ``text`` without invisible characters, at most ``limit`` characters and ``lines`` lines long.

    Control characters, bidirectional overrides, lone surrogates and similar become escapes such as ``\x1b`` and
    ``\u202e``. Line feeds stay, and tabs become four spaces. A note at the end says how much was cut.
    """
    start_text = text[:limit]
    kept_lines = start_text.replace("\r\n", "\n").split("\n")[:lines]
    visible_text = "\n".join(_escape_invisible(line) for line in kept_lines)
    if len(visible_text) > 6 * limit:  # escapes are longer than the characters they replace
        visible_text = visible_text[: 6 * limit]
    missing_lines = text.count("\n") + 1 - len(kept_lines)
    if len(text) > limit:
        return f"{visible_text}… ({len(text) - limit:,} more characters)"
    if missing_lines > 0:
        return f"{visible_text}\n… ({missing_lines:,} more lines)"
    return visible_text


def to_one_line(text: str, limit: int = 120) -> str:
    """Return ``text`` on one line, at most ``limit`` characters, with an ellipsis if it was cut."""
    visible_text = _escape_invisible(re.sub(r"\s*[\r\n]\s*", " ⏎ ", text[: 4 * limit + 4].strip()))
    return (
        visible_text
        if len(visible_text) <= limit and len(text) <= 4 * limit
        else visible_text[: limit - 1].rstrip() + "…"
    )


def join_wrapped_lines(text: str) -> str:
    """Return paragraphs on one line each, for wrapping at display. Lists and indented lines stay."""
    return re.sub(r"(?<=\S)\n(?=[^\W\d])", " ", text)


def abbreviate_message(text: str, limit: int = 120) -> str:
    """Return a message on one line. The thousands of numbers of an image are abbreviated."""
    if text.startswith("IMG_DATA::{") and len(text) > 200:
        return "IMG_DATA::{left, right}"
    return to_one_line(text, limit)


def format_whole_number(value: float) -> str:
    """Return ``value`` without decimals, with a true minus sign and never as minus zero."""
    return str(round(value)).replace("-", "\N{MINUS SIGN}") if math.isfinite(value) else "?"


def format_heading(heading: float) -> str:
    """Return a heading as whole degrees from 0 to 359."""
    return str(round(heading) % 360) if math.isfinite(heading) else "?"


def format_decimal(value: Decimal) -> str:
    """Return marks as people write them: ``4``, ``2.5``, never ``4.00`` or ``0E+1``."""
    # Written out, 0E-400000000 has 400 million digits.
    return f"{value.normalize():f}"


def to_json_number(value: Decimal) -> int | float:
    """Return a Decimal as a JSON number: whole numbers without a decimal point."""
    return int(value) if value == value.to_integral_value() else float(value)


def _escape_invisible(line: str) -> str:
    pieces: list[str] = []
    marks = 0
    for character in line:
        category = unicodedata.category(character)
        marks = marks + 1 if category in ("Mn", "Me") else 0
        if character == "\t":
            pieces.append("    ")
        elif marks > _MAX_COMBINING_MARKS or (category in _HIDDEN_CATEGORIES and character not in _JOINERS):
            pieces.append(_escape_character(character))
        else:
            pieces.append(character)
    return "".join(pieces)


def _escape_character(character: str) -> str:
    code = ord(character)
    if code < 0x100:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
