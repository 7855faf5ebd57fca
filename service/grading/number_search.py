"""Search for the smallest change of one number in a program with which it passes a criterion.

The changed programs are run. The search tries what the recorded paths suggest (``hint_counterfactuals.py``), then every
number with growing factors in both directions, and halves the distance to the first value that passes. It is for staff,
because it uses hidden trials too.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from service.grading.hint_counterfactuals import find_scaled_line
from service.grading.number_experiments import (
    BudgetSpent,
    GradedCriterion,
    NumberChange,
    NumberExperiments,
    NumberTrial,
    SearchBudget,
    read_student_files,
)
from service.grading.number_roles import describe_direction
from service.grading.program_numbers import (
    Candidate,
    ProgramNumber,
    collect_numbers,
    suggest_other_speeds,
    suggest_rotations,
    suggest_scaled_numbers,
    suggest_thresholds,
)
from service.grading.run_plan import plan_run
from service.grading.trial_specs import build_trial_spec
from sim.sentences import Sentence

#: Numbers are left out of the grid if this many values change no recording.
_MAX_TRIES_WITHOUT_EFFECT = 2
#: The largest factor of the grid, and the sizes of its steps. The grid may use this part of the runs.
_MAX_FACTOR, _MIN_STEP, _MAX_STEP = 4.0, math.log(1.05), math.log(1.4)
_GRID_SHARE = 0.8
#: About the CPU seconds of a run, of each of its ticks and of each line that it reaches. They choose the grid's steps.
_RUN_SECONDS, _TICK_SECONDS, _LINE_SECONDS = 0.03, 0.00006, 0.00005
#: The part of the CPU seconds before the bisection.
_SEARCH_SHARE = 0.75
#: The size of a change of the sign, which has no factor.
_SIGN_SIZE = math.log(3)
_ZERO_CHANGES = (1.0, -1.0, 0.5, -0.5, 2.0, -2.0, 10.0, -10.0, 50.0)
_ROUND_VALUES = (0.1, 0.5, *range(1, 11), 90, 100, 180, 360)
_FAR_FACTORS = (2.0, 0.5, 4.0, 0.25, -1.0, 6.0, 1 / 6, 10.0, 0.1, 0.0)
#: Other numbers are compared up to this power of the smallest factor: the one that gives more marks is better.
_RIVAL_POWER = 1.5
_MAX_RIVALS = 4
#: The number of values with a high score, between which and their neighbours more are tried.
_MAX_PEAKS = 3
#: Bisection ends when the factors differ by less than this.
_PRECISION = math.log(1.01)
_MAX_BISECTIONS = 8

DEFAULT_BUDGET = SearchBudget()


@dataclass(frozen=True, slots=True)
class NumberSearch:
    """The result for one criterion: the nearest change, None without one, and the cost of the search."""

    criterion: str
    change: NumberChange | None
    runs: int
    is_exhausted: bool  # the budget was used up before everything was tried

    @property
    def direction(self) -> Sentence | None:
        """The sentence for students, without the number; None without a change."""
        change = self.change
        if change is None:
            return None
        place = Sentence("line %(line)s of %(name)s", line=change.line, name=change.file)
        sentence = describe_direction(change.role, change.direction, place)
        # The sentence about the left and the right speed is about both.
        if change.is_alone_on_line or change.role in ("left speed", "right speed"):
            return sentence
        return Sentence("%(sentence)s This is about the number %(number)s.", sentence=sentence, number=change.old)


def find_nearest_number(case: GradedCriterion, budget: SearchBudget = DEFAULT_BUDGET) -> NumberSearch:
    """Search for the nearest change of a number with which the submission gets full marks for the criterion.

    The order of the runs is fixed, so the result is the same everywhere unless the CPU seconds are used up.

    Raises:
        HostError: The machine failed.
    """
    numbers = collect_numbers(read_student_files(case.submission, case.assignment))
    if not numbers or not case.criterion.marks:
        return NumberSearch(case.criterion.id, None, 0, False)
    try:
        experiments = NumberExperiments(case, budget)
    except BudgetSpent:
        return NumberSearch(case.criterion.id, None, 0, True)
    search = _Search(experiments, numbers)
    is_exhausted = False
    try:
        search.find_passing_values()
    except BudgetSpent:
        is_exhausted = True
    try:
        search.choose_change()
    except BudgetSpent:
        is_exhausted = True
    return NumberSearch(case.criterion.id, search.change, experiments.runs, is_exhausted)


class _Search:
    """The state of one search: the values that pass, by number, and all outcomes."""

    def __init__(self, experiments: NumberExperiments, numbers: list[ProgramNumber]) -> None:
        self.change: NumberChange | None = None
        self._experiments, self._numbers = experiments, numbers
        self._passing: dict[int, Candidate] = {}
        self._trials: dict[tuple[int, float], NumberTrial] = {}
        # Runs for the bisection, and for grading the whole submission again. None are kept back during these.
        grading_runs = len(experiments.case.graded.trials)
        self._reserve = min(_MAX_BISECTIONS + 2 * grading_runs, experiments.budget.runs // 2)

    def find_passing_values(self) -> None:
        """Try values until some pass. Raises BudgetSpent."""
        self._try_all(self._suggest_values())
        step = self._choose_step()
        self._try_grid(_merge_by_size(self._numbers, lambda each: _list_values(each, step)))
        if not self._passing:
            self._try_all(self._list_values_near_peaks(step))
        if not self._passing:
            idle_numbers = [each for each in self._numbers if self._has_no_effect(each)]
            self._try_all((each, value) for each in idle_numbers for value in _list_far_values(each))
        if not self._passing:
            live_numbers = [each for each in self._numbers if not self._has_no_effect(each)]
            self._try_all(_merge_by_size(live_numbers, lambda each: _list_values(each, step, offset=0.5)))
        if not self._passing:
            self._try_all((each, value) for each in live_numbers for value in _list_far_values(each))

    def choose_change(self) -> None:
        """Set the change: of the numbers that pass, the one with the most marks, with the smallest change of it.

        Raises:
            BudgetSpent: It may not be the smallest.
        """
        self._reserve = 0
        best: tuple[float, float, Candidate] | None = None
        candidates = sorted(self._passing.values(), key=lambda each: measure_size(*each))
        limit = _RIVAL_POWER * measure_size(*candidates[0]) if candidates else 0.0
        for number, value in [each for each in candidates if measure_size(*each) <= limit][:_MAX_RIVALS]:
            change = self._experiments.build_change(number, value)
            if change is None:
                continue
            rank = -float(change.marks), measure_size(number, value), (number, value)
            if best is None or rank[:2] < best[:2]:
                best, self.change = rank, change
            if change.marks >= self._experiments.case.graded.max_marks:
                break
        if best is not None:
            number, value = best[2]
            nearest_value = self._bisect(number, value)
            if nearest_value != value:
                self.change = self._experiments.build_change(number, nearest_value) or self.change

    def _suggest_values(self) -> Iterator[Candidate]:
        """Yield what the recorded path and the world suggest."""
        case = self._experiments.case
        visible_trials = [each for each in case.graded.trials if each.visibility == "visible"]
        if case.submission.program is not None:
            scaled_line = find_scaled_line(
                case.submission.program.text, case.assignment, case.criterion, visible_trials
            )
            yield from suggest_scaled_numbers(self._numbers, scaled_line)
        yield from suggest_other_speeds(self._numbers)
        plan = plan_run(case.submission, case.assignment, case.secret)
        if plan.program is not None:
            spec = build_trial_spec(next(iter(case.assignment.trials(case.secret))), plan)
            yield from suggest_rotations(self._numbers, spec.robot)
            yield from suggest_thresholds(self._numbers, spec.floor)

    def _has_no_effect(self, number: ProgramNumber) -> bool:
        """Return whether all values that were tried, at least two, left the recordings as they are."""
        trials = [trial for (index, _), trial in self._trials.items() if index == number.index]
        unchanged = self._experiments.unchanged
        return len(trials) >= _MAX_TRIES_WITHOUT_EFFECT and all(
            (each.recordings, each.score) == (unchanged.recordings, unchanged.score) for each in trials
        )

    def _choose_step(self) -> float:
        """Return the size of the grid's steps: small if there are many runs for each number."""
        experiments = self._experiments
        runs = min(experiments.budget.runs - self._reserve, self._estimate_runs()) - experiments.runs
        levels = _GRID_SHARE * runs / (2 * len(self._numbers))
        return min(max(math.log(_MAX_FACTOR) / max(levels, 1), _MIN_STEP), _MAX_STEP)

    def _estimate_runs(self) -> int:
        """Return about how many runs like the recorded ones the CPU seconds allow."""
        recordings = (each.recording for each in self._experiments.case.graded.trials)
        costs = (_TICK_SECONDS * len(each.ticks) + _LINE_SECONDS * len(each.places) for each in recordings)
        run_seconds = _RUN_SECONDS + max(costs, default=0.0)
        return int(self._experiments.budget.cpu_seconds / run_seconds)

    def _try_grid(self, candidates: Iterable[Candidate]) -> None:
        """Try values of growing size until they are too far from the nearest one that passes."""
        for number, value in candidates:
            limit = min((measure_size(*each) for each in self._passing.values()), default=math.inf)
            if measure_size(number, value) > limit * _RIVAL_POWER or len(self._passing) >= _MAX_RIVALS:
                return
            is_nearer = number.index not in self._passing or measure_size(number, value) < limit
            if is_nearer and not self._has_no_effect(number):
                self._try(number, value)

    def _try_all(self, candidates: Iterable[Candidate]) -> None:
        """Try values until one passes."""
        for number, value in candidates:
            self._try(number, value)
            if self._passing:
                return

    def _try(self, number: ProgramNumber, value: float) -> NumberTrial:
        experiments = self._experiments
        is_cpu_used = self._reserve and experiments.cpu_seconds > _SEARCH_SHARE * experiments.budget.cpu_seconds
        if is_cpu_used or experiments.runs + self._reserve >= experiments.budget.runs:
            raise BudgetSpent
        trial = self._experiments.try_value(number, value)
        self._trials[number.index, value] = trial
        if trial.passes:
            known = self._passing.get(number.index)
            if known is None or measure_size(number, value) < measure_size(*known):
                self._passing[number.index] = number, value
        return trial

    def _list_values_near_peaks(self, step: float) -> Iterator[Candidate]:
        """Yield values beside those with the highest scores, if these are higher than without a change."""
        unchanged_score = self._experiments.unchanged.score
        peaks = sorted(
            (key for key, trial in self._trials.items() if trial.score > unchanged_score),
            key=lambda key: -self._trials[key].score,
        )
        for part in (0.5, 0.25, 0.75):
            for (index, value), side in itertools.product(peaks[:_MAX_PEAKS], (1, -1)):
                yield self._numbers[index], value * math.exp(side * part * step)

    def _bisect(self, number: ProgramNumber, value: float) -> float:
        """Return the value nearest to the old one that passes, between the old one and ``value``."""
        if number.value == 0 or value * number.value <= 0:
            return value
        passing = math.log(value / number.value)
        failing = self._find_nearest_failure(number, passing)
        for _ in range(_MAX_BISECTIONS):
            if abs(passing - failing) <= _PRECISION:
                break
            middle = (failing + passing) / 2
            middle_value = number.value * math.exp(middle)
            texts = [number.format_value(number.value * math.exp(each)) for each in (failing, middle, passing)]
            if len(set(texts)) < 3:
                break
            if self._try(number, middle_value).passes:
                passing = middle
            else:
                failing = middle
        return number.value * math.exp(passing)

    def _find_nearest_failure(self, number: ProgramNumber, passing: float) -> float:
        """Return the logarithm of the factor that fails and is nearest to the passing one, on the side of 0."""
        failures = [
            math.log(value / number.value)
            for (index, value), trial in self._trials.items()
            if index == number.index and value * number.value > 0 and not trial.passes
        ]
        return max((each for each in failures if 0 < each / passing < 1), key=abs, default=0.0)


