"""Drawing of trials from pools, round by round, until all marks are decided.

The order of a pool is the same for all students, so a round contains the next trials of that order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from enum import Enum

from service.grading.grade import CriterionResult, TrialResult
from submissions.assignment.definition import Assignment, Trial


class PoolExtent(Enum):
    """How many trials of its pools a grading runs."""

    UNTIL_DECIDED = "until decided"  # or until the scenario's maximum
    WHOLE = "whole"


#: Judges trials against an assignment.
JudgeTrials = Callable[[Assignment, tuple[TrialResult, ...]], tuple[CriterionResult, ...]]


def run_rounds(
    assignment: Assignment,
    trials: Sequence[Trial],
    extent: PoolExtent,
    run: Callable[[Sequence[Trial]], Sequence[TrialResult]],
    judge_trials: JudgeTrials,
) -> list[TrialResult]:
    """Run trials in rounds until no pool needs more. Returns the results in the order of ``trials``.

    Args:
        assignment: The assignment.
        trials: All its trials; those of a pool in the order of drawing.
        extent: How many trials of each pool to run.
        run: Runs the trials of a round and returns their results.
        judge_trials: Judges the results so far; called only if a pool could stop.
    """
    numbers = {scenario.id: scenario.draw.least for scenario in assignment.scenarios if scenario.draw is not None}
    if extent is PoolExtent.WHOLE or not numbers:
        return list(run(trials))
    results: dict[int, TrialResult] = {}
    while True:
        round_trials = [(place, trial) for place, trial in _take_drawn(trials, numbers) if place not in results]
        run_results = run([trial for _, trial in round_trials])
        results |= {place: result for (place, _), result in zip(round_trials, run_results, strict=True)}
        ordered_results = [results[place] for place in sorted(results)]
        open_scenarios = _find_open_pools(assignment, numbers, ordered_results, judge_trials)
        if not open_scenarios:
            return ordered_results
        for scenario in assignment.scenarios:
            if scenario.draw is not None and scenario.id in open_scenarios:
                numbers[scenario.id] = min(numbers[scenario.id] + scenario.draw.least, scenario.draw.most)


def _take_drawn(trials: Sequence[Trial], numbers: dict[str, int]) -> Iterator[tuple[int, Trial]]:
    """Yield the trials outside pools and the first ones of each pool, with their places in ``trials``."""
    taken = dict.fromkeys(numbers, 0)
    for place, trial in enumerate(trials):
        if trial.scenario.id in numbers:
            taken[trial.scenario.id] += 1
            if taken[trial.scenario.id] > numbers[trial.scenario.id]:
                continue
        yield place, trial


def _find_open_pools(
    assignment: Assignment, numbers: dict[str, int], results: Sequence[TrialResult], judge_trials: JudgeTrials
) -> set[str]:
    """Return the scenarios with a pool that may be drawn from and has criteria whose marks are not decided."""
    drawable = {
        scenario.id
        for scenario in assignment.scenarios
        if scenario.draw is not None and numbers[scenario.id] < scenario.draw.most
    }
    if not drawable:
        return set()
    pools = {criterion.id: assignment.find_pool(criterion) for criterion in assignment.chance_criteria}
    pool_judging = replace(assignment, criteria=assignment.chance_criteria)
    return {
        scenario.id
        for result in judge_trials(pool_judging, tuple(results))
        if (scenario := pools[result.id]) is not None
        and scenario.id in drawable
        and not (result.pool is None or result.pool.is_decided)
    }
