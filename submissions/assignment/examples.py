"""Example submissions of an assignment and their expected results: ``examples/`` and ``expected.toml``.

Examples have the format of ordinary submissions. With ``like``, an example uses the files of another and contains only
the differences.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from decimal import Decimal
from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator, Field, ValidationError

from sim.errors import UsageError
from sim.recording import Verdict
from submissions.assignment.definition import Assignment
from submissions.assignment.folder import REFERENCE, list_catalogue_ids, locate_assignment_folder
from submissions.assignment.problems import AssignmentProblems, Problems, find_lines
from submissions.assignment.reader import find_assignment, find_in_catalogue, parse_toml
from submissions.assignment.schema import Slug
from submissions.assignment.table_problems import describe_problem
from submissions.bundle import build_submission, read_submission
from submissions.raw_files import RawFiles, read_folder
from submissions.strict_table import StrictTable
from submissions.submission import Submission

EXAMPLES = "examples"
EXPECTED = "expected.toml"


_Marks = Annotated[Decimal, BeforeValidator(str)]


class ExpectedResult(StrictTable):
    """Expected result of an example. ``loses`` lists exactly the ids of the criteria without full marks.

    ``earns`` gives the marks of single criteria by id.
    """

    marks: _Marks
    like: Annotated[str, Slug] = ""  # the example whose files it also uses
    verdict: Verdict = Verdict.FINISHED
    loses: tuple[str, ...] | None = None
    earns: dict[str, _Marks] = Field(default_factory=dict)
    feedback: tuple[str, ...] = ()  # each must occur in the feedback


class OriginalMeasure(StrictTable):
    """A measured value of a program in the original simulator, compared with the reference's measure of this name."""

    measure: str
    value: float
    within: float = Field(default=0.01, ge=0)  # of the value
    explained: str = ""  # reason for a larger deviation


class ExpectedResults(StrictTable):
    """The file ``expected.toml``: a table for each example, and the values measured in the original."""

    examples: dict[str, ExpectedResult]
    original: tuple[OriginalMeasure, ...] = ()


def locate_examples(assignment: str) -> Path:
    """Return the folder with the example submissions of an assignment.

    Raises:
        UsageError: There are no examples.
    """
    folder = locate_assignment_folder(assignment) / EXAMPLES
    if not folder.is_dir():
        raise UsageError(f"There are no examples for {assignment!r}, expected the folder {folder}.")
    return folder


def locate_catalogue_reference(assignment: Assignment) -> Path | None:
    """Return the folder of the catalogue's reference solution; None if the assignment is another version."""
    if assignment.id not in list_catalogue_ids() or find_in_catalogue(assignment.id).version != assignment.version:
        return None
    folder = locate_assignment_folder(assignment.id) / EXAMPLES / REFERENCE
    return folder if folder.is_dir() else None


def read_expected(assignment: str) -> ExpectedResults:
    """Read the expected results of an assignment's examples; empty without the file.

    Raises:
        AssignmentProblems: The file cannot be used. The error lists all mistakes.
    """
    path = locate_assignment_folder(assignment) / EXPECTED
    if not path.is_file():
        return ExpectedResults(examples={})
    source_name = f"{path.parent.name}/{path.name}"
    try:
        text, document = parse_toml(path.read_bytes(), source_name)
        original = document.pop("original", [])
        return ExpectedResults.model_validate({"examples": document, "original": original})
    except ValidationError as error:
        problems = Problems(source_name, find_lines(text))
        for details in error.errors(include_url=False):
            part, key, *key_path = (*details["loc"], "", "")
            schema, table_path = (OriginalMeasure, (part, key)) if part == "original" else (ExpectedResult, (key,))
            problem = describe_problem(schema, {**details, "loc": tuple(each for each in key_path if each != "")})
            problems.add((*table_path, *problem.path), problem.sentence)
        raise AssignmentProblems(problems.sorted()) from error


def read_example(assignment: str, name: str) -> Submission:
    """Read the example ``name`` of an assignment, including the files of the example in its ``like``.

    Raises:
        UsageError: As for ``read_submission``.
        AssignmentProblems: As for ``expected``.
    """
    required_parts = find_assignment(assignment).parts
    folder = locate_examples(assignment)
    expected = read_expected(assignment).examples.get(name)
    if expected is None or not expected.like:
        return read_submission(folder / name, required_parts=required_parts)
    shared_files, own_files = read_folder(folder / expected.like), read_folder(folder / name)
    files = RawFiles({**shared_files.files, **own_files.files}, (*shared_files.notes, *own_files.notes))
    return build_submission(files, name, name, EXAMPLES, required_parts)


def add_expected(assignment: str, new: Mapping[str, ExpectedResult]) -> Path:
    """Append a table for each of these examples to ``expected.toml``, and create the file if necessary.

    The existing text does not change.

    Raises:
        UsageError: An example has a table already.
    """
    known_results = read_expected(assignment).examples
    repeated_names = [name for name in new if name in known_results]
    if repeated_names:
        raise UsageError(f"{repeated_names[0]} has a table in {EXPECTED} already, expected an example without one.")
    path = locate_assignment_folder(assignment) / EXPECTED
    old_text = path.read_text(encoding="utf-8").rstrip() if path.is_file() else ""
    tables = [_format_table(name, wanted) for name, wanted in new.items()]
    path.write_text("\n\n".join(filter(None, (old_text, *tables))) + "\n", encoding="utf-8")
    return path


def _format_table(name: str, expected: ExpectedResult) -> str:
    lines = [f"[{_format_key(name)}]", f'marks = "{expected.marks}"']
    if expected.verdict is not Verdict.FINISHED:
        lines.append(f'verdict = "{expected.verdict}"')
    lines.append(f"loses = [{', '.join(map(_quote_text, expected.loses or ()))}]")
    if expected.earns:
        earned_marks = ", ".join(f'{_format_key(each)} = "{marks}"' for each, marks in expected.earns.items())
        lines.append(f"earns = {{ {earned_marks} }}")
    return "\n".join(lines)


def _format_key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _quote_text(name)


def _quote_text(text: str) -> str:
    # TOML basic strings have the same escapes as JSON strings.
    return json.dumps(text, ensure_ascii=False)
