"""Files that are not programs: the error message names the file type and the right file to submit."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim.errors import UsageError
from submissions.bundle import read_submission


@pytest.mark.parametrize(
    ("name", "kind", "advice"),
    [
        ("robot.docx", "a Word document", "robot.py"),
        ("Notebook.HTML", "an HTML page", ".ipynb"),
        ("photo.heic", "a picture", "robot.py"),
        ("answer.txt", "a plain text file", "rename it"),
        ("work.tar.gz", "an archive that cannot be opened here", ".zip"),
        ("work.7z", "an archive that cannot be opened here", ".zip"),
    ],
)
def test_a_file_of_a_known_kind_gets_advice(tmp_path: Path, name: str, kind: str, advice: str) -> None:
    (tmp_path / name).write_text("x")
    with pytest.raises(UsageError) as alone:
        read_submission(tmp_path / name)
    with pytest.raises(UsageError) as in_folder:
        read_submission(tmp_path)
    for error in (alone, in_folder):
        assert f"{name} is {kind}, not a program: " in str(error.value)
        assert advice in str(error.value)
