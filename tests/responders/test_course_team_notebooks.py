"""Notebooks in the style of a course team, run from top to bottom: their output, speech and errors.

Each is a folder in ``data/notebooks/course_team`` with its extra files and the expected result.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from models import load_weights
from notebook_builder import NOTEBOOKS
from responders.notebook_executor import ExecutedNotebook
from service.grading.standalone_runs import RunOptions, run_notebook
from service.grading.trial_runner import TrialRunner
from submissions.notebook import read_notebook

FOLDERS = sorted(path.parent for path in (NOTEBOOKS / "course_team").glob("*/expected.toml"))
_NETWORK = "mlp_shapes_14x14.joblib"


def expected_of(folder: Path) -> dict[str, Any]:
    return tomllib.loads((folder / "expected.toml").read_text())


def executed(folder: Path, seconds: float, runner: TrialRunner) -> ExecutedNotebook:
    read = read_notebook((folder / f"{folder.name}.ipynb").read_bytes(), f"{folder.name}.ipynb")
    files = {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix == ".py"}
    files[_NETWORK] = load_weights("shapes")
    return run_notebook(read.notebook, files, RunOptions(seconds=seconds), runner)


def in_order(wanted: list[str], text: str) -> list[str]:
    """Return the texts that are missing or out of order."""
    missing, at = [], 0
    for each in wanted:
        position = text.find(each, at)
        if position < 0:
            missing.append(each)
        else:
            at = position + len(each)
    return missing


@pytest.mark.long
@pytest.mark.parametrize(
    "folder",
    [
        pytest.param(each, id=each.name, marks=pytest.mark.long if expected_of(each).get("long") else ())
        for each in FOLDERS
    ],
)
def test_it_runs_from_top_to_bottom(folder: Path, runner: TrialRunner) -> None:
    expected = expected_of(folder)
    notebook = executed(folder, expected.get("seconds", 60), runner)
    assert notebook.stopped is None
    assert in_order(expected["output"], notebook.output) == []
    assert len(notebook.runs) == expected["runs"]
    recordings = [run.recording for run in notebook.runs]
    assert [line.text for each in recordings for line in each.spoken] == expected.get("spoken", [])
    answers = [message for each in recordings for message in each.messages if message.sender == "responder"]
    assert len(answers) == expected.get("answers", len(answers))
    assert [str(each.verdict) for each in recordings] == expected.get("verdicts", ["finished"] * len(recordings))
    notes = expected.get("notes", [])
    assert [note for note in notebook.notes if not note.startswith(tuple(notes))] == []
    assert [note for note in notes if not any(notebook_note.startswith(note) for notebook_note in notebook.notes)] == []
    # No path to this machine's modules is shown.
    notebook_note = "\n".join([notebook.output, *notebook.notes, *(fault.message for fault in notebook.raised)])
    assert re.findall(r"\S*(?:site-packages|/responders/|/lib/python)\S*", notebook_note) == []


def test_there_are_twelve() -> None:
    assert len(FOLDERS) == 12
