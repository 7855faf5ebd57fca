"""Search for the causes of lost marks in a stored grade, when no worker has other work.

It explains marks and does not change them, so it never fails a job. A student who waits for a worker interrupts it.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import structlog
from sqlalchemy import exists, select

from service.grading.reruns.grade_causes import add_causes
from service.grading.trial_runner import TrialRunner
from service.settings import Settings
from service.store.batches import stored_requests
from service.store.engine import Store, now
from service.store.grades import causes, results
from service.store.grades.causes import StoredCauses
from service.store.installation import load_secret
from service.store.queue import test_runs
from service.store.states import JobQueue, JobState
from service.store.tables.submissions import Job
from sim.errors import Cancelled, UsageError
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import locate_catalogue_reference
from submissions.bundle import read_submission
from submissions.seeds import choose_secret
from submissions.submission import Submission

_log = structlog.get_logger(__name__)
#: Between two looks for waiting students.
_LOOK_SECONDS = 0.5


def explain_next_grade(store: Store, settings: Settings, runner: TrialRunner) -> str | None:
    """Search the causes of the newest grade that has none, and store them. Returns its id; None if there is none.

    Raises only for problems with the database.
    """
    job_id = causes.claim_unexplained_grade(store)
    if job_id is None:
        return None
    with structlog.contextvars.bound_contextvars(job=job_id):
        try:
            stored_causes = _search_causes(store, job_id, runner, _build_heartbeat(store, settings))
        except _StudentWaits:
            causes.release_grade(store, job_id)
            _log.info("causes.interrupted")
            return job_id
        except Exception:
            # The marks are stored, and a grade without causes is complete.
            _log.exception("causes.failed")
            return job_id
        causes.store_causes(store, job_id, stored_causes)
        _log.info("causes.stored", causes=len(stored_causes.causes))
    return job_id


def is_student_waiting(store: Store) -> bool:
    """Return whether a job or test run waits whose student looks at the page."""
    with store.reading() as session:
        is_due = (Job.state == JobState.QUEUED, Job.lane == JobQueue.INTERACTIVE, Job.due_at <= now(session))
        if session.scalar(select(exists().where(*is_due))):
            return True
    return test_runs.count_due_runs(store) > 0


def _search_causes(store: Store, job_id: str, runner: TrialRunner, heartbeat: Callable[[], None]) -> StoredCauses:
    with store.reading() as session:
        grade = results.load_original_grade(session, job_id)
        request = stored_requests.load_grading_request(session, job_id)
        other_revealed = causes.count_revealed_causes(session, job_id)
        stored_reference = stored_requests.load_reference(session, job_id)
    secret = choose_secret(grade.secret_sha256, load_secret(store))
    if secret is None:
        return StoredCauses(())
    explained = add_causes(
        grade,
        request.submission,
        request.assignment,
        runner,
        reference=stored_reference or _read_catalogue_reference(request.assignment),
        secret=secret,
        reveals=request.assignment.reruns.reveals,
        revealed_before=other_revealed,
        heartbeat=heartbeat,
    )
    revealed = sum(each.is_hidden and not each.for_staff for each in explained.causes)
    return StoredCauses(explained.causes, revealed)


def _read_catalogue_reference(assignment: Assignment) -> Submission | None:
    """Return the catalogue's reference solution; None if the course uses a different version."""
    folder = locate_catalogue_reference(assignment)
    try:
        return None if folder is None else read_submission(folder, required_parts=assignment.parts)
    except UsageError:
        return None


class _StudentWaits(Cancelled):
    """Ends a search, because a student waits for a worker."""


def _build_heartbeat(store: Store, settings: Settings) -> Callable[[], None]:
    deadline = time.monotonic() + settings.job_seconds
    next_look = time.monotonic() + _LOOK_SECONDS

    def check_time() -> None:
        nonlocal next_look
        current_time = time.monotonic()
        if current_time > deadline:
            raise Cancelled("the search for causes took too long")
        if current_time > next_look:
            next_look = current_time + _LOOK_SECONDS
            if is_student_waiting(store):
                raise _StudentWaits("a student waits for a worker")

    return check_time
