"""Names of exported files can be created on every operating system."""

from __future__ import annotations

import pytest

from service.file_names import make_portable_name

pytestmark = pytest.mark.fast


@pytest.mark.parametrize(
    ("name", "portable"),
    [
        ("CON.txt", "CON~.txt"),
        ("con", "con~"),
        ("Aux.tar.gz", "Aux~.tar.gz"),
        ("nul .html", "nul ~.html"),
        ("LPT1.html", "LPT1~.html"),
        ("COM².html", "COM²~.html"),
        ("console.txt", "console.txt"),
        ("COM10.txt", "COM10.txt"),
        ("x.con", "x.con"),
        ("CON+echo.txt", "CON+echo.txt"),
        ("", ""),
    ],
)
def test_names_that_windows_reserves_are_changed(name: str, portable: str) -> None:
    assert make_portable_name(name) == portable
    assert make_portable_name(portable) == portable
