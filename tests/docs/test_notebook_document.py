"""The tutorial in ``docs/notebook.md`` shows the cells of its notebook, and its tables are complete."""

from __future__ import annotations

import json
import re

import pytest

from paths import ROOT

pytestmark = pytest.mark.fast

TEXT = (ROOT / "docs" / "notebook.md").read_text()
NOTEBOOK = json.loads((ROOT / "docs" / "notebook.ipynb").read_text())


def test_the_tutorial_shows_the_cells_of_its_notebook_in_order() -> None:
    tutorial = TEXT[TEXT.index("## Tutorial") : TEXT.index("## Commands")]
    shown = re.findall(r"```python\n(.*?)\n```", tutorial, re.DOTALL)
    cells = ["".join(cell["source"]) for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code"]
    assert shown == cells


def test_the_notebook_is_saved_without_outputs() -> None:
    code = [cell for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code"]
    assert [(cell["outputs"], cell["execution_count"]) for cell in code] == [([], None)] * len(code)


def test_every_command_is_in_the_table() -> None:
    source = (ROOT / "notebook" / "robomark_notebook" / "commands.py").read_text()
    forms = re.findall(r'_Command\("([^"]+)"', source)
    assert forms
    assert [form for form in forms if f"| `%robomark {form}` |" not in TEXT] == []
