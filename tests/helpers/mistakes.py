"""Submissions with one mistake each, from tables of mistakes, and the first screen that their students see.

A case changes the reference of an assignment, or has complete texts, notebook cells or a single file.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from notebook_builder import document
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.reports.diagnosis import diagnose
from service.reports.view import build_student_view
from sim.errors import UsageError
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import locate_examples
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission

#: The first characters of a non-code cell in a table.
_TYPES = {"markdown": "# markdown\n", "raw": "# raw\n"}
_PARTS = ("robot.py", "responder.py")


def assignment_of(case: Mapping[str, Any]) -> Assignment:
    """Return the assignment of a case."""
    return find_assignment(case["assignment"])


def write_submission(case: Mapping[str, Any], folder: Path) -> Path:
    """Write the submission of a case below ``folder``, and return its path."""
    if "upload" in case:
        path = folder / str(case["upload"])
        path.write_text(case["content"], "utf-8")
        return path
    if "cells" in case:
        path = folder / "ada.ipynb"
        path.write_text(json.dumps(_notebook(case["cells"])))
        return path
    own = folder / "ada"
    own.mkdir()
    for name, content in case.get("beside", {}).items():
        (own / name).write_text(content, "utf-8")
    reference = locate_examples(case["assignment"]) / "reference"
    for part in sorted({*_PARTS, *(file.name for file in reference.glob("*.py"))}):
        change = case.get(part, {})
        text = _changed(case["assignment"], part, change)
        if text:
            (own / change.get("rename", part)).write_text(text, "utf-8")
    return own


def first_screen(case: Mapping[str, Any], folder: Path, runner: TrialRunner) -> str:
    """Return the cause and the next step in the report of a case, or the reason why the submission is refused."""
    assignment = assignment_of(case)
    try:
        submission = read_submission(write_submission(case, folder), required_parts=assignment.parts)
    except UsageError as refusal:
        return str(refusal)
    graded = grade(submission, assignment, runner=runner)
    diagnosis = diagnose(build_student_view(graded).grade, submission)
    return f"{diagnosis.cause}\n{diagnosis.next_step}"


def _changed(assignment: str, part: str, change: Mapping[str, Any]) -> str:
    if "text" in change:
        return str(change["text"])
    reference = locate_examples(assignment) / "reference" / part
    text = reference.read_text("utf-8") if reference.exists() else ""
    edits = [(change["from"], change["to"])] if "from" in change else change.get("edits", [])
    for before, after in edits:
        assert before in text, f"{assignment}'s {part} has no {before!r}"
        text = text.replace(before, after)
    return text + str(change.get("add", ""))


def _notebook(cells: list[str]) -> dict[str, Any]:
    made = document(cells)
    for cell, source in zip(made["cells"], cells, strict=True):
        for kind, begin in _TYPES.items():
            if source.startswith(begin):
                del cell["outputs"], cell["execution_count"]
                cell |= {"cell_type": kind, "source": source.removeprefix(begin)}
    return made
