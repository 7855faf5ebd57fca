"""Grading of mutants of an assignment's reference: which faults the assignment finds, and which keep full marks.

A mutant whose recordings equal those of the reference behaves in the same way: it is equivalent, and not a fault. A
mutant that behaves differently is killed if it loses marks, and survives otherwise. The assignment's author can give
reasons why survivors are solutions too. The module prints nothing.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Literal

from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.pools.drawing import PoolExtent
from service.grading.trial_runner import TrialRunner
from service.grading.trial_selection import needs_every_trial, select_trials
from service.mutation.mutants import Mutant, choose_mutants, iterate_mutants
from service.mutation.survivor_reasons import SurvivorReason, read_survivor_reasons
from sim.errors import UsageError
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import read_example
from submissions.assignment.folder import REFERENCE
from submissions.assignment.reader import find_assignment
from submissions.submission import SECOND_PROGRAM, Part, Submission

Fate = Literal["killed", "equivalent", "survivor"]
#: Largest share of unexplained survivors among the mutants that behave differently, without a warning.
MAX_UNEXPLAINED_SHARE = 0.1
#: CPU seconds for each mutant on average. The remaining mutants are not graded after that.
_CPU_SECONDS_PER_MUTANT = 4.0
#: Enough for a reference, and short for an endless loop.
_PROGRAM_CPU_SECONDS = 2.0


@dataclass(frozen=True, slots=True)
class MutantResult:
    """The result of one mutant. ``lost`` are the criteria that found the fault, as far as they were judged.

    ``reason`` says why a survivor is a solution too; it is empty if the author gives none.
    """

    mutant: Mutant
    fate: Fate
    lost: tuple[str, ...] = ()
    reason: str = ""


@dataclass(frozen=True, slots=True)
class OperatorCounts:
    """The numbers of mutants of one operator. ``unexplained`` are the survivors without a reason."""

    operator: str
    mutants: int
    equivalent: int
    killed: int
    survivors: int
    unexplained: int


@dataclass(frozen=True)
class MutantCheck:
    """The results of all graded mutants of a reference, in the order of its files and lines.

    ``ungraded`` mutants were left out, because the others used all the CPU time. ``stale_reasons`` cover no mutant that
    can still survive. ``problem`` says why there are no results.
    """

    assignment: str
    results: tuple[MutantResult, ...] = ()
    ungraded: int = 0
    stale_reasons: tuple[SurvivorReason, ...] = ()
    problem: str = ""

    @cached_property
    def survivors(self) -> tuple[MutantResult, ...]:
        """The mutants that behave differently and keep the marks of the reference."""
        return tuple(each for each in self.results if each.fate == "survivor")

    @property
    def unexplained_share(self) -> float:
        """The share of unexplained survivors among the mutants that behave differently; 0 if there are none."""
        total = self.total
        different = total.mutants - total.equivalent
        return total.unexplained / different if different else 0.0

    @property
    def counts(self) -> tuple[OperatorCounts, ...]:
        """The numbers by operator, sorted by its name."""
        operators = sorted({each.mutant.operator for each in self.results})
        return tuple(self._count_fates(operator) for operator in operators)

    @property
    def total(self) -> OperatorCounts:
        """The numbers of all operators together."""
        return self._count_fates("")

    def _count_fates(self, operator: str) -> OperatorCounts:
        fates = Counter(each.fate for each in self.results if operator in ("", each.mutant.operator))
        unexplained = sum(operator in ("", each.mutant.operator) and not each.reason for each in self.survivors)
        return OperatorCounts(
            operator, fates.total(), fates["equivalent"], fates["killed"], fates["survivor"], unexplained
        )


@dataclass(frozen=True)
class _Original(Submission):
    """A reference whose mutants have its hash and therefore its seeds, so that all draw the same random numbers."""

    original_sha256: str = ""

    @cached_property
    def sha256(self) -> str:
        return self.original_sha256


def check_mutants(name_or_path: str, limit: int, *, runner: TrialRunner) -> MutantCheck:
    """Grade at most ``limit`` mutants of the reference of an assignment.

    Raises:
        AssignmentError: The assignment or its ``survivors.toml`` is invalid.
        HostError: The machine failed.
    """
    assignment = find_assignment(name_or_path)
    reasons = read_survivor_reasons(name_or_path)
    try:
        reference = read_example(name_or_path, REFERENCE)
        all_mutants = list(iterate_reference_mutants(reference, assignment))
        mutants = choose_mutants(all_mutants, limit)
    except UsageError as error:
        return MutantCheck(assignment.id, problem=str(error))
    if not mutants:
        return MutantCheck(assignment.id, problem="the reference has no Python file that students write")
    files = list(dict.fromkeys(each.file for each in mutants))
    mutants.sort(key=lambda each: (files.index(each.file), each.start, each.operator))
    check = _ReferenceComparison(reference, assignment, runner)
    end = time.process_time() + runner.children_cpu_seconds + limit * _CPU_SECONDS_PER_MUTANT
    results: list[MutantResult] = []
    for mutant in mutants:
        if time.process_time() + runner.children_cpu_seconds > end:
            break
        results.append(_explain(check.grade_mutant(mutant), reasons))
    return MutantCheck(
        assignment.id,
        tuple(results),
        len(mutants) - len(results),
        tuple(_iterate_stale_reasons(reasons, all_mutants, results)),
    )


def _explain(result: MutantResult, reasons: Sequence[SurvivorReason]) -> MutantResult:
    """Return the result of a survivor with the first reason that covers it, and other results unchanged."""
    if result.fate != "survivor":
        return result
    return replace(result, reason=next((each.reason for each in reasons if each.covers(result.mutant)), ""))


def _iterate_stale_reasons(
    reasons: Sequence[SurvivorReason], mutants: Sequence[Mutant], results: Sequence[MutantResult]
) -> Iterator[SurvivorReason]:
    """Yield the reasons that cover neither a survivor nor a mutant that was not graded."""
    killed_or_equivalent = {each.mutant for each in results if each.fate != "survivor"}
    candidates = [each for each in mutants if each not in killed_or_equivalent]
    for reason in reasons:
        if not any(reason.covers(mutant) for mutant in candidates):
            yield reason


def iterate_reference_mutants(reference: Submission, assignment: Assignment) -> Iterator[Mutant]:
    """Yield the mutants of all parts that students write."""
    parts = assignment.parts
    if reference.program is not None and parts.program == "student":
        yield from iterate_mutants(reference.program.text, "program")
    if reference.responder is not None and parts.responder == "student":
        yield from iterate_mutants(reference.responder.text, "responder")
    for name, source in reference.python_files.items():
        part = _find_file_part(name, assignment)
        if part is not None:
            yield from iterate_mutants(source.text, part, name)


def _find_file_part(name: str, assignment: Assignment) -> Part | None:
    """Return the part whose operators apply to an additional file; None if it is not a part of the submission."""
    if name == SECOND_PROGRAM and assignment.parts.second_program == "student":
        return "program"
    is_agent = assignment.parts.agents.get(name.removesuffix(".py")) == "student"
    return "responder" if is_agent else None


class _ReferenceComparison:
    """Grades mutants and compares them with the reference, first in one trial of each scenario."""

    def __init__(self, reference: Submission, assignment: Assignment, runner: TrialRunner) -> None:
        limits = replace(assignment.limits, program_cpu=min(assignment.limits.program_cpu, _PROGRAM_CPU_SECONDS))
        values = {each.name: getattr(reference, each.name) for each in fields(reference)}
        self._reference, self._runner = _Original(**values, original_sha256=reference.sha256), runner
        self._assignment = replace(assignment, limits=limits)
        first_trials = {each.scenario.id: (each.scenario.id, each.index) for each in reversed([*assignment.trials()])}
        self._sample = select_trials(self._assignment, first_trials.values())
        self._reference_grade = self._grade(reference, self._assignment)
        self._sample_grade = (
            self._grade(reference, self._sample) if len(self._reference_grade.trials) > len(first_trials) else None
        )

    def grade_mutant(self, mutant: Mutant) -> MutantResult:
        """Grade a mutant and return its result."""
        submission = self._reference.with_source(mutant.file, mutant.source)
        if self._sample_grade is not None:
            lost_ids = [
                each
                for each in _list_lost(self._grade(submission, self._sample), self._sample_grade)
                if self._needs_every_trial(each)
            ]
            if lost_ids:
                return MutantResult(mutant, "killed", tuple(lost_ids))
        mutant_grade = self._grade(submission, self._assignment)
        lost = _list_lost(mutant_grade, self._reference_grade)
        if mutant_grade.marks < self._reference_grade.marks:
            return MutantResult(mutant, "killed", lost)
        is_equivalent = _collect_behaviour(mutant_grade) == _collect_behaviour(self._reference_grade)
        return MutantResult(mutant, "equivalent" if is_equivalent else "survivor")

    def _needs_every_trial(self, criterion_id: str) -> bool:
        criterion = next(each for each in self._assignment.criteria if each.id == criterion_id)
        return needs_every_trial(criterion, self._assignment)

    def _grade(self, submission: Submission, assignment: Assignment) -> Grade:
        return grade(submission, assignment, runner=self._runner, extent=PoolExtent.UNTIL_DECIDED, with_hints=False)


def _list_lost(changed: Grade, reference: Grade) -> tuple[str, ...]:
    """Return the criteria in which the changed submission has fewer marks than the reference."""
    pairs = zip(changed.criteria, reference.criteria, strict=True)
    return tuple(each.id for each, other in pairs if each.marks < other.marks)


def _collect_behaviour(graded: Grade) -> object:
    """Return everything that shows how a submission behaves: what its trials recorded, and what was judged."""
    recordings = [(each.recording.sha256, each.recording.messages) for each in graded.trials]
    return recordings, graded.criteria
