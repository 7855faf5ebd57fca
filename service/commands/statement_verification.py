"""``robomark verify FILE``: check a statement or receipt, and with the staff copy repeat the grading that it is on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from service.commands.input_files import read_input_file
from service.commands.output import print_json, print_line
from service.statements.facts import FactKind
from service.statements.keys import PublicKey
from service.statements.statement_check import (
    Check,
    CheckedStatement,
    check_statement,
    check_submission,
    collect_values,
    format_value,
)
from service.statements.statement_file import MAX_FILE_BYTES, StatementFile, parse_statement_file
from sim.errors import HostError, UsageError


@dataclass(frozen=True, slots=True)
class VerificationOptions:
    """What a statement is checked against besides itself: public keys, submission, assignment; None: not."""

    keys: Path | None
    submission: Path | None
    assignment: str | None


def verify_file(path: Path, options: VerificationOptions) -> None:
    """Check a statement or receipt, and repeat its grading if submission and assignment are given.

    Raises UsageError for files that cannot be read, HostError if a check fails.
    """
    if options.assignment is not None and options.submission is None:
        raise UsageError("--assignment needs --submission too, because the grading is repeated with both")
    content, keys = read_input_file(path, MAX_FILE_BYTES), _read_keys(options.keys)
    try:
        file = parse_statement_file(content)
        checked = check_statement(file, keys)
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from None
    checks = [*checked.checks, *_check_against_files(file, checked, options)]
    statement = checked.statement
    print_json(
        type=statement.predicate_type.value,
        predicate={name: value for name, value in statement.predicate.items() if name != "commitments"},
        subjects=dict(statement.subjects),
        facts=[each.to_json() for each in file.facts],
        checks=checks,
        passed=all(check.passed for check in checks),
    )
    for line in _describe(file, checked):
        print_line(line)
    for check in checks:
        print_line(f"{'ok    ' if check.passed else 'FAILED'} {check.sentence}")
    if not all(check.passed for check in checks):
        raise HostError(f"{path}: {sum(not check.passed for check in checks)} checks failed")


def _read_keys(path: Path | None) -> tuple[PublicKey, ...]:
    from service.statements.keys import MAX_FILE_BYTES as MAX_KEYS_BYTES
    from service.statements.keys import parse_keys

    if path is None:
        return ()
    content = read_input_file(path, MAX_KEYS_BYTES)
    try:
        keys = parse_keys(content)
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from None
    if not keys:
        raise UsageError(f"{path}: all its keys are revoked")
    return keys


def _describe(file: StatementFile, checked: CheckedStatement) -> list[str]:
    """Return the content as lines: who, what, and the marks as far as the file has them."""
    predicate = checked.statement.predicate
    names = ("change", "course", "student", "attempt", "submitted_at", "published_at", "issued_at", "grade")
    lines = [
        f"{name.replace('_', ' ')}: {format_value(predicate[name])}"
        for name in names
        if predicate.get(name) is not None
    ]
    assignment = predicate.get("assignment")
    if isinstance(assignment, dict):
        lines.append(
            f"assignment: {format_value(assignment.get('id'))}, version {format_value(assignment.get('version'))}"
        )
    for value in collect_values(file, FactKind.CRITERION).values():
        lines.append(f"{format_value(value.get('title'))}: {_format_marks(value)}")
    for value in collect_values(file, FactKind.TOTAL).values():
        status = ", provisional" if value.get("provisional") else ""
        lines.append(f"total: {_format_marks(value)}{status}")
    return lines


def _format_marks(value: Mapping[str, Any]) -> str:
    return f"{format_value(value.get('marks'))} of {format_value(value.get('max_marks'))}"


def _check_against_files(
    file: StatementFile, checked: CheckedStatement, options: VerificationOptions
) -> Sequence[Check]:
    if options.submission is None:
        return ()
    from submissions.assignment.reader import find_assignment
    from submissions.bundle import read_submission

    if options.assignment is None:
        return (check_submission(checked.statement, read_submission(options.submission)),)
    assignment = find_assignment(options.assignment)
    submission = read_submission(options.submission, required_parts=assignment.parts)
    submission_check = check_submission(checked.statement, submission)
    if file.seeds is None or not submission_check.passed or not checked.passed:
        reason = "" if file.seeds is not None else "the file has no seeds; ask staff for their copy"
        return (submission_check, *([Check(False, reason)] if reason else ()))
    # Grading loads the simulator.
    from service.commands.statement_rerun import check_rerun

    return (submission_check, *check_rerun(file, checked.statement, submission, assignment))
