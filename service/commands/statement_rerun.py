"""Repetition of the grading that a statement is on, with the seeds in its staff copy."""

from __future__ import annotations

from collections.abc import Iterator

from service.grading.grade import Grade, TrialResult
from service.grading.grader import grade as grade_submission
from service.grading.pools.drawing import PoolExtent
from service.statements.facts import FactKind
from service.statements.statement import Statement
from service.statements.statement_check import Check, collect_values, format_value
from service.statements.statement_file import StatementFile
from service.statements.tick_columns import find_difference
from service.version import GRADER_VERSION, hash_grader
from submissions.assignment.definition import Assignment
from submissions.submission import Submission


def check_rerun(
    file: StatementFile, statement: Statement, submission: Submission, assignment: Assignment
) -> Iterator[Check]:
    """Grade the submission again and yield a check for the assignment, the trials and the marks."""
    stated_assignment = statement.predicate.get("assignment", {})
    if stated_assignment.get("version") != assignment.version:
        yield Check(False, f"the assignment is another version: {assignment.version}")
        return
    yield Check(True, "the assignment is the version that the statement names")
    assert file.seeds is not None
    total = collect_values(file, FactKind.TOTAL).get(1, {})
    extent = PoolExtent.UNTIL_DECIDED if total.get("provisional") else PoolExtent.WHOLE
    grade = grade_submission(submission, assignment, secret=file.seeds, extent=extent)
    differences = [*_find_trial_differences(file, grade), *_find_marks_differences(file, grade)]
    stated_grader = statement.predicate.get("grader", {}).get("sha256")
    other_code = (
        f"; the code or the libraries are others here (Robomark {GRADER_VERSION})"
        if differences and stated_grader != hash_grader()
        else ""
    )
    for difference in differences:
        yield Check(False, difference + other_code)
    if not differences:
        yield Check(True, f"{len(grade.trials)} trials, run again, have the same recordings and give the same marks")


def _find_trial_differences(file: StatementFile, grade: Grade) -> Iterator[str]:
    stated_trials = collect_values(file, FactKind.TRIAL)
    if len(stated_trials) != len(grade.trials):
        yield f"the statement has {len(stated_trials)} trials, and the repetition {len(grade.trials)}"
    for number, trial in enumerate(grade.trials, 1):
        stated = stated_trials.get(number)
        if stated is not None and stated.get("recording_sha256") != trial.recording.sha256:
            yield f"trial {number} ({trial.scenario} {trial.index}) differs{_describe_first(file, number, trial)}"


def _describe_first(file: StatementFile, number: int, trial: TrialResult) -> str:
    """Return the first tick and field that differ, if the file has the ticks of the trial."""
    columns = file.columns.get(number)
    if columns is None:
        return ""
    difference = find_difference(columns, trial.recording.ticks)
    if difference is None:
        return ": all ticks are equal, but printed texts, messages or the end of the program are not"
    return (
        f" first at tick {difference.tick} ({difference.seconds:.3f} s) in {difference.column}: "
        f"{difference.before} stated, {difference.after} now"
    )


def _find_marks_differences(file: StatementFile, grade: Grade) -> Iterator[str]:
    """Yield the criteria whose marks differ or are on one side only. Marks that staff set are not compared."""
    kinds = (FactKind.CRITERION, FactKind.HIDDEN_CRITERION)
    stated_criteria = {str(value.get("id")): value for kind in kinds for value in collect_values(file, kind).values()}
    for result in grade.criteria:
        stated = stated_criteria.pop(result.id, None)
        marks = f"{result.marks.normalize():f}"
        if stated is None:
            yield f"{result.title}: no marks stated, {marks} now"
        elif not stated.get("set_by_staff") and marks != stated.get("marks"):
            yield f"{result.title}: {format_value(stated.get('marks'))} marks stated, {marks} now"
    for stated in stated_criteria.values():
        yield f"{format_value(stated.get('title'))}: {format_value(stated.get('marks'))} marks stated, none now"
