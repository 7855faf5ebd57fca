"""Publishing of grades: the newest regrade of a submission becomes its standing grade, which students can see.

Works on a batch or on one submission. Staff-only and unjudged grades are held back and counted. A preview is available.
``service.operations.regrades`` owns the transactions.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass

from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from service.store.engine import now
from service.store.grades import current_grades, overrides, statements
from service.store.locks import lock_jobs, lock_submissions
from service.store.queue.pool_progress import estimate_completion_seconds
from service.store.states import UNFINISHED, JobState, Standing
from service.store.tables.grades import CriterionResultRow
from service.store.tables.submissions import Job, SubmissionRow


@dataclass(frozen=True, slots=True)
class PublicationCounts:
    """Number of newly published grades, of replaced grades, and of those left out by reason."""

    published: int
    replaced: int
    unfinished: int
    dead: int
    staff_only: int
    unjudged: int
    provisional: int = 0


@dataclass(frozen=True, slots=True)
class PublicationPreview:
    """Preview of a publication, with the number of students affected.

    ``completion_seconds`` is the estimated CPU time after which the provisional grades are exact.
    """

    counts: PublicationCounts
    students: int
    completion_seconds: float


def publish_batch(
    session: Session, batch_id: str, *, actor: str, includes_held_back: bool = False
) -> PublicationCounts:
    """Publish the standing grades of a batch. The newest regrade of each submission becomes its standing grade first.

    Grades that are suspect or over a limit are not published. Those with an unjudged criterion, and provisional ones,
    are held back unless ``includes_held_back``.
    """
    return _publish_grades(
        session, _select_batch_submissions(batch_id), actor=actor, includes_held_back=includes_held_back
    )


def publish_grade(session: Session, job_id: str, *, actor: str, includes_held_back: bool = False) -> PublicationCounts:
    """Publish the grade of one submission, selected by a job, like ``publish_batch``."""
    return _publish_grades(
        session, select(Job.submission_id).where(Job.id == job_id), actor=actor, includes_held_back=includes_held_back
    )


def preview_publication(session: Session, batch_id: str) -> PublicationPreview:
    """Return the effect of ``publish_batch`` without grades that are held back. Read-only."""
    submission_ids = _select_batch_submissions(batch_id)
    gradings = session.scalars(_select_gradings(submission_ids)).all()
    plan = _build_plan(session, gradings, submission_ids, includes_held_back=False)
    completion_seconds = estimate_completion_seconds(session, [job for job in gradings if job.provisional])
    return PublicationPreview(plan.counts, len({job.enrolment_id for job in plan.released}), completion_seconds)


def count_unpublished_regrades(session: Session, batch_id: str) -> int:
    """Return the number of submissions of a batch with a finished regrade that is not published yet."""
    is_proposed = (Job.standing == Standing.PROPOSED, *current_grades.IS_TRUSTED)
    query = (
        select(Job.submission_id)
        .where(Job.submission_id.in_(_select_batch_submissions(batch_id)), *is_proposed)
        .distinct()
    )
    return len(session.scalars(query).all())


@dataclass(frozen=True, slots=True)
class _Plan:
    """Jobs to release, jobs that become standing, and jobs that they replace."""

    released: list[Job]
    standing: list[Job]
    outdated: list[Job]
    counts: PublicationCounts


def _select_batch_submissions(batch_id: str) -> Select[int]:
    return select(Job.submission_id).where(Job.batch_id == batch_id)


def _publish_grades(
    session: Session, submission_ids: Select[int], *, actor: str, includes_held_back: bool
) -> PublicationCounts:
    current_time = now(session)
    lock_submissions(session, SubmissionRow.id.in_(submission_ids))
    lock_jobs(session, Job.submission_id.in_(submission_ids))
    # Jobs that were read before the lock may have changed.
    gradings = session.scalars(_select_gradings(submission_ids).execution_options(populate_existing=True)).all()
    plan = _build_plan(session, gradings, submission_ids, includes_held_back=includes_held_back)
    for job in plan.outdated:
        job.standing = Standing.KEPT
    # The database rejects a second standing job of a submission, even within a transaction.
    session.flush()
    for job in plan.standing:
        job.standing = Standing.STANDS
    for job in plan.released:
        job.published_at, job.published_by = current_time, actor
    statements.state_publication(session, [job.id for job in plan.released])
    return plan.counts


def _select_gradings(submission_ids: Select[int]) -> Select[Job]:
    query = select(Job).where(Job.submission_id.in_(submission_ids), Job.standing != Standing.KEPT)
    return query.order_by(Job.queued_at, Job.id)


def _build_plan(
    session: Session, gradings: Sequence[Job], submission_ids: Select[int], *, includes_held_back: bool
) -> _Plan:
    jobs_by_submission: dict[int, list[Job]] = {}
    for job in gradings:
        jobs_by_submission.setdefault(job.submission_id, []).append(job)
    over_limit = (SubmissionRow.id.in_(submission_ids), SubmissionRow.staff_only.is_not(None))
    hidden_submissions = set(session.scalars(select(SubmissionRow.id).where(*over_limit)))
    unjudged_ids = set() if includes_held_back else _load_unjudged_jobs(session, submission_ids)
    provisional_ids = set() if includes_held_back else {job.id for job in gradings if job.provisional}
    held_back_ids = unjudged_ids | provisional_ids
    released_jobs, proposed_jobs, outdated_jobs, remaining_jobs = [], [], [], []
    for submission_id, jobs in jobs_by_submission.items():
        standing_job, replaced_jobs = _choose_standing_job(jobs, held_back_ids)
        outdated_jobs += replaced_jobs
        remaining_jobs += [job for job in jobs if job not in replaced_jobs]
        if standing_job is not None and standing_job.standing is Standing.PROPOSED:
            proposed_jobs.append(standing_job)
        if standing_job is not None and standing_job.published_at is None and submission_id not in hidden_submissions:
            released_jobs.append(standing_job)
    counts = PublicationCounts(
        len(released_jobs),
        len(proposed_jobs),
        sum(job.state in UNFINISHED and not job.whole_pools for job in remaining_jobs),
        sum(job.state is JobState.DEAD for job in remaining_jobs),
        len(hidden_submissions),
        sum(job.id in unjudged_ids and job.published_at is None for job in remaining_jobs),
        sum(job.id in provisional_ids and job.published_at is None for job in remaining_jobs),
    )
    return _Plan(released_jobs, proposed_jobs, outdated_jobs, counts)


def _choose_standing_job(jobs: Sequence[Job], held_back_ids: Set[str]) -> tuple[Job | None, list[Job]]:
    """Return the new standing job of a submission, and the jobs that it replaces.

    The newest trusted regrade replaces the standing job, regardless of its age, and every older proposal. Ungraded and
    ``held_back_ids`` jobs remain proposals.
    """
    trusted_jobs = [job for job in jobs if current_grades.is_trusted(job) and job.id not in held_back_ids]
    proposed_jobs = [job for job in trusted_jobs if job.standing is Standing.PROPOSED]
    if not proposed_jobs:
        return next((job for job in trusted_jobs if job.standing is Standing.STANDS), None), []
    newest_job = proposed_jobs[-1]
    return newest_job, [
        job
        for job in jobs
        if job is not newest_job and (job.standing is Standing.STANDS or job.queued_at <= newest_job.queued_at)
    ]


def _load_unjudged_jobs(session: Session, submission_ids: Select[int]) -> set[str]:
    """Return the jobs of these submissions with a criterion that was neither judged nor set by staff."""
    query = (
        select(CriterionResultRow.job_id)
        .join(Job, CriterionResultRow.job_id == Job.id)
        .where(Job.submission_id.in_(submission_ids), overrides.match_unjudged())
    )
    return set(session.scalars(query))
