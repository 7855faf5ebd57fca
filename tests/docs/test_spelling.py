"""Documentation, code and templates have no common misspellings. ``pyproject.toml`` lists the accepted words."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from paths import ROOT

pytestmark = pytest.mark.fast

_PACKAGES = ("sim", "models", "submissions", "responders", "service", "robomark")
_CHECKED = ["docs", "benchmarks", "deploy", "Makefile", "pyproject.toml", *_PACKAGES]


def _misspelt(*paths: str | Path) -> str:
    command = [sys.executable, "-m", "codespell_lib", "--toml", "pyproject.toml", *map(str, paths)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    # 65: misspellings were found. Any other status is an error of the check.
    assert done.returncode in (0, 65), done.stderr
    return done.stdout


def test_nothing_is_misspelt() -> None:
    assert _misspelt(*_CHECKED, *ROOT.glob("*.md")) == ""


def test_a_misspelt_word_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text("<p>You recieve a grade.</p>\n")
    assert "receive" in _misspelt(page)
