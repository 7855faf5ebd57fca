"""Shares over hidden trials are rounded to 5 %: students cannot infer how many passed, staff can see it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from judging import START, criterion, recorded, talk
from report_builders import row_of
from service.grading.grade import Grade, TrialResult
from service.grading.judging.judge import judge
from service.grading.judging.marks import round_to_steps
from service.reports.formats.gradescope import render_gradescope
from service.reports.formats.json_output import render_json
from service.reports.formats.moodle import render_moodle_csv
from service.reports.formats.text import render_plain_text
from service.reports.html import render_report_page
from service.reports.view import build_gradebook_view, build_staff_view, build_student_view
from sim.recording import Image, Pose, Recording
from submissions.assignment.definition import Assignment, Parts, Scenario, WorldSpec
from submissions.submission import Submission

_RECOGNITION = {"truth": ["square"], "labels": ["square", "diamond"], "answer": "shape"}
_CRITERIA: tuple[tuple[str, Mapping[str, Any]], ...] = (
    ("pose", {"x": 190, "y": 800, "tolerance": 5}),
    ("pose", {"x": 190, "y": 800, "tolerance": 5, "over": "mean"}),
    ("replies", {"contains": ["square"], "over": "mean"}),
    ("classification", _RECOGNITION),
    ("classification", {**_RECOGNITION, "at_least": 0.95}),
    ("classification", {**_RECOGNITION, "steps": [[0.5, 1], [0.7, 3], [0.9, 4]]}),
    ("robustness", {**_RECOGNITION, "along": "light_noise"}),
)
_HIDDEN = 40


def _run(right: bool) -> Recording:
    shape = "square" if right else "diamond"
    image = Image(0.0, 1, START, b"", b"", 0, "square")
    run = recorded(messages=talk(("IMG_DATA", f'JSON::{{"shape": "{shape}"}}')), images=(image,))
    return run if right else replace(run, end=Pose(1000, 100, 0))


def _graded(check: str, keys: Mapping[str, Any], good: int, visibility: str = "hidden") -> Grade:
    """Return a grade with two passing visible trials and 40 hidden ones, of which ``good`` pass."""
    scenarios = (Scenario("shown", (START,), trials=2), Scenario("unseen", (START,), trials=_HIDDEN))
    assignment = Assignment("a", "A", WorldSpec("Simple_Shapes"), Parts(), scenarios, (criterion(check, **keys),))
    visible_trials = [("shown", "visible", index, True) for index in range(2)]
    unseen = [("unseen", visibility, index, index < good) for index in range(_HIDDEN)]
    trials = tuple(
        TrialResult(scenario, index, 1, 0.0, 0.0, seen, _run(right), (("light_noise", 8.0 * (index % 2)),))
        for scenario, seen, index, right in (*visible_trials, *unseen)
    )
    return Grade("a", "A", "1", "hash", "ada", judge(assignment, trials), trials, "none", "1")


def _read_by_students(graded: Grade) -> dict[str, str]:
    view = build_student_view(graded)
    return {
        "page": render_report_page(view, {}, Submission("ada")),
        "json": render_json(view),
        "text": render_plain_text(view),
        "gradescope": render_gradescope(build_gradebook_view(graded)),
        "moodle": render_moodle_csv([row_of(graded).apply_view(build_gradebook_view)]),
        "view": repr(view),
        "marks": str(graded.marks),
    }


@pytest.mark.parametrize(("check", "keys"), _CRITERIA)
def test_one_hidden_trial_more_within_a_step_is_not_seen(check: str, keys: Mapping[str, Any]) -> None:
    one, other = (_graded(check, keys, good) for good in (31, 32))
    assert _read_by_students(one) == _read_by_students(other)
    assert render_json(build_staff_view(one)) != render_json(build_staff_view(other))


@pytest.mark.parametrize(("check", "keys"), _CRITERIA)
def test_marks_over_hidden_trials_have_few_values(check: str, keys: Mapping[str, Any]) -> None:
    marks = {_graded(check, keys, good).marks for good in range(0, _HIDDEN + 1, 3)}
    steps = {Decimal(4 * step) / 20 for step in range(21)}
    assert marks <= steps
    assert _graded(check, keys, _HIDDEN).marks == 4


def test_marks_over_visible_trials_are_exact() -> None:
    assert _graded(*_CRITERIA[0], 31, "visible").marks == Decimal("3.14")
    assert _graded(*_CRITERIA[0], 32, "visible").marks == Decimal("3.24")


@given(st.fractions(0, 1))
def test_a_share_is_rounded_to_the_nearest_step(share: Fraction) -> None:
    rounded = round_to_steps(share)
    assert (rounded * 20).denominator == 1
    assert (rounded == 1) is (share == 1)
    assert abs(rounded - share) <= Fraction(1, 40) or share > Fraction(39, 40)
