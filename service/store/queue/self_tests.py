"""Self-test results of workers: the last pass of each process, and the quarantine after a failure.

A quarantined worker claims no jobs. Its grades since the last pass are run again by other workers.
``service.queue.self_test`` runs the test.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy import delete, or_, select
from sqlalchemy.orm import Session

from service.store import audit
from service.store.engine import Store, now, retry_conflicts
from service.store.grades import current_grades, statements
from service.store.locks import lock_jobs, lock_submissions
from service.store.queue import jobs
from service.store.states import BatchState, JobQueue, Standing
from service.store.tables.installation import SelfTest, Worker
from service.store.tables.submissions import Batch, Job, SubmissionRow
from service.version import GRADER_VERSION, hash_grader

_RETENTION = timedelta(days=30)


@dataclass(frozen=True, slots=True)
class QuarantineEffects:
    """Effects of a quarantine: requeued jobs, suspect grades, and the jobs that repeat them."""

    taken_back: int
    suspect: tuple[str, ...]
    again: tuple[str, ...]


@retry_conflicts
def record_pass(store: Store, worker: str, process: int) -> None:
    """Record that this process of the worker passed the self-test now."""
    with store.transaction() as session:
        current_time = now(session)
        _lock_worker(session, worker, current_time).self_tested_at = current_time
        query = select(SelfTest).where(SelfTest.worker == worker, SelfTest.process == process)
        row = session.scalar(query)
        if row is None:
            session.add(SelfTest(worker=worker, process=process, right_at=current_time))
        else:
            row.right_at = current_time


@retry_conflicts
def quarantine_worker(store: Store, worker: str, reason: str) -> QuarantineEffects:
    """Quarantine a worker: it can neither claim nor finish jobs, and its doubtful grades are run again.

    The jobs that it owns are requeued. Grades since the last passed self-test of their process are kept, but marked as
    suspect and no longer published. Does nothing for a worker that is already in quarantine.
    """
    with store.transaction() as session:
        current_time = now(session)
        row = _lock_worker(session, worker, current_time)
        if row.quarantined_at is not None:
            return QuarantineEffects(0, (), ())
        row.self_tested_at = row.quarantined_at = current_time
        row.reason = reason
        # A concurrent finish waits for this row, or is already committed and visible below.
        session.flush()
        requeued_count = jobs.requeue_worker_jobs(session, worker, current_time)
        sentence = f"the worker {worker} was found to grade wrongly: {reason}"
        suspect_jobs = _load_suspects(session, worker)
        reruns = [_build_rerun(session, job) for job in suspect_jobs if job.standing is not Standing.KEPT]
        published_submissions = {job.submission_id for job in suspect_jobs if job.published_at is not None}
        for job in suspect_jobs:
            job.suspect, job.standing = sentence, Standing.KEPT
            job.published_at = job.published_by = None
        session.flush()
        statements.state_withdrawal(session, published_submissions, sentence)
        rerun_ids = tuple(jobs.enqueue(session, job, current_time) for job in reruns)
        suspect_ids = tuple(job.id for job in suspect_jobs)
        audit.record_action(
            session,
            worker,
            "quarantine",
            "worker",
            worker,
            reason=reason,
            suspect=list(suspect_ids),
            again=list(rerun_ids),
        )
        return QuarantineEffects(requeued_count, suspect_ids, rerun_ids)


def _lock_worker(session: Session, name: str, current_time: datetime) -> Worker:
    """Return the worker's row, locked, creating it if necessary."""
    row = session.scalar(select(Worker).where(Worker.name == name).with_for_update(key_share=True))
    if row is None:
        _delete_old(session, current_time)
        row = Worker(
            name=name,
            grader_version=GRADER_VERSION,
            grader_sha256=hash_grader(),
            first_at=current_time,
            self_tested_at=current_time,
        )
        session.add(row)
        session.flush()
    return row


def _delete_old(session: Session, current_time: datetime) -> None:
    old_workers = select(Worker.name).where(Worker.self_tested_at < current_time - _RETENTION)
    for statement in (
        delete(SelfTest).where(SelfTest.worker.in_(old_workers)),
        delete(Worker).where(Worker.name.in_(old_workers)),
    ):
        session.execute(statement, execution_options={"synchronize_session": False})


def _load_suspects(session: Session, worker: str) -> Sequence[Job]:
    """Return the grades of the worker since its last passed self-test, with all their copies."""
    last_pass = (
        select(SelfTest.right_at)
        .where(SelfTest.worker == worker, SelfTest.process == Job.process)
        .correlate(Job)
        .scalar_subquery()
    )
    is_graded = (Job.worker == worker, *current_grades.IS_TRUSTED, Job.copied_from.is_(None))
    own_grades = select(Job.id).where(*is_graded, or_(last_pass.is_(None), Job.finished_at > last_pass))
    own_ids = session.scalars(own_grades).all()
    is_suspect = or_(Job.id.in_(own_ids), Job.copied_from.in_(own_ids))
    lock_submissions(session, SubmissionRow.id.in_(select(Job.submission_id).where(is_suspect)))
    lock_jobs(session, is_suspect)
    query = select(Job).where(is_suspect).order_by(Job.queued_at, Job.id)
    return session.scalars(query.execution_options(populate_existing=True)).all()


def _build_rerun(session: Session, job: Job) -> Job:
    """Create, without queueing, a new job that replaces a suspect one."""
    is_cancelled = job.batch_id is not None and session.get_one(Batch, job.batch_id).state is BatchState.CANCELLED
    return Job(
        submission_id=job.submission_id,
        assignment_version_id=job.assignment_version_id,
        enrolment_id=job.enrolment_id,
        # Jobs of a cancelled batch never start, but this one was graded before.
        batch_id=None if is_cancelled else job.batch_id,
        lane=JobQueue(job.lane),
        max_attempts=job.max_attempts,
        regrade_of=job.id,
        standing=job.standing,
    )
