"""Grading of an assignment's example submissions, and comparison with the expected results.

This is how an assignment is tested: the reference must get full marks, and each wrong solution must lose the expected
ones. The module prints nothing.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from decimal import Decimal

from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.guessable import find_guessable_reports
from service.grading.judging.message_parts import fault_words
from service.grading.statistics import MarkedSubmission, marked_of
from service.grading.trial_runner import TrialRunner
from sim.errors import UsageError
from sim.recorded import faults_of
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import EXPECTED, Expectation, OriginalMeasure, examples, expected, read_example
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
    unwritten: Expectation | None = None
    marked: MarkedSubmission | None = None  # for statistics; None if it was rejected


@dataclass(frozen=True, slots=True)
class ComparedMeasure:
    """A measure of the reference solution, compared with the value from the original simulator."""

    original: OriginalMeasure
    value: float | None  # None if the reference has no measure of that name
    unit: str = ""

    @property
    def agrees(self) -> bool:
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
        of_measures = (problem for measure in self.measures for problem in _measure_problems(measure))
        return (*of_examples, *of_measures)

    @property
    def warnings(self) -> tuple[str, ...]:
        """One sentence for each setting that is allowed but makes marks easy to guess."""
        return tuple(find_guessable_reports(self.assignment))

    @property
    def unwritten(self) -> Mapping[str, Expectation]:
        """Expectations missing from ``expected.toml``, by example. Examples with other problems are left out."""
        return {
            each.name: each.unwritten
            for each in self.examples
            if each.unwritten is not None and set(each.problems) <= {_no_table(each.name)}
        }

    def written(self) -> CheckedAssignment:
        """Return the result as it will be once ``expected.toml`` contains the missing expectations."""
        told = self.unwritten
        examples = (replace(each, problems=()) if each.name in told else each for each in self.examples)
        return replace(self, examples=tuple(examples))


def check_examples(name_or_path: str, *, runner: TrialRunner) -> CheckedAssignment:
    """Grade every example of the assignment. An assignment without examples has no problems.

    Raises:
        AssignmentError: The assignment or its ``expected.toml`` is invalid.
    """
    assignment = find_assignment(name_or_path)
    wanted = expected(name_or_path)
    names = example_names(name_or_path)
    results: list[ExampleResult] = []
    measures: tuple[ComparedMeasure, ...] = ()
    for name in names:
        result, graded = _check_example(name_or_path, name, assignment, wanted.examples.get(name), runner)
        results.append(result)
        if name == REFERENCE and graded is not None:
            measures = tuple(_compared(original, graded) for original in wanted.original)
    missing = sorted(wanted.examples.keys() - set(names))
    results += [
        ExampleResult(name, None, (), 0.0, (f"{name}: is expected, but is not an example",)) for name in missing
    ]
    return CheckedAssignment(assignment, tuple(results), measures)


def example_names(name_or_path: str) -> tuple[str, ...]:
    """Return the names of the examples, the reference first, then sorted. Empty if there are no examples."""
    try:
        folder = examples(name_or_path)
    except UsageError:
        return ()
    names = (path.name for path in folder.iterdir() if not path.name.startswith((".", "_")))
    return tuple(sorted(names, key=lambda name: (name != REFERENCE, name)))


def _check_example(
    name_or_path: str, name: str, assignment: Assignment, wanted: Expectation | None, runner: TrialRunner
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
        for each in _differences(graded, lost, wanted if wanted is not None else _usual(name, assignment))
    ]
    if wanted is None and name != REFERENCE:
        problems.append(_no_table(name))
    unwritten = _found(graded, lost) if wanted is None else None
    marked = replace(marked_of(graded), who=name)
    return ExampleResult(name, graded.marks, lost, seconds, tuple(problems), unwritten, marked), graded


def _no_table(name: str) -> str:
    return f"{name}: has no table in {EXPECTED} (check --write-expected writes its results)"


def _found(graded: Grade, lost: tuple[str, ...]) -> Expectation:
    """Return the expectation that matches this grade."""
    earns = {result.id: result.marks for result in graded.criteria if result.id in lost}
    return Expectation(marks=graded.marks, verdict=graded.verdict, loses=lost, earns=earns)


def _usual(name: str, assignment: Assignment) -> Expectation | None:
    """Return the default expectation of an example without an entry: full marks for the reference, else None."""
    return Expectation(marks=assignment.max_marks) if name == REFERENCE else None


def _differences(graded: Grade, lost: tuple[str, ...], wanted: Expectation | None) -> list[str]:
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
        found.append(f"got {graded.marks} marks, expected {wanted.marks}; {_lost_words(graded)}")
    if graded.verdict != wanted.verdict:
        found.append(f"ended as {graded.verdict}, expected {wanted.verdict}{_fault(graded)}")
    if wanted.loses is not None and set(lost) != set(wanted.loses):
        found.append(f"lost marks in {', '.join(lost) or 'nothing'}, expected {', '.join(wanted.loses) or 'nothing'}")
    found += [f'did not get the feedback "{phrase}", but {told}' for phrase in wanted.feedback if phrase not in told]
    return found


def _fault(graded: Grade) -> str:
    """Return the first reported fault as a sentence part; empty if there is none."""
    faults = [fault for trial in graded.trials for fault in faults_of(trial.recording)]
    return f"; {fault_words(faults[0])}" if faults else ""


def _lost_words(graded: Grade) -> str:
    words = [f"{result.id}: {result.message}" for result in graded.criteria if result.marks < result.max_marks]
    return " ".join(words) or "nothing was lost"


def _compared(original: OriginalMeasure, graded: Grade) -> ComparedMeasure:
    """Compare the original with the first measure of that name, in the order of criteria and trials."""
    for result in graded.criteria:
        for evidence in result.evidence:
            for measure in evidence.measures:
                if measure.name == original.measure:
                    return ComparedMeasure(original, measure.value, measure.unit)
    return ComparedMeasure(original, None)


def _measure_problems(measure: ComparedMeasure) -> tuple[str, ...]:
    original = measure.original
    if measure.value is None:
        return (f"{REFERENCE}: measured no {original.measure}, expected about {original.value:g}",)
    if measure.agrees or original.explained:
        return ()
    return (
        f"{REFERENCE}: {original.measure} is {measure.value:g} {measure.unit}".rstrip()
        + f", expected {original.value:g} within {original.within:.0%}, or an explanation",
    )
