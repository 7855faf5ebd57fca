"""Grading of an assignment's example submissions, and comparison with the expected results.

This is how an assignment is tested: the reference must get full marks, and each wrong solution must lose the expected
ones. The module prints nothing.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from decimal import Decimal

from service.grading.class_statistics import MarkedSubmission, to_marked_submission
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.guessable_reports import find_guessable_reports
from service.grading.judging.message_parts import describe_fault
from service.grading.no_effort import NoEffortResult
from service.grading.trial_runner import TrialRunner
from sim.errors import UsageError
from sim.recording_values import collect_faults
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import (
    EXPECTED,
    ExpectedResult,
    OriginalMeasure,
    locate_examples,
    read_example,
    read_expected,
)
from submissions.assignment.folder import REFERENCE
from submissions.assignment.reader import find_assignment


@dataclass(frozen=True, slots=True)
class ExampleResult:
    """The result of one example. ``problems`` has one sentence for each difference from the expected result.

    ``missing_expectation`` is the entry that ``expected.toml`` does not have yet.
    """

    name: str
    marks: Decimal | None  # None if it was rejected
    lost: tuple[str, ...]  # ids of the criteria without full marks
    seconds: float  # real time
    problems: tuple[str, ...]
    missing_expectation: ExpectedResult | None = None
    marked: MarkedSubmission | None = None  # for statistics; None if it was rejected


@dataclass(frozen=True, slots=True)
class ComparedMeasure:
    """A measure of the reference solution, compared with the value from the original simulator."""

    original: OriginalMeasure
    value: float | None  # None if the reference has no measure of that name
    unit: str = ""

    @property
    def is_close(self) -> bool:
        """Return whether the reference is close enough to the original. False if it has no such measure."""
        tolerance = self.original.within * max(abs(self.original.value), 1e-9)
        return self.value is not None and abs(self.value - self.original.value) <= tolerance + 1e-9


@dataclass(frozen=True, slots=True)
class CheckedAssignment:
    """The results of all examples of an assignment, the reference first, and of submissions without effort."""

    assignment: Assignment
    examples: tuple[ExampleResult, ...]
    measures: tuple[ComparedMeasure, ...]
    no_effort: tuple[NoEffortResult, ...] = ()  # empty if they were not graded

    @property
    def problems(self) -> tuple[str, ...]:
        """One sentence for each problem: first those of the examples, then those of the measures."""
        of_examples = (problem for example in self.examples for problem in example.problems)
        of_measures = (problem for measure in self.measures for problem in _check_measure(measure))
        return (*of_examples, *of_measures)

    @property
    def warnings(self) -> tuple[str, ...]:
        """One sentence for each setting that is allowed but makes marks easy to guess, or gives many without effort."""
        notable_results = (result for result in self.no_effort if result.is_notable)
        return (*find_guessable_reports(self.assignment), *map(_describe_no_effort, notable_results))

    @property
    def missing_expectations(self) -> Mapping[str, ExpectedResult]:
        """Expectations missing from ``expected.toml``, by example. Examples with other problems are left out."""
        return {
            each.name: each.missing_expectation
            for each in self.examples
            if each.missing_expectation is not None and set(each.problems) <= {_describe_missing_table(each.name)}
        }

    def as_written(self) -> CheckedAssignment:
        """Return the result as it will be once ``expected.toml`` contains the missing expectations."""
        new_expectations = self.missing_expectations
        examples = (replace(each, problems=()) if each.name in new_expectations else each for each in self.examples)
        return replace(self, examples=tuple(examples))


def check_examples(name_or_path: str, *, runner: TrialRunner) -> CheckedAssignment:
    """Grade every example of the assignment. An assignment without examples has no problems.

    Raises:
        AssignmentError: The assignment or its ``expected.toml`` is invalid.
    """
    assignment = find_assignment(name_or_path)
    expected = read_expected(name_or_path)
    names = list_examples(name_or_path)
    results: list[ExampleResult] = []
    measures: tuple[ComparedMeasure, ...] = ()
    for name in names:
        result, example_grade = _check_example(name_or_path, name, assignment, expected.examples.get(name), runner)
        results.append(result)
        if name == REFERENCE and example_grade is not None:
            measures = tuple(_compare_measure(original, example_grade) for original in expected.original)
    missing_names = sorted(expected.examples.keys() - set(names))
    results += [
        ExampleResult(name, None, (), 0.0, (f"{name}: is expected, but is not an example",)) for name in missing_names
    ]
    return CheckedAssignment(assignment, tuple(results), measures)


def list_examples(name_or_path: str) -> tuple[str, ...]:
    """Return the names of the examples, the reference first, then sorted. Empty if there are no examples."""
    try:
        folder = locate_examples(name_or_path)
    except UsageError:
        return ()
    names = (path.name for path in folder.iterdir() if not path.name.startswith((".", "_")))
    return tuple(sorted(names, key=lambda name: (name != REFERENCE, name)))


def _check_example(
    name_or_path: str, name: str, assignment: Assignment, expected: ExpectedResult | None, runner: TrialRunner
) -> tuple[ExampleResult, Grade | None]:
    start = time.monotonic()
    try:
        submission = read_example(name_or_path, name)
        example_grade = grade(submission, assignment, runner=runner)
    except UsageError as error:
        return ExampleResult(name, None, (), time.monotonic() - start, (f"{name}: {error}",)), None
    seconds = time.monotonic() - start
    lost_ids = tuple(result.id for result in example_grade.criteria if result.marks < result.max_marks)
    problems = [
        f"{name}: {each}"
        for each in _compare_with_expectation(
            example_grade, lost_ids, expected if expected is not None else _build_default_expectation(name, assignment)
        )
    ]
    if expected is None and name != REFERENCE:
        problems.append(_describe_missing_table(name))
    missing_expectation = _build_expectation(example_grade, lost_ids) if expected is None else None
    marked_submission = replace(to_marked_submission(example_grade), who=name)
    return ExampleResult(
        name, example_grade.marks, lost_ids, seconds, tuple(problems), missing_expectation, marked_submission
    ), example_grade


def _describe_missing_table(name: str) -> str:
    return f"{name}: has no table in {EXPECTED} (check --write-expected writes its results)"


def _build_expectation(example_grade: Grade, lost_ids: tuple[str, ...]) -> ExpectedResult:
    """Return the expectation that matches this grade."""
    earns = {result.id: result.marks for result in example_grade.criteria if result.id in lost_ids}
    return ExpectedResult(marks=example_grade.marks, verdict=example_grade.verdict, loses=lost_ids, earns=earns)


def _build_default_expectation(name: str, assignment: Assignment) -> ExpectedResult | None:
    """Return the default expectation of an example without an entry: full marks for the reference, else None."""
    return ExpectedResult(marks=assignment.max_marks) if name == REFERENCE else None


def _compare_with_expectation(
    example_grade: Grade, lost_ids: tuple[str, ...], expected: ExpectedResult | None
) -> list[str]:
    problems = [
        f"{result.id} could not be judged: {result.unjudged}" for result in example_grade.criteria if result.unjudged
    ]
    if expected is None:
        return problems
    earned_marks = {result.id: result.marks for result in example_grade.criteria}
    problems += [
        f'{EXPECTED} says it {verb} "{name}", expected the id of a criterion: {", ".join(sorted(earned_marks))}'
        for verb, names in (("loses", expected.loses or ()), ("earns", expected.earns))
        for name in names
        if name not in earned_marks
    ]
    problems += [
        f"got {earned_marks[name]} marks for {name}, expected {marks}"
        for name, marks in expected.earns.items()
        if name in earned_marks and earned_marks[name] != marks
    ]
    messages = "\n".join(result.message for result in example_grade.criteria)
    if example_grade.marks != expected.marks:
        problems.append(
            f"got {example_grade.marks} marks, expected {expected.marks}; {_describe_lost_marks(example_grade)}"
        )
    if example_grade.verdict != expected.verdict:
        problems.append(
            f"ended as {example_grade.verdict}, expected {expected.verdict}{_describe_fault(example_grade)}"
        )
    if expected.loses is not None and set(lost_ids) != set(expected.loses):
        problems.append(
            f"lost marks in {', '.join(lost_ids) or 'nothing'}, expected {', '.join(expected.loses) or 'nothing'}"
        )
    problems += [
        f'did not get the feedback "{phrase}", but {messages}' for phrase in expected.feedback if phrase not in messages
    ]
    return problems


def _describe_fault(example_grade: Grade) -> str:
    """Return the first reported fault as a sentence part; empty if there is none."""
    faults = [fault for trial in example_grade.trials for fault in collect_faults(trial.recording)]
    return f"; {describe_fault(faults[0])}" if faults else ""


def _describe_lost_marks(example_grade: Grade) -> str:
    clauses = [f"{result.id}: {result.message}" for result in example_grade.criteria if result.marks < result.max_marks]
    return " ".join(clauses) or "nothing was lost"


def _compare_measure(original: OriginalMeasure, example_grade: Grade) -> ComparedMeasure:
    """Compare the original with the first measure of that name, in the order of criteria and trials."""
    for result in example_grade.criteria:
        for evidence in result.evidence:
            for measure in evidence.measures:
                if measure.name == original.measure:
                    return ComparedMeasure(original, measure.value, measure.unit)
    return ComparedMeasure(original, None)


def _check_measure(measure: ComparedMeasure) -> tuple[str, ...]:
    original = measure.original
    if measure.value is None:
        return (f"{REFERENCE}: measured no {original.measure}, expected about {original.value:g}",)
    if measure.is_close or original.explained:
        return ()
    return (
        f"{REFERENCE}: {original.measure} is {measure.value:g} {measure.unit}".rstrip()
        + f", expected {original.value:g} within {original.within:.0%}, or an explanation",
    )


def _describe_no_effort(result: NoEffortResult) -> str:
    return (
        f"{result.description} gets {result.marks} of {result.max_marks} marks; "
        "give most marks to what the task is about, and the others only with it (needs)"
    )
