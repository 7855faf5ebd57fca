"""Grades that are let stand and released to students: of a batch, or of one submission.

The newest regrade takes the place of what stood; what may not be seen, or was not judged, is held back and counted.
What would be done can be asked first.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import asdict, dataclass

from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from service.store import audit, outbox
from service.store.engine import Store, now
from service.store.grades import overrides
from service.store.models import Batch, CriterionResultRow, Enrolment, Job, SubmissionRow
from service.store.states import UNFINISHED, JobState, Standing
from sim.errors import UsageError


@dataclass(frozen=True, slots=True)
class Published:
    """How many grades are published now that were not, how many took another's place, and what was left out."""

    published: int
    replaced: int
    unfinished: int
    dead: int
    staff_only: int
    unjudged: int


@dataclass(frozen=True, slots=True)
class Publication:
    """What would be published, and of how many students."""

    counts: Published
    students: int


def publish(store: Store, batch_id: str, *, actor: str, anyway: bool = False) -> Published:
    """Let the newest regrade of each submission of the batch stand, and publish every grade that then stands.

    One that is suspect, of a submission over a limit, or with a criterion that could not be judged is not published,
    the last unless ``anyway``. Raises UsageError for an unknown batch.
    """
    with store.transaction() as session:
        if session.get(Batch, batch_id) is None:
            raise UsageError(f"there is no batch {batch_id}")
        result = _publish(session, _of_batch(batch_id), actor=actor, anyway=anyway)
        audit.note(session, actor, "publish", "batch", batch_id, **_worth_noting(result))
        if result.published:
            course_id = session.get_one(Batch, batch_id).course_id
            outbox.grades_published(session, course_id, batch=batch_id, published=result.published)
        return result


def publish_one(store: Store, job_id: str, *, actor: str, anyway: bool = False) -> Published:
    """The same for the submission of one job alone. Raises UsageError for an unknown job."""
    with store.transaction() as session:
        if session.get(Job, job_id) is None:
            raise UsageError(f"there is no grade {job_id}")
        ids = select(Job.submission_id).where(Job.id == job_id)
        result = _publish(session, ids, actor=actor, anyway=anyway)
        audit.note(session, actor, "publish", "job", job_id, **_worth_noting(result))
        if result.published:
            course_id = session.get_one(Enrolment, session.get_one(Job, job_id).enrolment_id).course_id
            outbox.grades_published(session, course_id, grade=job_id, published=result.published)
        return result


def would_publish(session: Session, batch_id: str) -> Publication:
    """What ``publish`` would do to a batch now, without ``anyway``. Only reads."""
    ids = _of_batch(batch_id)
    plan = _plan(session, session.scalars(_gradings(ids)).all(), ids, anyway=False)
    return Publication(plan.counts, len({job.enrolment_id for job in plan.released}))


def unpublished_regrades(session: Session, batch_id: str) -> int:
    """How many submissions of a batch have a regrade that is done and does not stand yet."""
    proposed = (Job.standing == Standing.PROPOSED, Job.state == JobState.DONE, Job.suspect.is_(None))
    query = select(Job.submission_id).where(Job.submission_id.in_(_of_batch(batch_id)), *proposed).distinct()
    return len(session.scalars(query).all())


@dataclass(frozen=True, slots=True)
class _Plan:
    """The jobs that are released, those that stand from then on, and those that give way to them."""

    released: list[Job]
    standing: list[Job]
    outdated: list[Job]
    counts: Published


def _of_batch(batch_id: str) -> Select[int]:
    return select(Job.submission_id).where(Job.batch_id == batch_id)


def _publish(session: Session, ids: Select[int], *, actor: str, anyway: bool) -> Published:
    at = now(session)
    plan = _plan(session, session.scalars(_gradings(ids).with_for_update()).all(), ids, anyway=anyway)
    for job in plan.outdated:
        job.standing = Standing.KEPT
    for job in plan.standing:
        job.standing = Standing.STANDS
    for job in plan.released:
        job.published_at, job.published_by = at, actor
    return plan.counts


def _gradings(ids: Select[int]) -> Select[Job]:
    query = select(Job).where(Job.submission_id.in_(ids), Job.standing != Standing.KEPT)
    return query.order_by(Job.queued_at, Job.id)


def _plan(session: Session, gradings: Sequence[Job], ids: Select[int], *, anyway: bool) -> _Plan:
    of_submission: dict[int, list[Job]] = {}
    for job in gradings:
        of_submission.setdefault(job.submission_id, []).append(job)
    over = (SubmissionRow.id.in_(ids), SubmissionRow.staff_only.is_not(None))
    hidden = set(session.scalars(select(SubmissionRow.id).where(*over)))
    unjudged = set() if anyway else _unjudged(session, ids)
    released, standing, outdated, left = [], [], [], []
    for submission_id, jobs in of_submission.items():
        stands, giving_way = _stands(jobs, unjudged)
        outdated += giving_way
        left += [job for job in jobs if job not in giving_way]
        if stands is not None and stands.standing is Standing.PROPOSED:
            standing.append(stands)
        if stands is not None and stands.published_at is None and submission_id not in hidden:
            released.append(stands)
    counts = Published(
        len(released),
        len(standing),
        sum(job.state in UNFINISHED for job in left),
        sum(job.state is JobState.DEAD for job in left),
        len(hidden),
        sum(job.id in unjudged and job.published_at is None for job in left),
    )
    return _Plan(released, standing, outdated, counts)


def _stands(jobs: Sequence[Job], unjudged: Set[str]) -> tuple[Job | None, list[Job]]:
    """The grade of one submission that stands from now on, and those that give way to it.

    What is older than the newest regrade gives way to it; one not graded yet, or ``unjudged``, stays a proposal.
    """
    done = [job for job in jobs if job.state is JobState.DONE and job.suspect is None and job.id not in unjudged]
    proposed = [job for job in done if job.standing is Standing.PROPOSED]
    if not proposed:
        return next((job for job in done if job.standing is Standing.STANDS), None), []
    newest = proposed[-1]
    return newest, [job for job in jobs if job is not newest and job.queued_at <= newest.queued_at]


def _worth_noting(result: Published) -> dict[str, int]:
    return {name: count for name, count in asdict(result).items() if count or name in ("published", "replaced")}


def _unjudged(session: Session, ids: Select[int]) -> set[str]:
    """The jobs for these submissions that have a criterion that could not be judged, nor was set by hand."""
    query = (
        select(CriterionResultRow.job_id)
        .join(Job, CriterionResultRow.job_id == Job.id)
        .where(Job.submission_id.in_(ids), overrides.waits_for_judgement())
    )
    return set(session.scalars(query))
