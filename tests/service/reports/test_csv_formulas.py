"""No table has a formula in it, whatever separator a spreadsheet uses."""

from __future__ import annotations

import csv
import io

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from paths import ROOT
from service.reports.formats.csv_output import render_safe_csv

_STARTS = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")


@given(st.lists(st.lists(st.text("=+-@;,\t\r\n'\"x1 \uff1d", max_size=12), min_size=1, max_size=4), max_size=4))
@example([["x;=1+cmd|' /C calc'!A0"]])
@example([["a", "\t=1"], ['"=1', 'x;"=1']])
def test_no_cell_is_a_formula_by_any_separator(rows: list[list[str]]) -> None:
    text = render_safe_csv(rows)
    for separator in (",", ";", "\t"):
        for row in csv.reader(io.StringIO(text, newline=""), delimiter=separator):
            assert not any(cell.strip(" \"'").startswith(_STARTS) and not cell.startswith("'") for cell in row), row


@pytest.mark.parametrize("cell", ["PY::0", "3.5", "a - b", "Ada Lovelace", "one, two; three", "a=b", ""])
def test_ordinary_cells_stay_as_they_are(cell: str) -> None:
    assert next(csv.reader(io.StringIO(render_safe_csv([[cell, "x"]])))) == [cell, "x"]


def test_only_one_module_writes_tables() -> None:
    packages = ("models", "responders", "robomark", "service", "submissions")
    files = [path for package in packages for path in (ROOT / package).rglob("*.py")]
    inside = ("catalogue", "kit")
    texts = {path.name: path.read_text() for path in files if not set(inside) & set(path.parts)}
    assert {name for name, text in texts.items() if "csv.writer" in text or "DictWriter" in text} == {"csv_output.py"}
