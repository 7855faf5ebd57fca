"""Grade the examples of one assignment or of the whole catalogue, and submissions without effort.

``grading/example_check.py`` compares the examples with the expected results. ``grading/no_effort.py`` has the
submissions without effort.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from rich.progress import track

from service.commands.assignments.arguments import format_count
from service.commands.example_tables import (
    build_catalogue_table,
    build_examples_table,
    build_measures_table,
    build_no_effort_table,
)
from service.commands.mutant_tables import build_catalogue_mutant_tables, build_mutant_tables
from service.commands.output import create_progress_console, print_json, print_line, print_note, print_renderables
from service.commands.statistics_tables import build_statistics
from service.grading.class_statistics import compute_statistics
from service.grading.example_check import CheckedAssignment, check_examples
from service.grading.no_effort import grade_without_effort
from service.grading.trial_runner import TrialRunner
from service.home import user_permissions
from service.mutation.mutant_check import MAX_UNEXPLAINED_SHARE, MutantCheck, check_mutants
from service.mutation.survivor_reasons import SURVIVORS
from sim.errors import AssignmentError
from submissions.assignment.examples import EXAMPLES, EXPECTED, add_expected
from submissions.assignment.folder import FILE_NAME, REFERENCE, list_catalogue_ids


def check_assignments(assignment: str | None, *, write_expected: bool, mutant_limit: int = 0) -> None:
    """Check one assignment, or the whole catalogue if ``assignment`` is None.

    Args:
        assignment: Catalogue id or folder of the assignment.
        write_expected: Write the results of examples without expectations as their expectations.
        mutant_limit: The largest number of mutants of each reference to grade.

    Raises:
        AssignmentError: Lists everything that differs from the expectations.
    """
    with TrialRunner() as runner:
        if assignment is not None:
            checked_assignments = [_check_assignment(assignment, runner)]
            if write_expected:
                checked_assignments = [_write_expectations(assignment, checked_assignments[0])]
            _show_checked(checked_assignments[0])
        else:
            names = track(list_catalogue_ids(), "grading", transient=True, console=create_progress_console())
            checked_assignments = [_check_assignment(name, runner) for name in names]
            print_renderables(build_catalogue_table(checked_assignments))
        mutant_checks = _check_mutants(
            [assignment] if assignment is not None else list_catalogue_ids(), mutant_limit, runner
        )
    statistics = compute_statistics(
        example.marked for each in checked_assignments for example in each.examples if example.marked
    )
    if assignment is not None:
        print_renderables(*build_statistics(statistics))
        print_renderables(*itertools.chain.from_iterable(map(build_mutant_tables, mutant_checks)))
    elif mutant_checks:
        print_renderables(*build_catalogue_mutant_tables(mutant_checks))
    for mutant_check in mutant_checks:
        _print_mutant_notes(mutant_check)
    documents = [_checked_to_json(each) for each in checked_assignments]
    for document, mutant_check in zip(documents, mutant_checks, strict=False):
        document["mutants"] = _mutants_to_json(mutant_check)
    print_json(assignments=documents, statistics=statistics)
    for checked_assignment in checked_assignments:
        for warning in checked_assignment.warnings:
            print_note(f"robomark: {checked_assignment.assignment.id}: {warning}")
    problems = [f"{each.assignment.id}: {problem}" for each in checked_assignments for problem in each.problems]
    if problems:
        raise AssignmentError("\n".join(problems))
    if assignment is None:
        count = sum(len(each.examples) for each in checked_assignments)
        print_line(f"{len(checked_assignments)} assignments, {count} examples: all as expected")


def _check_assignment(name: str, runner: TrialRunner) -> CheckedAssignment:
    checked = check_examples(name, runner=runner)
    return replace(checked, no_effort=grade_without_effort(name, checked.assignment, runner=runner))


def _check_mutants(assignments: Sequence[str], limit: int, runner: TrialRunner) -> list[MutantCheck]:
    """Return the results of the mutants of each assignment; empty if the limit is 0."""
    names = track(assignments, "grading mutants", transient=True, console=create_progress_console())
    return [check_mutants(name, limit, runner=runner) for name in names] if limit else []


def _print_mutant_notes(check: MutantCheck) -> None:
    if check.problem:
        print_note(f"robomark: {check.assignment}: no mutants were graded: {check.problem}")
    if check.ungraded:
        print_note(f"robomark: {check.assignment}: {check.ungraded} mutants were not graded: no CPU time was left")
    if check.unexplained_share > MAX_UNEXPLAINED_SHARE:
        print_note(
            f"robomark: {check.assignment}: {check.unexplained_share:.0%} of the mutants that behave differently keep "
            f"full marks without a reason, expected at most {MAX_UNEXPLAINED_SHARE:.0%}"
        )
    for reason in check.stale_reasons:
        print_note(f"robomark: {check.assignment}: {SURVIVORS} has a reason without a survivor: {reason.reason}")


def _mutants_to_json(check: MutantCheck) -> dict[str, Any]:
    """Return the JSON value for the mutants of an assignment."""
    return {
        "operators": check.counts,
        "ungraded": check.ungraded,
        "survivors": [
            {"operator": each.mutant.operator, "file": each.mutant.file, "line": each.mutant.line,
             "old": each.mutant.old, "new": each.mutant.new, "reason": each.reason}
            for each in check.survivors
        ],
        "unexplained_share": round(check.unexplained_share, 4),
        "stale_reasons": [each.reason for each in check.stale_reasons],
        "problem": check.problem,
    }  # fmt: skip


def _checked_to_json(checked: CheckedAssignment) -> dict[str, Any]:
    """Return the JSON value for an assignment and its examples."""
    return {
        "id": checked.assignment.id,
        "version": checked.assignment.version,
        "marks": checked.assignment.max_marks,
        "examples": [
            {"name": each.name, "marks": each.marks, "loses": each.lost, "seconds": each.seconds,
             "problems": each.problems}
            for each in checked.examples
        ],
        "measures": [
            {"measure": each.original.measure, "value": each.value, "original": each.original.value,
             "unit": each.unit, "agrees": each.is_close}
            for each in checked.measures
        ],
        "no_effort": [
            {"name": each.name, "marks": each.marks, "share": round(each.share, 4), "problem": each.problem}
            for each in checked.no_effort
        ],
        "problems": checked.problems,
        "warnings": checked.warnings,
    }  # fmt: skip


def _write_expectations(assignment: str, checked: CheckedAssignment) -> CheckedAssignment:
    """Write the missing expectations to a file for review, and return the check result with them."""
    if not checked.missing_expectations:
        print_line(f"{EXPECTED} has a table for every example: no changes")
        return checked
    with user_permissions():
        path = add_expected(assignment, checked.missing_expectations)
    print_line(
        f"{path}: results of {', '.join(checked.missing_expectations)} written; check that they are the expected ones"
    )
    return checked.as_written()


def _show_checked(checked: CheckedAssignment) -> None:
    assignment = checked.assignment
    criteria = format_count(len(assignment.criteria), "criterion", "criteria")
    trials = format_count(assignment.trial_count, "trial", "trials")
    print_line(
        f"{assignment.id}: no problems; {criteria}, {assignment.max_marks:g} marks, {trials} (version "
        f"{assignment.version[:12]})"
    )
    if checked.examples:
        print_renderables(build_examples_table(checked))
    else:
        print_line(f"no examples to grade: expected {EXAMPLES}/{REFERENCE} beside {FILE_NAME}")
    if checked.measures:
        print_renderables(build_measures_table(checked))
    print_renderables(build_no_effort_table(checked))
