"""The near misses that students make: each report begins with what was found, where, and what was expected."""

from __future__ import annotations

import io
import json
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from paths import DATA
from service.grading.grade import CriterionResult, Grade
from service.grading.grader import grade
from service.grading.hint_clues import clues_of
from service.grading.hint_rules import PRELOADED
from service.grading.hints import near_misses
from service.grading.run_plan import plan_run
from service.grading.trial_runner import TrialRunner
from service.reports.formats import FORMATS
from service.reports.formats.rich_text import rich_report
from service.reports.html import report
from service.reports.rows import TableRow
from service.reports.view import staff_view, student_view
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import examples
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission
from submissions.people import Student

NEAR_MISSES = tomllib.loads((DATA / "near_misses.toml").read_text("utf-8"))["near_miss"]
IS_THAT_A = """
id = "is-that-a"
title = "Say it"
[world]
background = "Empty_Map"
[parts]
responder = "none"
[[scenario]]
id = "once"
poses = [[100, 800, 0]]
seconds = 5
[[criterion]]
title = "Asks"
marks = 1
check = "says"
starts_with = "Is that a"
"""


def asked_in(name: str, folder: Path) -> Assignment:
    """With one pose a scenario, for that is enough to go wrong."""
    if name != "is-that-a":
        whole = find_assignment(name)
        return replace(whole, scenarios=tuple(replace(each, poses=each.poses[:1]) for each in whole.scenarios))
    (folder / "is-that-a").mkdir()
    (folder / "is-that-a" / "assignment.toml").write_text(IS_THAT_A)
    return find_assignment(str(folder / "is-that-a"))


def written(case: Mapping[str, Any], folder: Path) -> Path:
    """The reference with the mistake in it."""
    own = folder / "ada"
    own.mkdir()
    for part in ("robot.py", "responder.py"):
        change = case.get(part, {})
        if "text" in change:
            text = change["text"]
        else:
            reference = examples(case["assignment"]) / "reference" / part
            text = reference.read_text("utf-8") if reference.exists() else ""
        if "from" in change:
            assert change["from"] in text
            text = text.replace(change["from"], change["to"])
        if text:
            (own / change.get("rename", part)).write_text(text, "utf-8")
    return own


def graded_case(case: Mapping[str, Any], folder: Path, runner: TrialRunner) -> Grade:
    asked = asked_in(case["assignment"], folder)
    return grade(read_submission(written(case, folder), asked=asked.parts), asked, runner=runner)


@pytest.mark.parametrize("case", NEAR_MISSES, ids=lambda case: case["name"])
def test_a_near_miss_is_named_first(case: Mapping[str, Any], runner: TrialRunner, tmp_path: Path) -> None:
    graded = graded_case(case, tmp_path, runner)
    assert graded.marks < graded.max_marks
    first = plain(graded).partition("→ ")[2]
    assert first.startswith(case["hint"])
    assert case.get("also", "") in first


def plain(graded: Grade) -> str:
    form = FORMATS["text"]
    assert form.document is not None
    return " ".join(form.document(graded).split())
