"""Files that ``robomark run`` reads: programs, notebooks and the modules beside them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from service.grading.standalone_runs import read_neighbour_files, read_runnable
from sim.errors import UsageError


@pytest.mark.parametrize("name", ["huge.py", "huge.ipynb"])
def test_a_file_that_is_too_large_is_refused_unread(name: str, tmp_path: Path) -> None:
    huge, program = tmp_path / name, tmp_path / "robot.py"
    huge.touch()
    os.truncate(huge, 1 << 40)
    with pytest.raises(UsageError, match="too large"):
        read_runnable(huge)
    program.write_text("import huge\n")
    assert name not in read_neighbour_files(program, program.read_text())
