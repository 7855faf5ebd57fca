"""Processing of one job from claim to stored marks, and of one job's plots, after a notification.

Independent of Celery; ``tasks.py`` calls it with the objects that the pool child keeps.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timedelta
from enum import Enum
from typing import TypeVar

import structlog
from sqlalchemy.exc import DBAPIError

from service.grading.grade import Grade
from service.grading.grader import GradingProgress, grade
from service.grading.pools.drawing import PoolExtent
from service.grading.trial_runner import TrialRunner
from service.plotting import draw_plots
from service.queue.earlier_recordings import judge_earlier_recordings
from service.queue.lease_keeper import LeaseKeeper
from service.settings import Settings
from service.store.batches import stored_requests
from service.store.engine import Store
from service.store.grades import plots, results
from service.store.installation import load_secret
from service.store.queue import jobs, pool_completions
from sim.errors import Cancelled, HostError, UsageError
from sim.recording import Verdict
from sim.recording_values import collect_faults

_log = structlog.get_logger(__name__)
Result = TypeVar("Result")


class GradingOutcome(Enum):
    """The outcome of a notification."""

    NOTHING_DUE = "nothing due"
    GRADED = "graded"
    STOPPED = "stopped"  # cancelled, or claimed by another worker
    UNUSABLE = "unusable"  # the job is dead: no attempt could grade it
    HOST_FAULT = "host fault"  # the job is retried, or dead


def grade_next_job(store: Store, settings: Settings, runner: TrialRunner, worker: str) -> GradingOutcome:
    """Claim the next job, grade it and store its marks.

    Raises only for problems with the database; every other failure of a claimed job is stored in its row.
    """
    claim = jobs.claim_job(store, worker, settings.lease_seconds)
    if claim is None:
        return GradingOutcome.NOTHING_DUE
    with structlog.contextvars.bound_contextvars(job=claim.job_id, attempt=claim.attempt, worker=worker):
        try:
            _grade_job(store, settings, runner, claim)
        except Cancelled as error:
            _log.info("job.stopped", reason=str(error))
            return GradingOutcome.STOPPED
        except UsageError as error:
            reason = str(error)
            _apply_unless_fenced(lambda: jobs.give_up_job(store, claim, reason))
            return GradingOutcome.UNUSABLE
        except Exception as error:
            # This is never the student's fault: their faults are returned as verdicts.
            _log.exception("job.host_error")
            reason = str(error) if isinstance(error, HostError) else f"{type(error).__name__}: {error}"
            _apply_unless_fenced(
                lambda: jobs.fail_job(store, claim, reason, jobs.RetryPolicy(settings.backoff_seconds))
            )
            return GradingOutcome.HOST_FAULT
        return GradingOutcome.GRADED


def plot_next_job(store: Store, settings: Settings) -> str | None:
    """Draw and store the plots that have been due the longest. Returns the id of their job; None if none is due."""
    job_id = plots.claim_plots(store, settings.job_seconds)
    if job_id is None:
        return None
    with store.reading() as session:
        original_grade = results.load_original_grade(session, job_id)
        request = stored_requests.load_grading_request(session, job_id)
    drawn_plots = draw_plots(original_grade, request.assignment, request.submission)
    _retry_while_unreachable(lambda: plots.store_plots(store, job_id, drawn_plots), settings.lease_seconds)
    return job_id


def _grade_job(store: Store, settings: Settings, runner: TrialRunner, claim: jobs.Claim) -> None:
    if jobs.finish_job_from_cache(store, claim):
        _log.info("job.copied")
        return
    progress = _Progress(claim)
    with store.reading() as session:
        grading_request = stored_requests.load_grading_request(session, claim.job_id)
        runs_whole_pools = pool_completions.is_completion(session, claim.job_id)
    short_wait_store = store.with_short_wait()
    with LeaseKeeper(
        lambda: jobs.renew_lease(short_wait_store, claim, settings.lease_seconds, progress.share),
        settings.lease_seconds,
        settings.job_seconds,
    ) as keeper:

        def observe(progress_report: GradingProgress) -> None:
            progress.update_trials(progress_report)
            keeper.check()

        new_grade = grade(
            grading_request.submission,
            grading_request.assignment,
            secret=load_secret(store),
            observe=observe,
            runner=runner,
            extent=PoolExtent.WHOLE if runs_whole_pools else PoolExtent.UNTIL_DECIDED,
        )
        # Marks made after the time limit may lack interrupted trials.
        keeper.check()
        graded_at = progress.estimate_database_time()
        for result in new_grade.criteria:
            if result.unjudged:
                _log.error("criterion.unjudged", criterion=result.id, cause=result.unjudged)
        _check_for_host_error(new_grade)
        prepared_grade = results.prepare_grade(new_grade)
        explaining_files = judge_earlier_recordings(
            store, claim.job_id, new_grade, grading_request.assignment, keeper.check
        )
        prepared_grade = replace(prepared_grade, files=[*prepared_grade.files, *explaining_files])
    # The work is done, so a short outage of the database must not lose it.
    _retry_while_unreachable(
        lambda: jobs.finish_job(store, claim, prepared_grade, graded_at, progress.trials_at), settings.lease_seconds
    )
    _log.info("job.graded", verdict=new_grade.verdict.value, seconds=round(progress.seconds, 3))


def _check_for_host_error(new_grade: Grade) -> None:
    """Raise HostError if this machine, and not the student, ended a trial."""
    broken_trial = next((trial for trial in new_grade.trials if trial.verdict is Verdict.HOST_ERROR), None)
    if broken_trial is not None:
        faults = collect_faults(broken_trial.recording)
        raise HostError(faults[0].message if faults else "a trial ended because of a machine fault")


class _Progress:
    """Progress of the grading of a job since its claim."""

    def __init__(self, claim: jobs.Claim) -> None:
        self._claimed_at = claim.at
        self._begun = time.monotonic()
        self.share = 0.0
        self.trials_at: datetime | None = None  # time at which the last trial ended

    @property
    def seconds(self) -> float:
        """Seconds since the claim."""
        return time.monotonic() - self._begun

    def estimate_database_time(self) -> datetime:
        """Return the time by the database's clock, because this machine's clock may be wrong."""
        return self._claimed_at + timedelta(seconds=self.seconds)

    def update_trials(self, progress_report: GradingProgress) -> None:
        """Update the number of finished trials."""
        self.share = progress_report.trials_done / max(1, progress_report.trials)
        if progress_report.trials_done >= progress_report.trials and self.trials_at is None:
            self.trials_at = self.estimate_database_time()


def _retry_while_unreachable(change: Callable[[], Result], seconds: float) -> Result:
    """Repeat a change while the database is unreachable, for at most ``seconds``."""
    deadline = time.monotonic() + seconds
    pause = 0.1
    while True:
        try:
            return change()
        except DBAPIError as error:
            if time.monotonic() + pause > deadline:
                raise
            _log.warning("database.retry", error=str(error))
            time.sleep(pause)
            pause = min(2 * pause, 5.0)


def _apply_unless_fenced(change: Callable[[], object]) -> None:
    try:
        change()
    except jobs.LeaseLost as error:
        _log.info("job.stopped", reason=str(error))
