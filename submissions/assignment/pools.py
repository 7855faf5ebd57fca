"""Checks of pools: scenarios with many numbered trials, over which chance criteria are defined.

A grading may stop after the first trials of a pool, so a pool varies nothing but chance, and its criteria judge each
trial by itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from submissions.assignment.problems import Path as Place
from submissions.assignment.problems import Problems
from submissions.assignment.scenario import Draw
from submissions.assignment.schema import DrawTable, ScenarioTable
from submissions.criteria import Criterion
from submissions.criteria.common import AssignmentContext, UnmetRequirement


def read_draw(table: ScenarioTable, pose_count: int, table_path: Place, problems: Problems) -> Draw | None:
    """Return how trials are drawn from the scenario's pool; None if it has none. Mistakes go to ``problems``."""
    if table.pool is None:
        if isinstance(table.trials, DrawTable):
            problems.add((*table_path, "trials"), "trials has least and most, which need a pool, expected pool = 200")
        return None
    draw = table.trials if isinstance(table.trials, DrawTable) else DrawTable()
    if isinstance(table.trials, int) and "trials" in table.model_fields_set:
        problems.add(
            (*table_path, "trials"), "trials is a number, but there is a pool, expected { least = 4, most = 40 }"
        )
    if "most" not in draw.model_fields_set:
        draw = draw.model_copy(update={"most": min(max(draw.most, draw.least), table.pool)})
    if not draw.least <= draw.most <= table.pool:
        problems.add(
            (*table_path, "trials"),
            f"trials has least {draw.least} and most {draw.most}, expected least <= most <= pool ({table.pool})",
        )
    for key, what in _find_varied(table, pose_count):
        problems.add((*table_path, key), f"{key} {what}, expected a pool in which only chance differs")
    return Draw(draw.least, draw.most)


def _find_varied(table: ScenarioTable, pose_count: int) -> Iterator[tuple[str, str]]:
    """Yield the keys by which trials of the pool would differ systematically, with the problem."""
    if pose_count > 1 and table.choose != "random":
        yield "choose", 'is not "random", but there are several poses'
    for key in ("light_noise", "motor_noise"):
        if len(getattr(table, key)) > 1:
            yield key, "has several levels"
    if "sweep" in table.model_fields_set:
        yield "sweep", "has levels"


def find_pool_mistakes(criterion: Criterion, context: AssignmentContext) -> Iterator[UnmetRequirement]:
    """Yield why the criterion cannot be defined over its pool, and bands without a pool."""
    scenarios = list(context.find_scenarios(criterion))
    if not criterion.judges_runs or all(each.draw is None for each in scenarios):
        if criterion.bands:
            yield UnmetRequirement("bands", "bands needs a pool, expected a criterion of a scenario with one")
        return
    is_used_by_others = any(each.result_needed == criterion.id for each in context.criteria)
    if not criterion.judges_each_trial or criterion.result_needed or is_used_by_others:
        yield UnmetRequirement(
            "check",
            f'check "{criterion.check}" compares trials or criteria, expected one that judges each trial of a pool',
        )
    if len(scenarios) > 1:
        yield UnmetRequirement(
            "scenarios",
            f"scenarios has {len(scenarios)} scenarios, one of them with a pool, expected only the one with the pool",
        )
    if criterion.bands:
        yield from _find_band_mistakes(criterion)


def _find_band_mistakes(criterion: Criterion) -> Iterator[UnmetRequirement]:
    bands = criterion.bands
    if criterion.over not in ("share", "mean"):
        yield UnmetRequirement(
            "bands", f'bands is not used with over = "{criterion.over}", expected over = "share" or "mean"'
        )
    is_ascending = all(low[0] < high[0] and low[1] <= high[1] for low, high in pairwise(bands))
    if not (is_ascending and bands[0][0] > 0 and bands[-1][0] <= 1 and bands[0][1] >= 0):
        yield UnmetRequirement(
            "bands", "bands does not ascend from above 0 to 1, expected [[share, marks], ...], the lowest first"
        )
    elif abs(bands[-1][1] - float(criterion.marks)) > 1e-9:
        yield UnmetRequirement(
            "bands", f"bands ends with {bands[-1][1]:g} marks, expected {criterion.marks}: all there are"
        )
