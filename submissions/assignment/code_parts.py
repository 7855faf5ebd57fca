"""What has to fit together in criteria about code: files that are there, parts that are submitted, runs to judge.

What a single criterion may hold is its schema's.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from sim.errors import UsageError
from submissions.assignment.problems import Problems
from submissions.assignment.schema import PartsTable
from submissions.assignment.toml_lines import Path as Place
from submissions.criteria import Criterion
from submissions.criteria.code import Functions, PythonCheck, SourceRules
from submissions.criteria.timing import Ranking
from submissions.source_text import decode_source


def runs_no_robot(document: Mapping[str, object]) -> bool:
    """Whether the assignment has neither scenarios nor a program: only functions and texts are looked at."""
    parts = document.get("parts")
    return isinstance(parts, dict) and parts.get("program") == "none" and "scenario" not in document


def check_code(
    criterion: Criterion,
    parts: PartsTable | None,
    robotless: bool,
    files: Iterable[str],
    place: Place,
    problems: Problems,
) -> None:
    """Names what a criterion asks for that the assignment does not have."""
    if isinstance(criterion, PythonCheck) and criterion.file not in files:
        problems.add((*place, "file"), f'file is "{criterion.file[:60]}", expected a .py file beside this file')
    if robotless and not isinstance(criterion, SourceRules | Functions):
        problems.add(
            (*place, "check"),
            'check judges a run of the robot, but there is no scenario and parts has program = "none", '
            'expected "functions" or "source"',
        )
    if parts is None:
        return
    asked = "program" if isinstance(criterion, SourceRules) and criterion.part == "program" else "responder"
    if isinstance(criterion, SourceRules | Functions) and getattr(parts, asked) == "none":
        key = "part" if isinstance(criterion, SourceRules) else "check"
        problems.add((*place, key), f'{key} looks at the {asked}, but parts has {asked} = "none", expected one')


def check_given(document: Mapping[str, object], checks: Iterable[str], problems: Problems) -> None:
    """Names files that would hand the answers to students: checks, places, and what describes the assignment."""
    criteria = document.get("criterion")
    tables = [table for table in criteria if isinstance(table, dict)] if isinstance(criteria, list) else []
    answers: set[object] = {table["places"] for table in tables if isinstance(table.get("places"), str)}
    answers |= {*checks, "assignment.toml", "expected.toml"}
    given = document.get("given")
    for number, name in enumerate(given if isinstance(given, list) else []):
        if isinstance(name, str) and name in answers:
            problems.add(
                ("given", number), f'given names "{name[:60]}", which holds answers, expected what students may read'
            )


def check_ranks(criteria: Iterable[Criterion], problems: Problems) -> None:
    """Names ranks of figures that no other criterion measures."""
    known = {criterion.id for criterion in criteria if not isinstance(criterion, Ranking)}
    for number, criterion in enumerate(criteria):
        if isinstance(criterion, Ranking) and criterion.of not in known:
            problems.add(
                ("criterion", number, "of"), f'of is "{criterion.of[:60]}", expected the id of another criterion'
            )


def check_sources(criteria: Iterable[Criterion], files: Mapping[str, bytes], problems: Problems) -> dict[str, str]:
    """The texts of the instructor's checks, by file name."""
    sources = {}
    for criterion in criteria:
        if isinstance(criterion, PythonCheck) and criterion.file in files:
            try:
                sources[criterion.file] = decode_source(files[criterion.file], criterion.file).text
            except UsageError as error:
                problems.add(("criterion",), str(error).rstrip("."))
    return sources
