"""Planted faults: the search for causes names the line of each, or the noise or the lost messages that it depends on.

``tests/data/planted_faults`` has the faults, and correct solutions that differ from the references.
"""

from __future__ import annotations

import difflib
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from service.grading.grader import grade
from service.grading.reruns.engine import Budget
from service.grading.reruns.grade_causes import add_causes
from service.grading.trial_runner import TrialRunner
from submissions.assignment.examples import read_example
from submissions.assignment.reader import find_assignment
from submissions.submission import Submission

_DATA = Path(__file__).parents[3] / "data" / "planted_faults"
_FAULTS = tomllib.loads((_DATA / "faults.toml").read_text())["fault"]
#: Faults that need few runs, of different kinds.
_QUICK = {"stop-at-second-band", "trace-a-square", "count-bands", "json-queue"}
#: Only runs are limited, because the speed of the machine must not matter.
_BUDGET = Budget(cpu_seconds=1e9, sleep_seconds=1e9)
#: Lines of code on each side of a removed statement that count as its place.
_NEAR = 2
_INGREDIENTS = {"noise": "noise", "loss": "lost"}


def _read_solution(assignment: str, base: str) -> Submission:
    solution = read_example(assignment, "reference")
    if base == "own":
        for path in sorted((_DATA / "solutions" / assignment).glob("*.py")):
            solution = solution.with_source(path.name, path.read_text())
    return solution


def _get_text(submission: Submission, file: str) -> str:
    code = {"robot.py": submission.program, "responder.py": submission.responder}.get(file)
    return (code or submission.python_files[file]).text


def _list_places(old: str, new: str) -> set[int]:
    """Return the lines of the changed text where the fault is."""
    old_lines, new_lines = old.splitlines(), new.splitlines()
    code = [number for number, line in enumerate(new_lines, 1) if line.strip() and not line.strip().startswith("#")]
    places: set[int] = set()
    opcodes = difflib.SequenceMatcher(a=old_lines, b=new_lines, autojunk=False).get_opcodes()
    for tag, _, _, start, end in opcodes:
        if tag == "delete":
            places |= {
                *[each for each in code if each <= start][-_NEAR:],
                *[each for each in code if each > start][:_NEAR],
            }
        elif tag != "equal":
            places |= set(range(start + 1, end + 1))
    return places


def _explain(fault: dict[str, Any], runner: TrialRunner) -> tuple[str, set[tuple[str, int]], set[int]]:
    """Return the sentences, the files and lines that they name, and the lines of the fault."""
    assignment, solution = find_assignment(fault["assignment"]), _read_solution(fault["assignment"], fault["base"])
    text = _get_text(solution, fault["file"])
    assert text.count(fault["old"]) == 1
    changed = text.replace(fault["old"], fault["new"])
    submission = solution.with_source(fault["file"], changed)
    graded = grade(submission, assignment, runner=runner, with_hints=False)
    assert graded.marks < graded.max_marks
    reference = read_example(fault["assignment"], "reference")
    explained = add_causes(graded, submission, assignment, runner, reference=reference, budget=_BUDGET)
    sentences = " ".join(f"{each.text} {each.next_step}" for each in explained.causes)
    named = {(file, int(line)) for line, file in re.findall(r"line (\d+) of (\w+\.py)", sentences)}
    return sentences, named, _list_places(text, changed)


def _build_case(number: int, fault: dict[str, Any]) -> Any:
    is_quick = fault["assignment"] in _QUICK and fault["base"] == "own"
    name = f"{number}-{fault['kind']}-{fault['assignment']}"
    return pytest.param(fault, id=name, marks=() if is_quick else pytest.mark.long)


@pytest.mark.long
@pytest.mark.parametrize("fault", [_build_case(number, each) for number, each in enumerate(_FAULTS, 1)])
def test_the_fault_is_named(fault: dict[str, Any], runner: TrialRunner) -> None:
    sentences, named, places = _explain(fault, runner)
    is_named = any(file == fault["file"] and line in places for file, line in named)
    ingredient = _INGREDIENTS.get(fault.get("right", ""))
    assert is_named or (ingredient is not None and ingredient in sentences), sentences
