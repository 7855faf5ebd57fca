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
from service.store.grades import current_grades, overrides
from service.store.locks import lock_jobs, lock_submissions
from service.store.models import CriterionResultRow, Job, SubmissionRow
from service.store.states import UNFINISHED, JobState, Standing


@dataclass(frozen=True, slots=True)
class PublicationCounts:
    """Number of newly published grades, of replaced grades, and of those left out by reason."""

    published: int
    replaced: int
    unfinished: int
    dead: int
    staff_only: int
    unjudged: int


@dataclass(frozen=True, slots=True)
class PublicationPreview:
    """Preview of a publication, with the number of students affected."""

    counts: PublicationCounts
    students: int


def publish_batch(session: Session, batch_id: str, *, actor: str, anyway: bool = False) -> PublicationCounts:
    """Publish the standing grades of a batch. The newest regrade of each submission becomes its standing grade first.

    Grades that are suspect, over a limit or have an unjudged criterion are not published. ``anyway`` includes those
    with an unjudged criterion.
    """
    return _publish_grades(session, _select_batch_submissions(batch_id), actor=actor, anyway=anyway)


def publish_grade(session: Session, job_id: str, *, actor: str, anyway: bool = False) -> PublicationCounts:
    """Publish the grade of one submission, selected by a job, like ``publish``."""
    return _publish_grades(session, select(Job.submission_id).where(Job.id == job_id), actor=actor, anyway=anyway)


def preview_publication(session: Session, batch_id: str) -> PublicationPreview:
    """Return the effect of ``publish`` on a batch, without ``anyway``. Read-only."""
    ids = _select_batch_submissions(batch_id)
    plan = _build_plan(session, session.scalars(_select_gradings(ids)).all(), ids, anyway=False)
    return PublicationPreview(plan.counts, len({job.enrolment_id for job in plan.released}))


def count_unpublished_regrades(session: Session, batch_id: str) -> int:
    """Return the number of submissions of a batch with a finished regrade that is not published yet."""
    proposed = (Job.standing == Standing.PROPOSED, *current_grades.IS_TRUSTED)
    query = (
        select(Job.submission_id)
        .where(Job.submission_id.in_(_select_batch_submissions(batch_id)), *proposed)
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


def _publish_grades(session: Session, ids: Select[int], *, actor: str, anyway: bool) -> PublicationCounts:
    at = now(session)
    lock_submissions(session, SubmissionRow.id.in_(ids))
    lock_jobs(session, Job.submission_id.in_(ids))
    # Jobs that were read before the lock may have changed.
    gradings = session.scalars(_select_gradings(ids).execution_options(populate_existing=True)).all()
    plan = _build_plan(session, gradings, ids, anyway=anyway)
    for job in plan.outdated:
        job.standing = Standing.KEPT
    # The database rejects a second standing job of a submission, even within a transaction.
    session.flush()
    for job in plan.standing:
        job.standing = Standing.STANDS
    for job in plan.released:
        job.published_at, job.published_by = at, actor
    return plan.counts


def _select_gradings(ids: Select[int]) -> Select[Job]:
    query = select(Job).where(Job.submission_id.in_(ids), Job.standing != Standing.KEPT)
    return query.order_by(Job.queued_at, Job.id)


def _build_plan(session: Session, gradings: Sequence[Job], ids: Select[int], *, anyway: bool) -> _Plan:
    of_submission: dict[int, list[Job]] = {}
    for job in gradings:
        of_submission.setdefault(job.submission_id, []).append(job)
    over = (SubmissionRow.id.in_(ids), SubmissionRow.staff_only.is_not(None))
    hidden = set(session.scalars(select(SubmissionRow.id).where(*over)))
    unjudged = set() if anyway else _load_unjudged_jobs(session, ids)
    released, standing, outdated, left = [], [], [], []
    for submission_id, jobs in of_submission.items():
        stands, giving_way = _choose_standing_job(jobs, unjudged)
        outdated += giving_way
        left += [job for job in jobs if job not in giving_way]
        if stands is not None and stands.standing is Standing.PROPOSED:
            standing.append(stands)
        if stands is not None and stands.published_at is None and submission_id not in hidden:
            released.append(stands)
    counts = PublicationCounts(
        len(released),
        len(standing),
        sum(job.state in UNFINISHED for job in left),
        sum(job.state is JobState.DEAD for job in left),
        len(hidden),
        sum(job.id in unjudged and job.published_at is None for job in left),
    )
    return _Plan(released, standing, outdated, counts)


def _choose_standing_job(jobs: Sequence[Job], unjudged: Set[str]) -> tuple[Job | None, list[Job]]:
    """Return the new standing job of a submission, and the jobs that it replaces.

    The newest trusted regrade replaces the standing job, regardless of its age, and every older proposal. Ungraded and
    ``unjudged`` jobs remain proposals.
    """
    done = [job for job in jobs if current_grades.is_trusted(job) and job.id not in unjudged]
    proposed = [job for job in done if job.standing is Standing.PROPOSED]
    if not proposed:
        return next((job for job in done if job.standing is Standing.STANDS), None), []
    newest = proposed[-1]
    return newest, [
        job
        for job in jobs
        if job is not newest and (job.standing is Standing.STANDS or job.queued_at <= newest.queued_at)
    ]


def _load_unjudged_jobs(session: Session, ids: Select[int]) -> set[str]:
    """Return the jobs of these submissions with a criterion that was neither judged nor set by staff."""
    query = (
        select(CriterionResultRow.job_id)
        .join(Job, CriterionResultRow.job_id == Job.id)
        .where(Job.submission_id.in_(ids), overrides.match_unjudged())
    )
    return set(session.scalars(query))
