"""Submissions with one of two parts: criteria that need the missing part get no marks, the others are unaffected."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.reports.formats.json_output import build_json_document
from service.reports.formats.text import render_plain_text
from service.reports.html import render_report_page
from service.reports.view import build_staff_view, build_student_view
from submissions.assignment.examples import locate_examples
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission
from submissions.criteria import SCHEMAS

#: Assignment, submitted part, and the reference's marks for that part alone, by criterion.
CASES = [
    ("echo-responder", "robot.py", {"finishes": 1, "counts": 2, "messages": 2, "replies": 0, "says": 1}),
    ("echo-responder", "responder.py", {"finishes": 0, "counts": 0, "messages": 0, "replies": 4, "says": 0}),
]


@pytest.fixture(scope="module")
def runner() -> Iterator[TrialRunner]:
    with TrialRunner() as made:
        yield made


@pytest.mark.parametrize(("assignment", "part", "marks"), CASES)
def test_what_is_there_is_graded(
    assignment: str, part: str, marks: dict[str, int], runner: TrialRunner, tmp_path: Path
) -> None:
    own = tmp_path / "ada"
    own.mkdir()
    (own / part).write_bytes((locate_examples(assignment) / "reference" / part).read_bytes())
    graded_assignment = find_assignment(assignment)
    graded = grade(read_submission(own, required_parts=graded_assignment.parts), graded_assignment, runner=runner)
    assert {result.id: result.marks for result in graded.criteria} == marks
    (lacking,) = {"robot.py", "responder.py"} - {part}
    assert graded.missing == lacking
    lost = [result.message for result in graded.criteria if not result.marks]
    assert set(lost) == {f"There is no {lacking}."}
    for each in (render_plain_text(build_staff_view(graded)), render_report_page(build_student_view(graded), {})):
        assert f"There is no {lacking}, so" in each
        assert f"Submit {lacking} together with {part}" in each
    assert build_json_document(build_staff_view(graded))["missing"] == lacking


def test_a_responder_is_asked_alike_whenever_it_is_graded(runner: TrialRunner, tmp_path: Path) -> None:
    assignment = find_assignment("echo-responder")
    (tmp_path / "responder.py").write_text("def responder(msg):\n    raise ValueError(msg)\n")
    submission = read_submission(tmp_path, required_parts=assignment.parts)
    first, second = (grade(submission, assignment, runner=runner) for _ in range(2))
    assert [trial.recording.sha256 for trial in first.trials] == [trial.recording.sha256 for trial in second.trials]
    assert "error in the responder; no robot.py" in render_plain_text(build_staff_view(first))


def test_each_criterion_needs_some_part() -> None:
    defaults = {name: schema.model_construct(check=name) for name, schema in SCHEMAS.items()}
    needed = {name: criterion.parts_needed for name, criterion in defaults.items() if name not in ("replies", "source")}
    assert needed["functions"] == {"responder"}
    assert needed["classification"] == {"program", "responder"}
    assert needed["pose"] == {"program"}
    assert all(parts for parts in needed.values())
