"""Texts from students, made safe to display."""

from decimal import Decimal

import pytest

from service.reports.display_text import abbreviate_message, format_decimal, to_display_text, to_one_line


@pytest.mark.parametrize(
    ("text", "displayed_text"),
    [
        ("plain, é, 日本, 👩‍🚀", "plain, é, 日本, 👩‍🚀"),
        ("\x1b[31mred", "\\x1b[31mred"),
        ("nul\x00del\x7fc1\x9b", "nul\\x00del\\x7fc1\\x9b"),
        ("right\u202eleft\u2066", "right\\u202eleft\\u2066"),
        ("lone \ud800 half", "lone \\ud800 half"),
        ("zero\u200bwidth\ufeff", "zero\\u200bwidth\\ufeff"),
        ("two\r\nlines\ttab", "two\nlines    tab"),
        ("carriage\rreturn", "carriage\\x0dreturn"),
        ("noncharacter \U0001ffff", "noncharacter \\U0001ffff"),
    ],
)
def test_invisible_characters_are_spelled_out(text: str, displayed_text: str) -> None:
    assert to_display_text(text) == displayed_text
    assert to_display_text(to_display_text(text)) == displayed_text


def test_long_text_is_cut_and_says_by_how_much() -> None:
    assert to_display_text("x" * 1_000_000, 100) == "x" * 100 + "… (999,900 more characters)"
    assert to_display_text("a\n" * 50, 2000, lines=3) == "a\na\na\n… (48 more lines)"


def test_escapes_and_stacked_accents_cannot_blow_text_up() -> None:
    assert len(to_display_text("\x00" * 100_000, 100)) < 700
    assert to_display_text("a" + "\u0301" * 8).count("\u0301") == 6


def test_one_line() -> None:
    assert to_one_line("  a \n b\r\n\nc ") == "a ⏎ b ⏎ c"
    assert to_one_line("w" * 50, 10) == "wwwwwwwww…"


def test_a_image_message_is_named_not_listed() -> None:
    assert abbreviate_message('IMG_DATA::{"left": "' + "1," * 3200) == "IMG_DATA::{left, right}"
    assert abbreviate_message("PY::[1, 2]") == "PY::[1, 2]"


@pytest.mark.parametrize(
    ("marks", "displayed_text"),
    [("4.00", "4"), ("2.50", "2.5"), ("0E+1", "0"), ("100", "100"), ("0", "0"), ("0E-400000000", "0")],
)
def test_marks_as_people_write_them(marks: str, displayed_text: str) -> None:
    assert format_decimal(Decimal(marks)) == displayed_text
