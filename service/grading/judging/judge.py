"""Judging: one result per criterion, from the assignment and its trials.

The judge of a criterion is in the module with the same name as the module of its schema.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from importlib import import_module
from types import MappingProxyType

from service.grading.grade import CriterionResult, TrialResult
from service.grading.judging.judge_declaration import Case, Judge, StaticAnalysis, judge_once
from service.grading.judging.message_parts import WITHHELD_MARKS
from service.grading.judging.outcome import fail_with
from sim.errors import HostError
from sim.recording import Verdict
from sim.sentences import Sentence, join_sentences
from submissions.assignment.definition import Assignment
from submissions.criteria import SCHEMAS, Criterion
from submissions.submission import PART_FILES

_EMPTY_ANALYSIS = StaticAnalysis()


def _collect_judges() -> Mapping[type[Criterion], Judge]:
    families = {schema.__module__.rpartition(".")[2] for schema in SCHEMAS.values()}
    module_values = [vars(import_module(f"{__package__}.{family}")).values() for family in families]
    return MappingProxyType(
        {each.schema: each for values in module_values for each in values if isinstance(each, Judge)}
    )


#: The judge of each schema.
JUDGES = _collect_judges()


def judge(
    assignment: Assignment, trials: tuple[TrialResult, ...], analysis: StaticAnalysis = _EMPTY_ANALYSIS
) -> tuple[CriterionResult, ...]:
    """Return one result for each criterion of the assignment, in its order.

    Args:
        assignment: The assignment.
        trials: The trials. A trial that was cut short is judged by what it reached.
        analysis: Data about the submission that is not in the recordings.

    Raises:
        HostError: A trial failed on this machine. It must be run again, not marked.
        AssignmentError: A check of the instructor failed.
    """
    reject_failed_trials(trials)
    results: dict[str, CriterionResult] = {}
    case = Case(assignment, trials, analysis, results)
    for criterion in order_criteria(assignment):
        results[criterion.id] = judge_one(criterion, case)
    return tuple(results[criterion.id] for criterion in assignment.criteria)


def reject_failed_trials(trials: Sequence[TrialResult]) -> None:
    """Raise HostError if a trial failed on this machine."""
    if any(trial.verdict is Verdict.HOST_ERROR for trial in trials):
        raise HostError("A trial that failed on this machine cannot be marked; it has to be run again.")


def order_criteria(assignment: Assignment) -> list[Criterion]:
    """Return the criteria in judging order: those that use the result of another come after it."""
    needed_ids = {each.id: each.result_needed for each in assignment.criteria}

    def count_needed(criterion: Criterion) -> int:
        count, name = 0, criterion.result_needed
        while name is not None and count < len(needed_ids):
            count, name = count + 1, needed_ids.get(name)
        return count

    return sorted(assignment.criteria, key=count_needed)


def judge_one(criterion: Criterion, case: Case) -> CriterionResult:
    """Judge one criterion. If a part that it needs was not submitted, it gets no marks."""
    missing_part = case.analysis.missing
    if missing_part in criterion.parts_needed:
        return judge_once(criterion, fail_with(Sentence("There is no %(file)s.", file=PART_FILES[missing_part])))
    result = JUDGES[type(criterion)].judge(criterion, case)
    needed_result = case.results.get(criterion.needs) if criterion.needs is not None else None
    if needed_result is None or not result.marks or 2 * needed_result.marks >= needed_result.max_marks:
        return result
    return _withhold_marks(result, needed_result)


def _withhold_marks(result: CriterionResult, needed_result: CriterionResult) -> CriterionResult:
    """Return the result without marks, because the criterion that it needs has less than half of its own."""
    reason = Sentence(WITHHELD_MARKS, title=needed_result.title)
    shown = result.shown and replace(result.shown, message=join_sentences(result.shown.message, reason))
    return replace(result, marks=Decimal("0.00"), message=join_sentences(result.message, reason), shown=shown)