def measure_size(number: ProgramNumber, value: float) -> float:
    """Return the size of a change: the logarithm of its factor, or a size for other signs and for zeros."""
    if number.value == 0:
        return _SIGN_SIZE + abs(math.log(abs(value) or 1e-9))
    factor = value / number.value
    if factor == 0:
        return 2 * _SIGN_SIZE
    return abs(math.log(abs(factor))) + (_SIGN_SIZE if factor < 0 else 0.0)


def _merge_by_size(
    numbers: Iterable[ProgramNumber], list_values: Callable[[ProgramNumber], Iterable[float]]
) -> list[Candidate]:
    """Return the values of all numbers, the smallest changes first."""
    candidates = [(number, value) for number in numbers for value in list_values(number)]
    return sorted(candidates, key=lambda each: (round(measure_size(*each), 9), each[0].index))


def _list_values(number: ProgramNumber, step: float, offset: float = 0.0) -> Iterator[float]:
    """Yield the values of the grid: growing factors in both directions, whole steps for whole numbers, and the sign."""
    if number.value == 0:
        yield from _ZERO_CHANGES if not offset else ()
        return
    if number.is_whole:
        largest = max(4, int(abs(number.value) * (_MAX_FACTOR - 1)))
        differences = range(1, min(largest, 24) + 1) if not offset else ()
        yield from (number.value + sign * difference for difference in differences for sign in (1, -1))
        return
    for level in range(1, int(math.log(_MAX_FACTOR) / step) + 1):
        size = (level - offset) * step
        yield number.value * math.exp(size)
        yield number.value * math.exp(-size)
    if not offset:
        yield -number.value
        # Only a round value may pass, which the grid does not contain.
        sizes = (abs(number.value) * _MAX_FACTOR, abs(number.value) / _MAX_FACTOR)
        round_values = (each for each in _ROUND_VALUES if sizes[1] <= each <= sizes[0] and each != abs(number.value))
        yield from (math.copysign(each, number.value) for each in round_values)


def _list_far_values(number: ProgramNumber) -> Iterator[float]:
    if number.value:
        yield from (number.value * factor for factor in _FAR_FACTORS)
    else:
        yield from _ZERO_CHANGES
