"""Processing of a claimed request of a notebook: a run to its first unanswered question, or a check.

The worker never waits for a notebook. ``test_run_job.py`` claims the request and stores the result.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from responders.outside_responder import OutsideQuestion, Unanswered
from responders.sandbox.meter import JobLimits, JobMeter
from responders.sandbox.running_child import ChildLimits
from service.grading.standalone_runs import RunLimits
from service.grading.trial_runner import TrialRunner
from service.notebook_engine.checks import check_submission
from service.notebook_engine.magic_calls import perform_magic
from service.notebook_engine.stored_requests import StoredCheck, StoredMagic
from service.store.courses.assignment_versions import load_version
from service.store.engine import Store
from sim.errors import HostError, UsageError
from sim.recording import Verdict
from submissions.assignment.limits import DEFAULT_LIMITS

#: Limits of one run. The run of a cell is repeated for each answer, so they are lower than those of a grading.
_PROGRAM = ChildLimits(3.0, DEFAULT_LIMITS.program_memory_mb << 20)
_JOB = JobLimits(kept_bytes=16 << 20, cpu_seconds=6.0, sleep_seconds=5.0)


def perform_stored_request(
    stored: StoredMagic | StoredCheck, store: Store, runner: TrialRunner, check: Callable[[], None]
) -> dict[str, Any]:
    """Return the result of a request as data. ``check`` is called often, and raises to end the work.

    Raises:
        UsageError: The request cannot be performed.
        HostError: The machine failed.
    """
    if isinstance(stored, StoredCheck):
        with store.reading() as session:
            assignment = load_version(session, stored.version_id)
        if assignment is None:
            raise UsageError("the assignment was changed at the same time; check the notebook again.")
        return check_submission(stored.submission, assignment, runner, lambda _: check())
    limits, meter = RunLimits(program=_PROGRAM), JobMeter(_JOB, check)
    reply = perform_magic(stored.request, runner, _build_answerer(stored), limits, meter)
    if reply.run is not None and reply.run["verdict"] == Verdict.HOST_ERROR.value:
        raise HostError("a run ended because of a machine fault")
    return reply.to_json()


def _build_answerer(stored: StoredMagic) -> Callable[[OutsideQuestion], str | None]:
    def answer(question: OutsideQuestion) -> str | None:
        if question.number < len(stored.answers):
            return stored.answers[question.number]
        raise Unanswered(question)

    return answer
