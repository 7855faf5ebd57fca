"""Stages of a change, from the differences between two gradings, and the summary of all changes."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal

import pytest

from builders import echo
from service.store.batches.change_stages import (
    Comparison,
    CriterionTables,
    TrialKey,
    VersionDifference,
    compare_versions,
    find_stages,
    find_stages_of_equal_marks,
)
from service.store.batches.changes import Change, CriterionChange, summarise_changes
from service.store.grades.judged_again import JudgedAgain, RejudgedMarks
from service.store.states import ChangeStage, JobState, Standing
from submissions.assignment.definition import Assignment

pytestmark = pytest.mark.fast

CRITERION = echo().criteria[0]
TABLES = CriterionTables(CRITERION, CRITERION)
#: Marks of 1 before, 3 after, of 4.
BEFORE, AFTER = (Decimal(1), Decimal(4)), (Decimal(3), Decimal(4))
SAME = {("one", 0): ("a", "finished"), ("two", 0): ("b", "finished")}
COMPARISON = Comparison(VersionDifference(), False, False, False, frozenset(), SAME, SAME)
#: Other recordings of the first scenario.
OTHER = replace(COMPARISON, after={**SAME, ("one", 0): ("c", "finished")})
CRITERION_CHANGED = VersionDifference(criteria=frozenset({CRITERION.id}))
SCENARIO_CHANGED = VersionDifference(parts=("scenarios",), scenarios=frozenset({"one"}))
POOL_KEY: TrialKey = ("one", 1)


@pytest.mark.parametrize(
    ("comparison", "stages"),
    [
        (COMPARISON, "unexplained"),
        (replace(COMPARISON, has_suspect_worker=True), "worker"),
        (replace(COMPARISON, version=CRITERION_CHANGED), "criteria"),
        (replace(COMPARISON, has_other_code=True), "judging"),
        (replace(COMPARISON, version=CRITERION_CHANGED, has_other_code=True), "criteria judging"),
        (replace(COMPARISON, version=VersionDifference(parts=("world",))), "assignment"),
        (replace(COMPARISON, version=VersionDifference(parts=("given",)), has_other_code=True), "judging assignment"),
        (OTHER, "unexplained"),
        (replace(OTHER, has_other_code=True), "simulator"),
        (replace(OTHER, has_other_secret=True), "secret"),
        (replace(OTHER, version=SCENARIO_CHANGED), "assignment"),
        # The equal recording of the other scenario shows that the simulator is the same.
        (replace(OTHER, version=SCENARIO_CHANGED, has_other_code=True), "assignment"),
        (
            replace(OTHER, version=SCENARIO_CHANGED, has_other_code=True, before={("one", 0): ("a", "finished")}),
            "simulator assignment",
        ),
        (replace(OTHER, version=CRITERION_CHANGED, has_other_code=True), "criteria simulator"),
        # A verdict counts, too: a limit may end a run without a difference in its recording.
        (replace(COMPARISON, after={**SAME, ("one", 0): ("a", "memory_limit")}, has_other_code=True), "simulator"),
        (replace(COMPARISON, pools={"one"}, after={**SAME, POOL_KEY: ("d", "finished")}), "pool"),
    ],
)
def test_the_stage_follows_from_the_recordings_and_the_inputs(comparison: Comparison, stages: str) -> None:
    found = find_stages(CRITERION.id, TABLES, comparison, (BEFORE, AFTER), None)
    assert found == tuple(map(ChangeStage, stages.split()))


@pytest.mark.parametrize(
    ("by_old", "by_new", "stages"),
    [
        (BEFORE, AFTER, "criteria"),
        (AFTER, AFTER, "judging"),
        ((Decimal(2), Decimal(4)), AFTER, "criteria judging"),
        (BEFORE, BEFORE, "simulator"),
        (BEFORE, (Decimal(2), Decimal(4)), "criteria simulator"),
    ],
)
def test_judging_the_earlier_recordings_again_tells_stages_apart(
    by_old: tuple[Decimal, Decimal], by_new: tuple[Decimal, Decimal], stages: str
) -> None:
    comparison = replace(OTHER, version=CRITERION_CHANGED, has_other_code=True)
    judged_again = JudgedAgain("earlier", {CRITERION.id: RejudgedMarks(by_old, by_new)})
    found = find_stages(CRITERION.id, TABLES, comparison, (BEFORE, AFTER), judged_again)
    assert found == tuple(map(ChangeStage, stages.split()))


def test_other_recordings_with_equal_marks_need_an_explanation() -> None:
    assert find_stages_of_equal_marks(OTHER) == (ChangeStage.UNEXPLAINED,)
    assert find_stages_of_equal_marks(replace(OTHER, has_other_code=True)) == ()
    more = {**SAME, POOL_KEY: ("d", "finished")}
    assert find_stages_of_equal_marks(replace(COMPARISON, pools={"one"}, after=more)) == ()


def _versions() -> list[tuple[Assignment, VersionDifference]]:
    """Return changed versions of an assignment, with the difference to name."""
    own = echo()
    first, *others = own.criteria
    scenario = own.scenarios[0]
    every = frozenset(each.id for each in own.scenarios)
    hidden = frozenset(each.id for each in own.scenarios if each.visibility != "visible")
    return [
        (replace(own, title="Other", description="Other", version="other"), VersionDifference()),
        (
            replace(own, criteria=(first.model_copy(update={"title": "Other", "visibility": "hidden"}), *others)),
            VersionDifference(),
        ),
        (
            replace(own, criteria=(first.model_copy(update={"marks": Decimal(9)}), *others)),
            VersionDifference(criteria=frozenset({first.id})),
        ),
        (replace(own, criteria=tuple(others)), VersionDifference(criteria=frozenset({first.id}))),
        (
            replace(own, scenarios=(replace(scenario, seconds=1.0), *own.scenarios[1:])),
            VersionDifference(parts=("scenarios",), scenarios=frozenset({scenario.id})),
        ),
        (
            replace(own, world=replace(own.world, solid=not own.world.solid)),
            VersionDifference(parts=("world",), scenarios=every),
        ),
        (replace(own, secret="other"), VersionDifference(parts=("secret",), scenarios=hidden)),
    ]


@pytest.mark.parametrize(("changed", "difference"), _versions())
def test_the_difference_between_versions_names_what_affects_marks(
    changed: Assignment, difference: VersionDifference
) -> None:
    assert compare_versions(echo(), changed) == difference


def _change(before: int | None, after: int | None, *stages: ChangeStage, crosses: bool = False) -> Change:
    state = JobState.QUEUED if after is None else JobState.DONE
    criterion = CriterionChange("It works", BEFORE, AFTER, False, stages, crosses)
    return Change(
        student="ada",
        job_id="new",
        before_id="old",
        state=state,
        standing=Standing.PROPOSED,
        before=None if before is None else Decimal(before),
        after=None if after is None else Decimal(after),
        before_max=Decimal(10),
        after_max=Decimal(10),
        criteria=(criterion,),
        reason="",
        stages=stages,
        crosses="up" if (before, after) == (3, 5) else None,
    )


def test_a_summary_counts_directions_stages_and_boundaries() -> None:
    summary = summarise_changes(
        [
            _change(3, 5, ChangeStage.CRITERIA, crosses=True),
            _change(6, 5, ChangeStage.CRITERIA, ChangeStage.SIMULATOR),
            _change(5, 5),
            _change(None, 5, ChangeStage.FIRST_GRADE),
            _change(5, None),
        ]
    )
    assert (summary.regrades, summary.higher, summary.lower, summary.same) == (5, 1, 1, 1)
    assert (summary.first_grades, summary.ungraded) == (1, 1)
    assert summary.stages == {ChangeStage.FIRST_GRADE: 1, ChangeStage.CRITERIA: 2, ChangeStage.SIMULATOR: 1}
    assert (summary.crossing_up, summary.crossing_down, summary.crossing_criteria) == (1, 0, 1)
