"""The plain Python of a notebook: lines keep their numbers, magics without Python are removed, work is bounded."""

from __future__ import annotations

import sys
from types import FrameType

import pytest

from submissions.notebook_python import extract_python
from submissions.submission import Cell, Notebook


def _python(*sources: str) -> str:
    return extract_python(Notebook("a.ipynb", tuple(Cell(number, source) for number, source in enumerate(sources, 1))))


@pytest.mark.parametrize(
    ("source", "python"),
    [
        ("x = 1", "x = 1"),
        ("%%time\nx = 1", "#\nx = 1"),
        ("# above\n\n%%time -n 3\n\n%%capture out\nx = 1\n%%time", "#\n#\n#\n#\n#\nx = 1\npass  # %%time"),
        ("%%html\n<b>", ""),
        ("%%time\n%%html\n<b>", ""),
        ("x = 1\n%%html", "x = 1\npass  # %%html"),
        ("if x:\n    !ls\n    %time y = 2", "if x:\n    pass  # !ls\n    y = 2"),
    ],
)
def test_lines_keep_their_places(source: str, python: str) -> None:
    assert _python(source) == python


def test_wrappers_in_wrappers_take_a_few_calls_for_each_line() -> None:
    calls = 0

    def count(_frame: FrameType, event: str, _value: object) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    lines = 300
    sys.setprofile(count)
    try:
        text = _python("%%time\n" * lines + "x = 1")
    finally:
        sys.setprofile(None)
    assert text == "#\n" * lines + "x = 1"
    assert calls < 20 * lines
