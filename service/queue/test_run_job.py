"""Processing of one test run, or one request of a notebook, from claim to result, after a notification.

Independent of Celery; ``tasks.py`` calls it with the objects that the pool child keeps.
"""

from __future__ import annotations

import structlog

from service.grading.trial_runner import TrialRunner
from service.notebook_engine.stored_requests import unpack_request
from service.queue.lease_keeper import LeaseKeeper
from service.queue.notebook_job import perform_stored_request
from service.reports.replay.document import compress_replay
from service.settings import Settings
from service.store.courses.assignment_versions import assignment_from_bytes
from service.store.engine import Store
from service.store.queue import test_runs
from service.store.queue.test_runs import ClaimedTestRun
from service.test_runs import RunResult, build_single_trial_assignment, execute_test_run
from sim.errors import Cancelled, HostError, UsageError
from sim.recording import Verdict
from submissions.stored_submission import unpack_submission

_log = structlog.get_logger(__name__)


def run_next_test(store: Store, settings: Settings, runner: TrialRunner) -> bool:
    """Run the oldest test run, if there is one. Return False if a host fault ended it."""
    claim = test_runs.claim_test_run(store, settings.lease_seconds)
    if claim is None:
        return True
    with structlog.contextvars.bound_contextvars(test_run=claim.id, attempt=claim.attempt):
        try:
            _run_claimed(store, settings, runner, claim)
        except Cancelled as error:
            _log.info("test_run.stopped", reason=str(error))
        except UsageError as error:
            test_runs.finish_test_run(store, claim, {"refused": str(error)}, None)
        except Exception:
            # This is never the student's fault: their faults are returned as verdicts.
            _log.exception("test_run.host_error")
            test_runs.fail_test_run(
                store,
                claim,
                "The test run failed because of a problem on the server, not in your program. Try again in a minute.",
            )
            return False
    return True


def _run_claimed(store: Store, settings: Settings, runner: TrialRunner, claim: ClaimedTestRun) -> None:
    with store.reading() as session:
        packed, content = test_runs.load_program(session, claim.id)
    short_wait_store = store.with_short_wait()

    def renew() -> None:
        if not test_runs.renew_lease(short_wait_store, claim, settings.lease_seconds):
            raise Cancelled("another worker has claimed it")

    with LeaseKeeper(renew, settings.lease_seconds, settings.job_seconds) as keeper:
        stored = unpack_request(packed)
        if stored is None:
            result = _run_program(packed, content, runner, keeper)
        else:
            document = perform_stored_request(stored, store, runner, keeper.check)
            result = RunResult(Verdict.FINISHED, {}, compress_replay(document))
    test_runs.finish_test_run(store, claim, result.words, result.replay)


def _run_program(packed: bytes, content: bytes, runner: TrialRunner, keeper: LeaseKeeper) -> RunResult:
    """Return the result of a test run."""
    assignment = assignment_from_bytes(content)
    single_trial = build_single_trial_assignment(assignment)
    if single_trial is None:
        raise UsageError(f"{assignment.id} has no test runs, because it has no visible robot run.")
    result = execute_test_run(unpack_submission(packed), single_trial, runner, lambda _: keeper.check())
    if result.verdict is Verdict.HOST_ERROR:
        raise HostError("a trial ended because of a machine fault")
    return result
