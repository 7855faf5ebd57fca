"""A submission is read once: this process parses each text at most once, and decodes each extra file once."""

from __future__ import annotations

import ast
import shutil
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from notebook_builder import notebook
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from submissions import submission as submission_module
from submissions.assignment.examples import locate_examples
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission

ANSWER = "def responder(text):\n    return text"
SHAPES = '%%sim_magic_preloaded -b Simple_Shapes -x 520 -R\nprint("IMG_DATA")'
SENSOR = "%%sim_magic_preloaded\nprint(colorLeft.color)"


@pytest.fixture
def parsed(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Count how often each text is parsed in this process."""
    return counted(monkeypatch, ast, "parse")


def counted(monkeypatch: pytest.MonkeyPatch, module: Any, function: str) -> Counter[str]:
    times: Counter[str] = Counter()
    real = getattr(module, function)

    def counting(text: Any, *more: Any, **named: Any) -> Any:
        times[text] += 1
        return real(text, *more, **named)

    monkeypatch.setattr(module, function, counting)
    return times


def with_own_texts(example: str, folder: Path) -> Path:
    """Return a copy of an example with unique texts that are in no cache."""
    copy = shutil.copytree(locate_examples(example) / "reference", folder / "ada")
    for file in copy.glob("*.py"):
        file.write_text(f"{file.read_text()}\n# in {folder}\n")
    return copy


@pytest.mark.parametrize("example", ["shape-recognition", "parser-agent-and-logger", "relay-a-message"])
def test_a_submission_of_files_is_read_once(
    example: str, parsed: Counter[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, runner: TrialRunner
) -> None:
    assignment = find_assignment(example)
    submission = read_submission(with_own_texts(example, tmp_path), required_parts=assignment.parts)
    decoded = counted(monkeypatch, submission_module, "decode_source")
    grade(submission, assignment, runner=runner)
    own = {text: times for text, times in parsed.items() if str(tmp_path) in text}
    assert set(own.values()) == {1}
    assert set(decoded.values()) <= {1}


def test_a_notebook_is_read_once(parsed: Counter[str], tmp_path: Path, runner: TrialRunner) -> None:
    """Also a robot program that several lines start again."""
    assignment = find_assignment("shape-recognition")
    cells = [ANSWER, SHAPES, f"{SENSOR}  # in {tmp_path}", "%sim_magic -R", "%sim_magic -R"]
    grade(
        read_submission(notebook(tmp_path / "ada.ipynb", cells), required_parts=assignment.parts),
        assignment,
        runner=runner,
    )
    own = {text: times for text, times in parsed.items() if str(tmp_path) in text or ANSWER in text}
    assert len(own) == 2
    assert set(own.values()) == {1}
