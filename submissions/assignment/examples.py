"""The example submissions beside an assignment, and what each is expected to get: ``examples/`` and ``expected.toml``.

They are submissions like any other: nothing here reads or grades them.
"""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator, Field, ValidationError

from sim.errors import UsageError
from sim.recording import Verdict
from submissions.assignment.folder import assignment_folder
from submissions.assignment.problems import AssignmentProblems, Problems
from submissions.assignment.reader import parse
from submissions.assignment.schema import problem_of
from submissions.assignment.toml_lines import find_lines
from submissions.strict_table import StrictTable

EXAMPLES = "examples"
EXPECTED = "expected.toml"
#: The example that must get full marks.
REFERENCE = "reference"


class Expectation(StrictTable):
    """What an example must get. ``loses`` are the ids of the criteria, no more and no fewer, without full marks."""

    marks: Annotated[Decimal, BeforeValidator(str)]
    verdict: Verdict = Verdict.FINISHED
    loses: tuple[str, ...] | None = None
    feedback: tuple[str, ...] = ()  # each must be in what the student is told


class OriginalMeasure(StrictTable):
    """What a program reached in the original simulator, beside the reference's measure of that name."""

    measure: str
    value: float
    within: float = Field(default=0.01, ge=0)  # of the value
    explained: str = ""  # why ours may be further away


class Expected(StrictTable):
    """The file ``expected.toml``: a table for each example, and the original's measures."""

    examples: dict[str, Expectation]
    original: tuple[OriginalMeasure, ...] = ()


def examples(assignment: str) -> Path:
    """The folder with the example submissions of an assignment. Raises UsageError if there are none."""
    folder = assignment_folder(assignment) / EXAMPLES
    if not folder.is_dir():
        raise UsageError(f"There are no examples for {assignment!r}, expected the folder {folder}.")
    return folder


def expected(assignment: str) -> Expected:
    """What the examples of an assignment must get; empty without the file.

    Raises AssignmentProblems, with all mistakes, where the file cannot be used.
    """
    path = assignment_folder(assignment) / EXPECTED
    if not path.is_file():
        return Expected(examples={})
    where = f"{path.parent.name}/{path.name}"
    try:
        text, document = parse(path.read_bytes(), where)
        original = document.pop("original", [])
        return Expected.model_validate({"examples": document, "original": original})
    except ValidationError as error:
        problems = Problems(where, find_lines(text))
        for details in error.errors(include_url=False):
            part, which, *rest = (*details["loc"], "", "")
            schema, place = (OriginalMeasure, (part, which)) if part == "original" else (Expectation, (which,))
            problem = problem_of(schema, {**details, "loc": tuple(each for each in rest if each != "")})
            problems.add((*place, *problem.path), problem.sentence)
        raise AssignmentProblems(problems.sorted()) from error
