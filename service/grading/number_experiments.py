"""Runs of a submission with one number of its programs changed, within a budget of trials and CPU seconds.

``number_search.py`` decides which numbers to try.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from decimal import Decimal

from service.grading.grade import CriterionResult, Grade
from service.grading.grader import grade
from service.grading.number_roles import Direction, NumberRole, find_direction
from service.grading.pools.drawing import PoolExtent
from service.grading.program_numbers import ProgramNumber
from service.grading.trial_runner import TrialRunner
from service.grading.trial_selection import PartialAssignment, needs_every_trial, select_trials
from service.mutation.source_tree import SourceTree
from sim.errors import UsageError
from submissions.assignment.definition import Assignment
from submissions.criteria import AnyCriterion
from submissions.seeds import SeedSource
from submissions.submission import PART_FILES, SECOND_PROGRAM, Submission


@dataclass(frozen=True, slots=True)
class SearchBudget:
    """The largest number of trials to run, and of CPU seconds of all processes."""

    runs: int = 300
    cpu_seconds: float = 20.0


class BudgetSpent(Exception):
    """The next run would exceed the budget."""


@dataclass(frozen=True, slots=True)
class NumberChange:
    """A change of one number with which the program passes. ``marks`` are those of the whole changed submission."""

    file: str
    line: int
    column: int  # from 1
    old: str
    new: str
    role: NumberRole
    direction: Direction
    distance: float  # relative to the old number; the absolute value of the new one if the old one is 0
    marks: Decimal
    is_alone_on_line: bool = True  # the line has no other number


@dataclass(frozen=True, slots=True)
class NumberTrial:
    """The outcome with a changed number: whether it passes, the met part of the criterion, hashes of recordings."""

    passes: bool
    score: float
    recordings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class GradedCriterion:
    """A criterion that lost marks, with the grading to repeat."""

    submission: Submission
    assignment: Assignment
    graded: Grade
    criterion: AnyCriterion
    runner: TrialRunner
    secret: SeedSource
    extent: PoolExtent


def read_student_files(submission: Submission, assignment: Assignment) -> dict[str, SourceTree]:
    """Return the files of the student's parts by name, without those that are not Python."""
    trees = {}
    for file, text in _list_texts(submission, assignment):
        with suppress(UsageError):
            trees[file] = SourceTree(text)
    return trees


def _list_texts(submission: Submission, assignment: Assignment) -> Iterator[tuple[str, str]]:
    """Yield the files of the student's parts by name, the robot's program first."""
    parts = assignment.parts
    if submission.program is not None and parts.program == "student":
        yield PART_FILES["program"], submission.program.text
    if submission.responder is not None and parts.responder == "student":
        yield PART_FILES["responder"], submission.responder.text
    agents = {f"{name}.py" for name, source in parts.agents.items() if source == "student"}
    for name, source in submission.python_files.items():
        if name in agents or (name == SECOND_PROGRAM and parts.second_program == "student"):
            yield name, source.text


class NumberExperiments:
    """Runs changed programs within the budget. The first failing trial of the criterion comes first."""

    def __init__(self, case: GradedCriterion, budget: SearchBudget) -> None:
        self.case, self.budget = case, budget
        self.runs = 0
        self._cpu_start = self._measure_cpu()
        self._outcomes: dict[tuple[int, str], NumberTrial] = {}
        experiment = replace(case.assignment, criteria=_select_criteria(case.assignment, case.criterion))
        keys = [
            (each.scenario, each.index)
            for each in case.graded.trials
            if not case.criterion.scenarios or each.scenario in case.criterion.scenarios
        ]
        result = self._find_result(case.graded)
        failure = next((each.trial for each in result.evidence if not each.passed), None)
        first_keys = keys
        if failure is not None and needs_every_trial(case.criterion, case.assignment):
            trial = case.graded.trials[failure]
            first_keys = [(trial.scenario, trial.index)]
        self._first = select_trials(experiment, first_keys)
        self._others = select_trials(experiment, set(keys) - set(first_keys))
        self.unchanged = self._run(case.submission)

    @property
    def cpu_seconds(self) -> float:
        """The CPU seconds used so far."""
        return self._measure_cpu() - self._cpu_start

    def try_value(self, number: ProgramNumber, value: float) -> NumberTrial:
        """Run the submission with another number. Raises BudgetSpent."""
        key = number.index, number.format_value(value)
        if key not in self._outcomes:
            self._outcomes[key] = self._run(self._change(number, value))
        return self._outcomes[key]

    def build_change(self, number: ProgramNumber, value: float) -> NumberChange | None:
        """Grade the whole changed submission. Return the change, or None if it loses marks for the criterion.

        Raises:
            BudgetSpent: The trials would exceed the budget.
        """
        text = number.format_value(value)
        case = self.case
        graded = self._grade(self._change(number, value), case.assignment, len(case.graded.trials))
        result = self._find_result(graded)
        if result.marks < result.max_marks:
            return None
        new_value = float(text)
        return NumberChange(
            number.file,
            number.line,
            number.column,
            number.old,
            text,
            number.role,
            find_direction(number.value, new_value, number.role),
            abs(new_value - number.value) / (abs(number.value) or 1),
            graded.marks,
            number.is_alone_on_line,
        )

    def _run(self, submission: Submission) -> NumberTrial:
        graded = self._grade(submission, self._first, len(self._first.selected))
        result = self._find_result(graded)
        passes = result.marks >= result.max_marks
        if passes and self._others.selected:
            other_result = self._find_result(self._grade(submission, self._others, len(self._others.selected)))
            passes = other_result.marks >= other_result.max_marks
        recordings = tuple(each.recording.sha256 for each in graded.trials)
        return NumberTrial(passes, float(result.marks / result.max_marks), recordings)

    def _change(self, number: ProgramNumber, value: float) -> Submission:
        return self.case.submission.with_source(number.file, number.change_text(value))

    def _find_result(self, graded: Grade) -> CriterionResult:
        return next(each for each in graded.criteria if each.id == self.case.criterion.id)

    def _grade(self, submission: Submission, assignment: Assignment | PartialAssignment, trials: int) -> Grade:
        trials = max(trials, 1)  # calls of functions count as a run
        if self.runs + trials > self.budget.runs or self.cpu_seconds >= self.budget.cpu_seconds:
            raise BudgetSpent
        case = self.case
        graded = grade(
            submission, assignment, secret=case.secret, runner=case.runner, extent=case.extent, with_hints=False
        )
        self.runs += max(len(graded.trials), 1)
        return graded

    def _measure_cpu(self) -> float:
        return time.process_time() + self.case.runner.children_cpu_seconds


def _select_criteria(assignment: Assignment, criterion: AnyCriterion) -> tuple[AnyCriterion, ...]:
    """Return the criterion, and the one that it ranks. Its marks show how much of it is met, where this is possible."""
    if needs_every_trial(criterion, assignment):
        criterion = criterion.model_copy(update={"over": "mean"})
    needed = [each for each in assignment.criteria if each.id == criterion.result_needed]
    return (*needed, criterion)
