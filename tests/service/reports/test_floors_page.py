"""The page of floors, where an instructor chooses one."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from command import robomark
from sim.floors import list_floor_names


@pytest.mark.long
def test_the_page_shows_every_floor_by_name_and_loads_nothing(tmp_path: Path) -> None:
    ended = robomark("floors", "--output", tmp_path / "floors")
    assert (ended.returncode, ended.stderr) == (0, "")
    page = (tmp_path / "floors" / "index.html").read_text()
    assert re.findall(r'<img src="data:image/png;base64,[^"]{2000,}" alt="The floor (\w+)\.">', page) == list(
        list_floor_names()
    )
    assert "labels: square, right facing triangle" in page
    assert not re.search(r'(src|href)="(?!data:)', page)
