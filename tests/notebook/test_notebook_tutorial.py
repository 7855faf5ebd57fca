"""The tutorial's notebook and the recipe for nbgrader, in real kernels with the engine of this machine."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import pytest

from notebook_builder import notebook as write_notebook
from notebook_package import run_notebook, text_of
from paths import ROOT

pytestmark = pytest.mark.long

TEXT = (ROOT / "docs" / "notebook.md").read_text()
TUTORIAL = json.loads((ROOT / "docs" / "notebook.ipynb").read_text())
CELLS = ["".join(cell["source"]) for cell in TUTORIAL["cells"] if cell["cell_type"] == "code"]


@pytest.mark.parametrize(("threshold", "marks"), [("> 95", "0 of 8"), ("> 0", "8 of 8")])
def test_the_tutorial_runs_and_its_check_has_full_marks_after_the_change(
    package: Path, tmp_path: Path, threshold: str, marks: str
) -> None:
    cells = [cell.replace("> 95", threshold) for cell in CELLS]
    write_notebook(tmp_path / "notebook.ipynb", cells)
    texts = [text_of(cell) for cell in run_notebook(tmp_path, package, cells).cells]
    assert "(says) I have found the line" in texts[1]
    assert f"Stop at the black line: {marks} marks." in texts[2]
    assert "The robot asks for the square of 4" in texts[4]
    assert "Answers: [4, 9, 16]" in texts[4]
    assert texts[5] == "['PY::2', 'PY::3', 'PY::4']"
    assert texts[6].startswith("value\n100.0 ")


def test_the_recipe_for_nbgrader_gives_the_points(
    package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:/usr/bin:/bin")
    recipe = re.findall(r"```python\n(.*?)\n```", TEXT[TEXT.index("## With nbgrader") :], re.DOTALL)[-1]
    program = CELLS[1].replace("> 95", "> 0")
    write_notebook(tmp_path / "task.ipynb", [CELLS[0], program, recipe])
    assert text_of(run_notebook(tmp_path, package, [CELLS[0], recipe]).cells[1]) == "8.0"
