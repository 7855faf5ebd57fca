"""Grading of one submission against one assignment: runs every trial and judges every criterion.

``grade`` is a plain function without queue or database. The command line, the workers and the tests call it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol

from responders.repeated_faults import REPLAY_NOTES, FaultReplay, ReplayDiverged
from responders.sandbox.meter import JobLimits, JobMeter
from service.grading.grade import Cost, Grade, TrialResult, build_unjudged_notes
from service.grading.hints import collect_hints
from service.grading.judging.judge_declaration import StaticAnalysis
from service.grading.judging.limited_judging import compute_judging_limits, judge_within_limits
from service.grading.model_training import add_model_answers
from service.grading.pools.drawing import PoolExtent, run_rounds
from service.grading.run_plan import RunPlan, plan_run
from service.grading.static_analysis import analyse
from service.grading.trial_runner import TrialRunner
from service.grading.trial_specs import build_trial_spec
from service.language import translatable
from service.version import GRADER_VERSION
from sim.random_streams import RandomStream
from sim.recording import Recording
from sim.sentences import Sentence
from submissions.assignment.definition import Assignment, Trial
from submissions.seeds import PUBLIC_SECRET, SeedSource
from submissions.submission import PART_FILES, Submission

_MEGABYTE = 1 << 20
_OBSERVE_SECONDS = 1.0
#: The note on trials that ran without a child, for each role in ``REPLAY_NOTES``.
_SPARED_NOTES: Mapping[str, str] = MappingProxyType(
    {
        "robot": translatable(
            "the robot program was not run again in %(count)s of %(trials)s trials: two trials had ended with the same "
            "fault, and the program had the same input and uses no random numbers, so the result would be the same"
        ),
        "responder": translatable(
            "the responder was not run again in %(count)s of %(trials)s trials: two trials had ended with the same "
            "fault, and the program had the same input and uses no random numbers, so the result would be the same"
        ),
    }
)


@dataclass(frozen=True, slots=True)
class GradingProgress:
    """The progress of a grading, in trials."""

    trials_done: int
    trials: int


class ProgressObserver(Protocol):
    """Callback for progress, called after each trial and about once a second. Raises Cancelled to stop the grading."""

    def __call__(self, progress: GradingProgress, /) -> None:
        """Process the progress quickly, because grading waits. Raise Cancelled to stop the grading."""


def _ignore_progress(progress: GradingProgress) -> None:
    """Ignore the progress. The default observer."""


def grade(
    submission: Submission,
    assignment: Assignment,
    *,
    secret: SeedSource = PUBLIC_SECRET,
    observe: ProgressObserver | None = None,
    runner: TrialRunner | None = None,
    extent: PoolExtent = PoolExtent.WHOLE,
    with_hints: bool = True,
) -> Grade:
    """Grade ``submission`` with seeds derived from ``secret``, the secret of the installation.

    Without a ``runner``, one is created for this grading and closed afterwards. ``extent`` says how many trials of
    pools are run. Without ``with_hints``, no hints are searched for, which saves time.

    Raises:
        UsageError: The submission has none of the parts that the assignment needs.
        HostError: This machine failed.
        Exception: Whatever ``observe`` raises.
    """
    if runner is None:
        with TrialRunner() as own_runner:
            return grade(
                submission,
                assignment,
                secret=secret,
                observe=observe,
                runner=own_runner,
                extent=extent,
                with_hints=with_hints,
            )
    plan = plan_run(submission, assignment, secret)
    runner.start_zygotes(plan.processes)
    trials = tuple(assignment.trials(secret)) if plan.program or not plan.missing else ()
    watch = _ProgressReporter(observe or _ignore_progress, len(trials))
    meter = JobMeter(_compute_job_limits(assignment, sum(map(_is_visible, trials))), watch.heartbeat)
    results = run_rounds(
        assignment,
        trials,
        extent,
        run=lambda round_trials: _run_trials(plan, round_trials, len(trials), runner, meter, watch),
        judge_trials=lambda judged_assignment, round_results: judge_within_limits(
            compute_judging_limits(round_results), judged_assignment, round_results, StaticAnalysis(), meter.heartbeat
        ),
    )
    if assignment.training is not None:
        results = add_model_answers(results, plan, assignment.training, runner, meter)
    analysis = analyse(plan, results, runner, meter)
    criteria = judge_within_limits(
        compute_judging_limits(results), assignment, tuple(results), analysis, meter.heartbeat
    )
    return Grade(
        assignment=assignment.id,
        assignment_title=assignment.title,
        assignment_version=assignment.version,
        submission=plan.submission,
        student=submission.student,
        criteria=criteria,
        trials=tuple(results),
        sandbox=results[0].recording.sandbox if results else analysis.sandbox or "no student code ran",
        grader_version=GRADER_VERSION,
        notes=(
            *submission.notes,
            *plan.notes,
            *plan.trial.collect_shared_notes(results),
            *_build_spared_notes(results),
            *build_unjudged_notes(criteria),
        ),
        missing=PART_FILES[plan.missing] if plan.missing else "",
        hints=collect_hints(submission, plan, results, criteria, meter.heartbeat) if with_hints else (),
        secret_sha256=secret.sha256,
        cost=Cost(meter.limits, meter.spent),
    )


def _run_trials(
    plan: RunPlan, trials: Sequence[Trial], total: int, runner: TrialRunner, meter: JobMeter, watch: _ProgressReporter
) -> list[TrialResult]:
    """Run the trials and return the results in the order of ``trials``, which may differ from the order of the runs.

    ``total`` is the number of trials of the assignment, on which the limits depend.
    """
    if not all(map(_is_visible, trials)):
        runner.check_trial_isolation()
    results_by_number: dict[int, TrialResult] = {}
    repeats = FaultReplay()
    for number in _choose_run_order(trials, plan.child_seed):
        trial = trials[number]
        if not _is_visible(trial):
            # Visible trials run within their own limit, so that it does not reveal the number of hidden trials.
            meter.extend(_compute_job_limits(plan.assignment, total))
        results_by_number[number] = TrialResult(
            trial.scenario.id,
            trial.index,
            trial.seed,
            trial.light_noise,
            trial.motor_noise,
            trial.scenario.visibility,
            _record_trial(trial, plan, runner, meter, repeats),
            trial.sweep,
            trial.place,
        )
        watch.count_finished_trial()
    return [results_by_number[number] for number in range(len(trials))]


def _record_trial(trial: Trial, plan: RunPlan, runner: TrialRunner, meter: JobMeter, repeats: FaultReplay) -> Recording:
    """Run one trial, without any child process that would only repeat an earlier fault."""
    spec, obstacles, spent_before = build_trial_spec(trial, plan), plan.assignment.world.obstacles, meter.spent
    with runner.skipping_repeats(repeats):
        try:
            return repeats.record_trial(plan.trial.run(spec, obstacles, runner, meter))
        except ReplayDiverged:
            meter.refund_since(spent_before)
            repeats.record_divergence()
            return repeats.record_trial(plan.trial.run(spec, obstacles, runner, meter))


def _choose_run_order(trials: Sequence[Trial], own_seed: int) -> Sequence[int]:
    """Return the order in which to run the trials: visible ones first, otherwise shuffled for each submission.

    This way, code that counts processes or reads a clock cannot recognise a trial. Visible results are complete before
    the first hidden trial runs, and the order of visible trials does not depend on hidden ones.
    """
    chance = RandomStream(own_seed, "order of trials")
    visible = [number for number, trial in enumerate(trials) if _is_visible(trial)]
    hidden = [number for number, trial in enumerate(trials) if not _is_visible(trial)]
    places = {number: place for place, number in enumerate((*visible, *hidden))}
    return sorted(places, key=lambda number: (not _is_visible(trials[number]), chance.integer(places[number])))


def _is_visible(trial: Trial) -> bool:
    return trial.scenario.visibility == "visible"


def _build_spared_notes(results: Sequence[TrialResult]) -> tuple[str, ...]:
    """Return notes on visible trials that ran without a child. Hidden trials are not counted."""
    visible_notes = [result.recording.notes for result in results if result.visibility == "visible"]
    counts = {role: sum(note in notes for notes in visible_notes) for role, note in REPLAY_NOTES.items()}
    return tuple(
        Sentence(_SPARED_NOTES[role], count=count, trials=len(visible_notes)) for role, count in counts.items() if count
    )


def _compute_job_limits(assignment: Assignment, trials: int) -> JobLimits:
    limits = assignment.limits
    return JobLimits(limits.all_output_mb * _MEGABYTE, limits.compute_total_cpu(trials), limits.all_sleep)


class _ProgressReporter:
    """Reduces the frequent heartbeats of a trial to one observer call a second."""

    def __init__(self, observe: Callable[[GradingProgress], None], trials: int) -> None:
        self._observe = observe
        self._trials = trials
        self._done = 0
        self._last = time.monotonic()

    def heartbeat(self) -> None:
        if time.monotonic() - self._last >= _OBSERVE_SECONDS:
            self._report_progress()

    def count_finished_trial(self) -> None:
        self._done += 1
        self._report_progress()

    def _report_progress(self) -> None:
        self._last = time.monotonic()
        self._observe(GradingProgress(self._done, self._trials))
