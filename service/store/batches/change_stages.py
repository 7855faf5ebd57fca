"""The stage of a regrade that changed the marks of a criterion: judging, simulation, or the assignment version.

Equal recordings show that a trial was simulated as before. Then only the criterion or its judging can change marks. All
functions here compare values in memory. ``regrade_changes.py`` loads them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from service.store.grades.judged_again import CriterionWorth, JudgedAgain
from service.store.states import ChangeStage

if TYPE_CHECKING:
    from submissions.assignment.definition import Assignment
    from submissions.assignment.scenario import Scenario
    from submissions.criteria import Criterion

#: Scenario and index in the scenario, which identify a trial in all versions of an assignment.
TrialKey = tuple[str, int]
#: Hash of the recording and verdict of a trial.
TrialOutcome = tuple[str, str]

#: Parts of an assignment that affect the trials of every scenario.
_SHARED_PARTS = ("world", "parts", "limits", "given", "given_parts", "training")
#: Parts that judges may read although the recordings are equal.
_JUDGED_PARTS = frozenset({"world", "given"})


@dataclass(frozen=True, slots=True)
class VersionDifference:
    """The difference between two versions of an assignment, or none between equal ones."""

    criteria: frozenset[str] = frozenset()  # ids of criteria that differ
    parts: tuple[str, ...] = ()  # other parts that differ
    scenarios: frozenset[str] = frozenset()  # scenarios whose trials may differ


@dataclass(frozen=True, slots=True)
class Comparison:
    """The inputs of two gradings of a submission, and their trials, except ``equal_trials`` with equal recordings."""

    version: VersionDifference
    has_other_code: bool
    has_other_secret: bool
    has_suspect_worker: bool
    pools: Set[str]  # scenarios with a pool
    before: Mapping[TrialKey, TrialOutcome]
    after: Mapping[TrialKey, TrialOutcome]
    equal_trials: int = 0

    def find_changed_trials(self, criterion: CriterionTables) -> frozenset[TrialKey]:
        """Return the trials of a criterion with other recordings, and those that only one grading has."""
        return frozenset(
            key
            for key in {**self.before, **self.after}
            if criterion.uses_scenario(key[0]) and self.before.get(key) != self.after.get(key)
        )

    @property
    def has_repeated_trial(self) -> bool:
        """Return whether a trial has the same recording in both gradings."""
        return self.equal_trials > 0 or any(self.after.get(key) == outcome for key, outcome in self.before.items())


@dataclass(frozen=True, slots=True)
class CriterionTables:
    """A criterion in the old and the new version of the assignment; None if the version does not have it."""

    before: Criterion | None
    after: Criterion | None

    @property
    def has_bands(self) -> bool:
        """Return whether its marks are steps, each of which is a boundary."""
        return any(bool(each.bands) for each in self._tables)

    @property
    def judges_runs(self) -> bool:
        """Return whether it judges recordings. Unknown criteria do."""
        return all(each.judges_runs for each in self._tables)

    def uses_scenario(self, scenario: str) -> bool:
        """Return whether it judges the trials of a scenario in one of the versions. Unknown criteria judge all."""
        if not self._tables:
            return True
        return any(each.judges_runs and scenario in (each.scenarios or (scenario,)) for each in self._tables)

    @property
    def _tables(self) -> tuple[Criterion, ...]:
        return tuple(each for each in (self.before, self.after) if each is not None)


def compare_versions(before: Assignment, after: Assignment) -> VersionDifference:
    """Return the difference between two versions. Titles, descriptions and the visibility of criteria do not count."""
    old_tables, new_tables = _dump_criteria(before), _dump_criteria(after)
    changed = {name for name in {**old_tables, **new_tables} if old_tables.get(name) != new_tables.get(name)}
    # A criterion that uses the result of another changes with it. They may be in a row.
    for _ in after.criteria:
        changed |= {each.id for each in after.criteria if each.result_needed in changed}
    shared_parts = tuple(name for name in _SHARED_PARTS if getattr(before, name) != getattr(after, name))
    old_scenarios, new_scenarios = _list_scenarios(before), _list_scenarios(after)
    all_scenarios = {**old_scenarios, **new_scenarios}
    other_scenarios = {name for name in all_scenarios if old_scenarios.get(name) != new_scenarios.get(name)}
    affected = set(all_scenarios) if shared_parts else set(other_scenarios)
    if before.secret != after.secret:
        affected |= {name for name, each in all_scenarios.items() if each.visibility != "visible"}
    parts = (
        *shared_parts,
        *(("scenarios",) if other_scenarios else ()),
        *(("secret",) if before.secret != after.secret else ()),
    )
    return VersionDifference(frozenset(changed), parts, frozenset(affected))


def find_stages(
    criterion: str,
    tables: CriterionTables,
    comparison: Comparison,
    worth: tuple[CriterionWorth, CriterionWorth],
    judged_again: JudgedAgain | None,
) -> tuple[ChangeStage, ...]:
    """Return the stages that changed the marks of a criterion. Several stages could not be told apart.

    Args:
        criterion: The id of the criterion, which both gradings have.
        tables: The criterion in both versions.
        comparison: The two gradings.
        worth: Marks and maximum by the grader, in the earlier grading and the new one.
        judged_again: The results of judging the earlier recordings again; None if that was not done.
    """
    changed_trials = comparison.find_changed_trials(tables)
    stages: set[ChangeStage] = set()
    rejudged = None if judged_again is None else judged_again.find_marks(criterion)
    if rejudged is not None:
        if rejudged.by_old_criteria != worth[0]:
            stages.add(ChangeStage.JUDGING)
        if criterion in comparison.version.criteria and rejudged.by_new_criteria != rejudged.by_old_criteria:
            stages.add(ChangeStage.CRITERIA)
        if stages and rejudged.by_new_criteria == worth[1]:
            return _sort_stages(stages)
    else:
        stages |= set(_find_judging_stages(criterion, tables, comparison, are_equal=not changed_trials))
    stages |= {stage for key in changed_trials for stage in _find_trial_stages(key, comparison)}
    if not stages and comparison.version.parts:
        stages.add(ChangeStage.ASSIGNMENT)
    return _sort_stages(stages) or (_name_unexplained(comparison),)


def find_stages_of_equal_marks(comparison: Comparison) -> tuple[ChangeStage, ...]:
    """Return the stage of other recordings with equal marks if nothing explains it; otherwise no stage."""
    has_inputs = comparison.version != VersionDifference() or comparison.has_other_code or comparison.has_other_secret
    if has_inputs or comparison.has_suspect_worker:
        return ()
    changed_trials = comparison.find_changed_trials(CriterionTables(None, None))
    is_pool = all(ChangeStage.POOL in _find_trial_stages(key, comparison) for key in changed_trials)
    return () if is_pool else (ChangeStage.UNEXPLAINED,)


def _find_judging_stages(
    criterion: str, tables: CriterionTables, comparison: Comparison, *, are_equal: bool
) -> Iterator[ChangeStage]:
    """Yield the stages that can change marks although the recordings are equal."""
    if criterion in comparison.version.criteria:
        yield ChangeStage.CRITERIA
    # Code that simulates differently explains other recordings, and these explain other marks.
    if comparison.has_other_code and are_equal:
        yield ChangeStage.JUDGING
        if any(not tables.judges_runs or part in _JUDGED_PARTS for part in comparison.version.parts):
            yield ChangeStage.ASSIGNMENT


def _find_trial_stages(key: TrialKey, comparison: Comparison) -> Iterator[ChangeStage]:
    """Yield the stages that can change the recording of a trial."""
    is_affected = key[0] in comparison.version.scenarios
    is_paired = key in comparison.before and key in comparison.after
    if is_affected:
        yield ChangeStage.ASSIGNMENT
    if not is_paired:
        if not is_affected and key[0] in comparison.pools:
            yield ChangeStage.POOL
        return
    # A trial with the same recording shows that this release simulates the program as before.
    if comparison.has_other_code and not (is_affected and comparison.has_repeated_trial):
        yield ChangeStage.SIMULATOR
    if comparison.has_other_secret:
        yield ChangeStage.SECRET


def _name_unexplained(comparison: Comparison) -> ChangeStage:
    return ChangeStage.WORKER if comparison.has_suspect_worker else ChangeStage.UNEXPLAINED


def _sort_stages(stages: Set[ChangeStage]) -> tuple[ChangeStage, ...]:
    return tuple(stage for stage in ChangeStage if stage in stages)


def _dump_criteria(assignment: Assignment) -> dict[str, object]:
    excluded = {"title", "visibility"}
    return {each.id: (type(each), each.model_dump(exclude=excluded)) for each in assignment.criteria}


def _list_scenarios(assignment: Assignment) -> dict[str, Scenario]:
    return {each.id: replace(each, title="") for each in assignment.scenarios}
