"""Grade the examples of one assignment or of the whole catalogue, and compare the results with the expected ones.

``grading/example_check.py`` does the grading.
"""

from __future__ import annotations

from typing import Any

from rich.progress import track

from service.commands.assignments.which import count_words
from service.commands.example_table import catalogue_table, examples_table, measures_table
from service.commands.shown import document, note, progress, show, tell
from service.commands.statistics_shown import statistics_parts
from service.grading.example_check import CheckedAssignment, check_examples
from service.grading.statistics import statistics_of
from service.grading.trial_runner import TrialRunner
from service.home import for_the_user
from sim.errors import AssignmentError
from submissions.assignment.examples import EXAMPLES, EXPECTED, add_expected
from submissions.assignment.folder import FILE_NAME, REFERENCE, catalogue


def check(assignment: str | None, *, write_expected: bool) -> None:
    """Check one assignment, or the whole catalogue if ``assignment`` is None.

    Args:
        assignment: Catalogue id or folder of the assignment.
        write_expected: Write the results of examples without expectations as their expectations.

    Raises:
        AssignmentError: Lists everything that differs from the expectations.
    """
    with TrialRunner() as runner:
        if assignment is not None:
            checked = [check_examples(assignment, runner=runner)]
            if write_expected:
                checked = [_noted(assignment, checked[0])]
            _show(checked[0])
        else:
            names = track(catalogue(), "grading", transient=True, console=progress())
            checked = [check_examples(name, runner=runner) for name in names]
            show(catalogue_table(checked))
    statistics = statistics_of(example.marked for each in checked for example in each.examples if example.marked)
    if assignment is not None:
        show(*statistics_parts(statistics))
    document(assignments=list(map(_told, checked)), statistics=statistics)
    for each in checked:
        for warning in each.warnings:
            note(f"robomark: {each.assignment.id}: {warning}")
    problems = [f"{each.assignment.id}: {problem}" for each in checked for problem in each.problems]
    if problems:
        raise AssignmentError("\n".join(problems))
    if assignment is None:
        count = sum(len(each.examples) for each in checked)
        tell(f"{len(checked)} assignments, {count} examples: all as expected")


def _told(checked: CheckedAssignment) -> dict[str, Any]:
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
             "unit": each.unit, "agrees": each.agrees}
            for each in checked.measures
        ],
        "problems": checked.problems,
        "warnings": checked.warnings,
    }  # fmt: skip


def _noted(assignment: str, checked: CheckedAssignment) -> CheckedAssignment:
    """Write the missing expectations to a file for review, and return the check result with them."""
    if not checked.unwritten:
        tell(f"{EXPECTED} has a table for every example: no changes")
        return checked
    with for_the_user():
        path = add_expected(assignment, checked.unwritten)
    tell(f"{path}: results of {', '.join(checked.unwritten)} written; check that they are the expected ones")
    return checked.written()


def _show(checked: CheckedAssignment) -> None:
    found = checked.assignment
    criteria = count_words(len(found.criteria), "criterion", "criteria")
    trials = count_words(found.trial_count, "trial", "trials")
    tell(f"{found.id}: no problems; {criteria}, {found.max_marks:g} marks, {trials} (version {found.version[:12]})")
    if checked.examples:
        show(examples_table(checked))
    else:
        tell(f"no examples to grade: expected {EXAMPLES}/{REFERENCE} beside {FILE_NAME}")
    if checked.measures:
        show(measures_table(checked))
