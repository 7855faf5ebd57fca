"""The rerun engine: runs trials of a grade again with ingredients exchanged, within a budget, and judges the result.

Equal reruns are run once. Nothing here is marked or stored, and the same reruns give the same results.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal

from responders.sandbox.meter import JobLimits, JobMeter
from service.grading.grade import CriterionResult, Grade, TrialResult
from service.grading.judging.judge_declaration import StaticAnalysis
from service.grading.judging.limited_judging import compute_judging_limits, judge_within_limits
from service.grading.notebook_trial import NotebookTrial
from service.grading.reruns.exchanges import (
    ChangedLine,
    Exchange,
    GivenPart,
    PartName,
    apply_exchanges,
)
from service.grading.run_plan import RunPlan
from service.grading.static_analysis import analyse
from service.grading.trial_runner import TrialRunner
from service.grading.trial_specs import build_trial_spec
from sim.errors import RobomarkError, UsageError
from sim.floors import Floor
from sim.recording import Recording
from sim.robot import Robot, get_robot
from submissions.assignment.definition import Assignment, Trial
from submissions.criteria import Criterion
from submissions.criteria.code import PythonCheck
from submissions.seeds import PUBLIC_SECRET, SeedSource

_VISIBLE = "visible"
#: How much dearer than the dearest run so far the next one may be.
_SAFETY = 1.3
#: CPU seconds of a run with a changed line: at least so many, and as many times those of the longest other run.
_MIN_CHANGED_SECONDS, _MAX_CHANGED_FACTOR = 0.6, 2.0


@dataclass(frozen=True, slots=True)
class Budget:
    """What the search for one cause may cost: trials run, CPU seconds, and real seconds in which children sleep."""

    runs: int = 60
    cpu_seconds: float = 5.0
    sleep_seconds: float = 5.0


DEFAULT_BUDGET = Budget()


@dataclass(frozen=True, slots=True)
class Spent:
    """What the search for one cause has cost so far."""

    runs: int
    cpu_seconds: float


class RunTooLong(RobomarkError):
    """Raised instead of a rerun with a changed line that computes for much longer than the program did."""


class BudgetSpent(RobomarkError):
    """Raised instead of a rerun that the budget does not pay for."""


@dataclass(frozen=True, slots=True)
class RerunOutcome:
    """The result of one criterion with the reruns in place of the recorded trials.

    ``passed`` and ``failed`` are indices of trials in the grade; ``failed_before`` are those that failed when they were
    recorded. ``is_whole`` says whether every trial that the criterion judges was run again, so that ``marks`` are those
    of the exchange.
    """

    marks: Decimal
    max_marks: Decimal
    passed: frozenset[int]
    failed: frozenset[int]
    failed_before: frozenset[int]
    is_whole: bool


class OutcomesOnDemand(Mapping[str, RerunOutcome]):
    """The outcomes of criteria. Each is judged when it is first needed, because most are never needed."""

    def __init__(self, criteria: Sequence[str], judge: Callable[[str], RerunOutcome]) -> None:
        self._criteria, self._judge = criteria, judge
        self._outcomes: dict[str, RerunOutcome] = {}

    def __getitem__(self, criterion: str) -> RerunOutcome:
        if criterion not in self._outcomes:
            self._outcomes[criterion] = self._judge(criterion)
        return self._outcomes[criterion]

    def __iter__(self) -> Iterator[str]:
        return iter(self._criteria)

    def __len__(self) -> int:
        return len(self._criteria)


@dataclass(frozen=True, slots=True)
class Rerun:
    """Trials that were run again with the same exchanges: old and new recordings by trial, outcomes by criterion."""

    exchanges: tuple[Exchange, ...]
    originals: Mapping[int, Recording] = field(repr=False)
    recordings: Mapping[int, Recording] = field(repr=False)
    outcomes: Mapping[str, RerunOutcome]

    @property
    def trials(self) -> tuple[int, ...]:
        """The indices in the grade of the trials that were run again."""
        return tuple(self.recordings)

    def passes(self, criterion: str) -> bool:
        """Return whether a criterion loses nothing that it lost before.

        It gets all marks, or, if only some trials were run again, each of them passes, and one failed before.
        """
        outcome = self.outcomes[criterion]
        if outcome.is_whole:
            return outcome.marks >= outcome.max_marks
        judged_trials = (outcome.passed | outcome.failed) & self.recordings.keys()
        return bool(judged_trials & outcome.failed_before) and not judged_trials & outcome.failed

    def loses(self, criterion: str) -> bool:
        """Return whether a criterion still loses marks in a trial that was run again."""
        outcome = self.outcomes[criterion]
        if outcome.is_whole:
            return outcome.marks < outcome.max_marks
        return bool(outcome.failed & self.recordings.keys())


class RerunEngine:
    """Runs trials of one grade again. ``visibilities`` are those of the trials that it may run and judge.

    Raises UsageError for a grade of another submission or assignment than the ``plan``.
    """

    def __init__(
        self,
        runner: TrialRunner,
        plan: RunPlan,
        grade: Grade,
        *,
        secret: SeedSource = PUBLIC_SECRET,
        budget: Budget = DEFAULT_BUDGET,
        visibilities: frozenset[str] = frozenset({_VISIBLE}),
        heartbeat: Callable[[], None] = lambda: None,
    ) -> None:
        if grade.submission != plan.submission or grade.assignment_version != plan.assignment.version:
            raise UsageError("the grade is of another submission or assignment, expected those of the plan")
        self._runner, self._plan, self._heartbeat = runner, plan, heartbeat
        # Statements are recorded for the marks of the grade only.
        self._trial_plan = plan.to_hidden_plan()
        self.assignment: Assignment = plan.assignment
        self._failed_before = {
            result.id: frozenset(each.trial for each in result.evidence if not each.passed) for result in grade.criteria
        }
        self.lost_criteria = {each.id: each for each in grade.criteria if each.marks < each.max_marks}
        self.results: Mapping[int, TrialResult] = {
            index: result for index, result in enumerate(grade.trials) if result.visibility in visibilities
        }
        self._withheld_scenarios = {each.scenario for each in grade.trials if each.visibility not in visibilities}
        trials = {(trial.scenario.id, trial.index): trial for trial in plan.assignment.trials(secret)}
        self.trials: Mapping[int, Trial] = {
            index: trials[result.scenario, result.index] for index, result in self.results.items()
        }
        if any(result.visibility != _VISIBLE for result in self.results.values()):
            runner.check_trial_isolation()
        self._recordings: dict[tuple[int, tuple[str, ...]], Recording] = {}
        self._reruns: dict[tuple[tuple[int, ...], tuple[str, ...]], Rerun] = {}
        self._longest_seconds = 0.0  # of one run without a changed line, for all causes
        self.start_cause(budget)

    def start_cause(self, budget: Budget = DEFAULT_BUDGET) -> None:
        """Begin with a full budget. Reruns that are known already cost nothing."""
        self._budget, self._runs, self._cpu_seconds, self._sleep_seconds = budget, 0, 0.0, 0.0
        self._dearest_seconds = self._dearest_judging_seconds = 0.0  # of one run, and of judging once

    @property
    def has_exchangeable_parts(self) -> bool:
        """Return whether parts can be exchanged: all were submitted, not as a notebook that is executed."""
        return not isinstance(self._plan.trial, NotebookTrial) and self._plan.missing is None

    def get_source(self, part: PartName) -> str | None:
        """Return the text of a part as it runs; None if the submission does not have it as a file of its own."""
        return self._plan.get_source(part)

    @property
    def robot(self) -> Robot:
        """The robot of all trials."""
        return get_robot(self.assignment.world.robot)

    @property
    def floor(self) -> Floor:
        """The floor of the first trial."""
        return build_trial_spec(next(iter(self.trials.values())), self._trial_plan).floor

    def build_result(self, index: int, recording: Recording) -> TrialResult:
        """Return the result of a trial with another recording."""
        return replace(self.results[index], recording=recording)

    @property
    def spent(self) -> Spent:
        """The costs since the budget was full."""
        return Spent(self._runs, self._cpu_seconds)

    def list_trials(self, criterion: str) -> tuple[int, ...]:
        """Return the indices of the trials that decide the marks of a criterion and that may be run again."""
        return tuple(index for index, each in self.results.items() if self._judges(criterion, each.scenario))

    def can_judge(self, criterion: str) -> bool:
        """Return whether trials alone decide the marks of a criterion, with those that it needs."""
        return all(each.judges_runs for each in self._list_needed(criterion))

    def _judges(self, criterion: str, scenario: str) -> bool:
        """Return whether a criterion, or one that it needs, judges the trials of a scenario."""
        return any(not each.scenarios or scenario in each.scenarios for each in self._list_needed(criterion))

    def _list_needed(self, criterion: str) -> list[Criterion]:
        """Return a criterion and those that it needs the results of."""
        by_id = {each.id: each for each in self.assignment.criteria}
        needed: list[Criterion] = []
        name: str | None = criterion
        while name is not None and name in by_id and by_id[name] not in needed:
            needed.append(by_id[name])
            name = by_id[name].result_needed
        return needed

    def list_failed_trials(self, criterion: str) -> tuple[int, ...]:
        """Return the indices of the trials that a criterion lost marks in and that may be run again."""
        failed_trials = {each.trial for each in self.lost_criteria[criterion].evidence if not each.passed}
        return tuple(index for index in self.list_trials(criterion) if index in failed_trials)

    def rerun_criterion(self, criterion: str, exchanges: Sequence[Exchange]) -> Rerun:
        """Run the trials of a criterion again: first one that it lost marks in, then, if that passes, all.

        If the budget pays for the first trial only, the result has no others. Raises the same errors as ``rerun``.
        """
        judges_each_trial = next(each.judges_each_trial for each in self.assignment.criteria if each.id == criterion)
        trials, failed_trials = self.list_trials(criterion), self.list_failed_trials(criterion)
        if not judges_each_trial or not failed_trials:
            return self.rerun(trials, exchanges)
        first = self.rerun(failed_trials[:1], exchanges)
        if not first.passes(criterion) or len(trials) == 1 or not self._can_pay_for(trials, exchanges):
            return first
        try:
            return self.rerun(trials, exchanges)
        except BudgetSpent:
            return first

    def _can_pay_for(self, trials: Sequence[int], exchanges: Sequence[Exchange]) -> bool:
        """Return whether the rest of the budget probably pays for these trials, by the dearest run so far."""
        keys = tuple(exchange.key for exchange in exchanges)
        count = sum((index, keys) not in self._recordings for index in trials)
        seconds = self._cpu_seconds + self._dearest_judging_seconds + count * _SAFETY * self._dearest_seconds
        return self._runs + count <= self._budget.runs and seconds < self._budget.cpu_seconds

    def rerun(self, trials: Sequence[int], exchanges: Sequence[Exchange]) -> Rerun:
        """Run these trials again with all the exchanges, and judge the criteria with them.

        Raises:
            BudgetSpent: The budget does not pay for it.
            RunTooLong: A program with a changed line computes for too long.
            HostError: The machine failed.
            Exception: Whatever the heartbeat raises.
        """
        keys = tuple(exchange.key for exchange in exchanges)
        known_rerun = self._reruns.get((tuple(trials), keys))
        if known_rerun is not None:
            return known_rerun
        recordings = {index: self._record(index, exchanges, keys) for index in trials}
        rerun = Rerun(
            tuple(exchanges),
            {index: self.results[index].recording for index in trials},
            recordings,
            OutcomesOnDemand(
                tuple(each.id for each in self.assignment.criteria if each.judges_runs),
                lambda criterion: self._judge(criterion, recordings, exchanges),
            ),
        )
        self._reruns[tuple(trials), keys] = rerun
        return rerun

    def _record(self, index: int, exchanges: Sequence[Exchange], keys: tuple[str, ...]) -> Recording:
        known_recording = self._recordings.get((index, keys))
        if known_recording is not None:
            return known_recording
        seconds_left = self._budget.cpu_seconds - self._cpu_seconds - self._dearest_judging_seconds
        sleep_left = self._budget.sleep_seconds - self._sleep_seconds
        # A run that is as dear as the dearest so far must still fit.
        if sleep_left <= 0 or self._runs >= self._budget.runs or seconds_left <= _SAFETY * self._dearest_seconds:
            raise BudgetSpent
        self._runs += 1
        # A changed line can make a loop endless, which must not use up the budget.
        has_changed_line = any(isinstance(each, ChangedLine) for each in exchanges)
        changed_seconds = max(_MIN_CHANGED_SECONDS, _MAX_CHANGED_FACTOR * self._longest_seconds)
        limit = min(seconds_left, changed_seconds) if has_changed_line else seconds_left
        cut = RunTooLong("the changed program computes for too long") if limit < seconds_left else BudgetSpent()
        start = time.process_time()

        def check_budget() -> None:
            self._heartbeat()
            if meter.spent.cpu_seconds + time.process_time() - start > limit:
                raise cut

        meter = JobMeter(JobLimits(cpu_seconds=limit, sleep_seconds=sleep_left), check_budget)
        spec = build_trial_spec(self.trials[index], self._trial_plan)
        spec = apply_exchanges(replace(spec, records_lines=False), exchanges)
        try:
            recording = self._plan.trial.run(spec, self.assignment.world.obstacles, self._runner, meter)
        finally:
            seconds = meter.spent.cpu_seconds + time.process_time() - start
            self._cpu_seconds += seconds
            self._sleep_seconds += meter.spent.sleep_seconds
            if not has_changed_line:
                self._dearest_seconds = max(self._dearest_seconds, seconds)
                self._longest_seconds = max(self._longest_seconds, seconds)
        if meter.spent.cpu_seconds >= limit or meter.spent.sleep_seconds >= sleep_left:
            # The limit may have ended the trial, so its recording proves nothing.
            raise cut
        self._recordings[index, keys] = recording
        return recording

    def _judge(
        self, criterion: str, recordings: Mapping[int, Recording], exchanges: Sequence[Exchange]
    ) -> RerunOutcome:
        """Judge a criterion with those that it needs, in the trials that were run again.

        Criteria that compare trials are judged with all others that may be run again, too.
        """
        start = time.process_time()
        criteria = [each for each in self._list_needed(criterion) if each.judges_runs]
        indices = tuple(recordings if all(each.judges_each_trial for each in criteria) else self.results)
        trials = tuple(
            self.build_result(index, recordings.get(index, self.results[index].recording)) for index in indices
        )
        assignment = replace(self.assignment, criteria=tuple(criteria))
        analysis = self._analyse(assignment, trials, exchanges)
        result, *_ = judge_within_limits(compute_judging_limits(trials), assignment, trials, analysis, self._heartbeat)
        outcome = self._build_outcome(result, indices, recordings)
        judging_seconds = time.process_time() - start
        self._cpu_seconds += judging_seconds
        self._dearest_judging_seconds = max(self._dearest_judging_seconds, judging_seconds)
        return outcome

    def _build_outcome(
        self, result: CriterionResult, indices: Sequence[int], recordings: Mapping[int, Recording]
    ) -> RerunOutcome:
        is_withheld = any(self._judges(result.id, each) for each in self._withheld_scenarios)
        return RerunOutcome(
            result.marks,
            result.max_marks,
            frozenset(indices[each.trial] for each in result.evidence if each.passed),
            frozenset(indices[each.trial] for each in result.evidence if not each.passed),
            self._failed_before.get(result.id, frozenset()),
            not is_withheld and not result.unjudged and set(self.list_trials(result.id)) <= recordings.keys(),
        )

    def _analyse(
        self, assignment: Assignment, trials: Sequence[TrialResult], exchanges: Sequence[Exchange]
    ) -> StaticAnalysis:
        """Return the data that is not in the recordings: the results of the instructor's own checks."""
        given_parts = {each.part for each in exchanges if isinstance(each, GivenPart)}
        missing = None if self._plan.missing in given_parts else self._plan.missing
        checks = tuple(each for each in assignment.criteria if isinstance(each, PythonCheck))
        if not checks:
            return StaticAnalysis(flags=self._plan.flags, missing=missing)
        plan = replace(self._plan, assignment=replace(assignment, criteria=checks), missing=missing)
        return analyse(plan, trials, self._runner, JobMeter(heartbeat=self._heartbeat))
