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

    ``unwritten`` is the entry that ``expected.toml`` does not have yet.
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
        near = self.original.within * max(abs(self.original.value), 1e-9)
        return self.value is not None and abs(self.value - self.original.value) <= near + 1e-9


@dataclass(frozen=True, slots=True)
class CheckedAssignment:
    """The results of all examples of an assignment, the reference first."""

    assignment: Assignment
    examples: tuple[ExampleResult, ...]
    measures: tuple[ComparedMeasure, ...]

    @property
    def problems(self) -> tuple[str, ...]:
        """One sentence for each problem: first those of the examples, then those of the measures."""
        of_examples = (problem for example in self.examples for problem in example.problems)
        of_measures = (problem for measure in self.measures for problem in _check_measure(measure))
        return (*of_examples, *of_measures)

    @property
    def warnings(self) -> tuple[str, ...]:
        """One sentence for each setting that is allowed but makes marks easy to guess."""
        return tuple(find_guessable_reports(self.assignment))

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
        told = self.missing_expectations
        examples = (replace(each, problems=()) if each.name in told else each for each in self.examples)
        return replace(self, examples=tuple(examples))


def check_examples(name_or_path: str, *, runner: TrialRunner) -> CheckedAssignment:
    """Grade every example of the assignment. An assignment without examples has no problems.

    Raises:
        AssignmentError: The assignment or its ``expected.toml`` is invalid.
    """
    assignment = find_assignment(name_or_path)
    wanted = read_expected(name_or_path)
    names = list_examples(name_or_path)
    results: list[ExampleResult] = []
    measures: tuple[ComparedMeasure, ...] = ()
    for name in names:
        result, graded = _check_example(name_or_path, name, assignment, wanted.examples.get(name), runner)
        results.append(result)
        if name == REFERENCE and graded is not None:
            measures = tuple(_compare_measure(original, graded) for original in wanted.original)
    missing = sorted(wanted.examples.keys() - set(names))
    results += [
        ExampleResult(name, None, (), 0.0, (f"{name}: is expected, but is not an example",)) for name in missing
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
    name_or_path: str, name: str, assignment: Assignment, wanted: ExpectedResult | None, runner: TrialRunner
) -> tuple[ExampleResult, Grade | None]:
    begin = time.monotonic()
    try:
        submission = read_example(name_or_path, name)
        graded = grade(submission, assignment, runner=runner)
    except UsageError as error:
        return ExampleResult(name, None, (), time.monotonic() - begin, (f"{name}: {error}",)), None
    seconds = time.monotonic() - begin
    lost = tuple(result.id for result in graded.criteria if result.marks < result.max_marks)
    problems = [
        f"{name}: {each}"
        for each in _compare_with_expectation(
            graded, lost, wanted if wanted is not None else _build_default_expectation(name, assignment)
        )
    ]
    if wanted is None and name != REFERENCE:
        problems.append(_describe_missing_table(name))
    unwritten = _build_expectation(graded, lost) if wanted is None else None
    marked = replace(to_marked_submission(graded), who=name)
    return ExampleResult(name, graded.marks, lost, seconds, tuple(problems), unwritten, marked), graded


def _describe_missing_table(name: str) -> str:
    return f"{name}: has no table in {EXPECTED} (check --write-expected writes its results)"


def _build_expectation(graded: Grade, lost: tuple[str, ...]) -> ExpectedResult:
    """Return the expectation that matches this grade."""
    earns = {result.id: result.marks for result in graded.criteria if result.id in lost}
    return ExpectedResult(marks=graded.marks, verdict=graded.verdict, loses=lost, earns=earns)


def _build_default_expectation(name: str, assignment: Assignment) -> ExpectedResult | None:
    """Return the default expectation of an example without an entry: full marks for the reference, else None."""
    return ExpectedResult(marks=assignment.max_marks) if name == REFERENCE else None


def _compare_with_expectation(graded: Grade, lost: tuple[str, ...], wanted: ExpectedResult | None) -> list[str]:
    found = [f"{result.id} could not be judged: {result.unjudged}" for result in graded.criteria if result.unjudged]
    if wanted is None:
        return found
    earned = {result.id: result.marks for result in graded.criteria}
    found += [
        f'{EXPECTED} says it {verb} "{name}", expected the id of a criterion: {", ".join(sorted(earned))}'
        for verb, names in (("loses", wanted.loses or ()), ("earns", wanted.earns))
        for name in names
        if name not in earned
    ]
    found += [
        f"got {earned[name]} marks for {name}, expected {marks}"
        for name, marks in wanted.earns.items()
        if name in earned and earned[name] != marks
    ]
    told = "\n".join(result.message for result in graded.criteria)
    if graded.marks != wanted.marks:
        found.append(f"got {graded.marks} marks, expected {wanted.marks}; {_describe_lost_marks(graded)}")
    if graded.verdict != wanted.verdict:
        found.append(f"ended as {graded.verdict}, expected {wanted.verdict}{_describe_fault(graded)}")
    if wanted.loses is not None and set(lost) != set(wanted.loses):
        found.append(f"lost marks in {', '.join(lost) or 'nothing'}, expected {', '.join(wanted.loses) or 'nothing'}")
    found += [f'did not get the feedback "{phrase}", but {told}' for phrase in wanted.feedback if phrase not in told]
    return found


def _describe_fault(graded: Grade) -> str:
    """Return the first reported fault as a sentence part; empty if there is none."""
    faults = [fault for trial in graded.trials for fault in collect_faults(trial.recording)]
    return f"; {describe_fault(faults[0])}" if faults else ""


def _describe_lost_marks(graded: Grade) -> str:
    words = [f"{result.id}: {result.message}" for result in graded.criteria if result.marks < result.max_marks]
    return " ".join(words) or "nothing was lost"


def _compare_measure(original: OriginalMeasure, graded: Grade) -> ComparedMeasure:
    """Compare the original with the first measure of that name, in the order of criteria and trials."""
    for result in graded.criteria:
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
