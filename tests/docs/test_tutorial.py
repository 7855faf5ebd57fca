"""The steps of the tutorial work in a browser, on a new installation: its pictures are taken from them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from browsing import chromium
from paths import ROOT

pytestmark = pytest.mark.long

_PICTURES = sorted(["student-editor.png", *(file.name for file in (ROOT / "docs").glob("tutorial-*.png"))])


def test_the_pictures_can_be_taken(tmp_path: Path) -> None:
    with chromium():
        pass  # skips the test if there is none
    code = f"from pathlib import Path; from tutorial_pictures import *; photograph_tutorial(Path({str(tmp_path)!r}))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT / "docs", capture_output=True, text=True, timeout=900, check=False
    )
    assert done.returncode == 0, done.stderr
    taken = {file.name: file.stat().st_size for file in tmp_path.iterdir()}
    assert sorted(taken) == _PICTURES
    assert max(taken.values()) < 150_000
