"""Regrades of a batch or submission, publishing, and grading of submissions over a limit."""

from __future__ import annotations

from dataclasses import asdict
from decimal import Decimal
from typing import TYPE_CHECKING, Literal

from sqlalchemy.orm import Session

from service.grading.class_statistics import PASS_SHARE
from service.operations.batches import load_course_assignment
from service.operations.context import Actor, Service
from service.operations.errors import Conflict
from service.operations.lookup import load_names_for_actor, require_batch, require_course, require_job
from service.store import audit, webhook_events
from service.store.batches import publishing, regrade_changes, regrades
from service.store.batches.changes import Change as Change
from service.store.batches.changes import ChangesSummary as ChangesSummary
from service.store.batches.changes import CriterionChange as CriterionChange
from service.store.batches.changes import summarise_changes as summarise_changes
from service.store.batches.publishing import PublicationCounts as PublicationCounts
from service.store.batches.publishing import PublicationPreview as PublicationPreview
from service.store.batches.regrade_changes import ChangesPage as ChangesPage
from service.store.batches.regrades import RegradeBatch as RegradeBatch
from service.store.batches.stage_texts import PART_LABELS as PART_LABELS
from service.store.batches.stage_texts import STAGE_LABELS as STAGE_LABELS
from service.store.batches.stage_texts import STAGE_MEANINGS as STAGE_MEANINGS
from service.store.courses.assignment_versions import FrozenAssignment, freeze_assignment
from service.store.engine import now, retry_conflicts
from service.store.queue import jobs
from service.store.states import JobQueue, Role

if TYPE_CHECKING:
    from submissions.assignment.definition import Assignment


def regrade_batch(
    service: Service, actor: Actor, course_id: int, batch_id: str, assignment: Assignment | str = ""
) -> RegradeBatch:
    """Queue a regrade of every graded submission of a batch and notify the workers.

    The old grades are in effect until the regrades are published.

    Args:
        service: The installation.
        actor: An instructor of the course, or the machine.
        course_id: The course.
        batch_id: The batch to grade again.
        assignment: The assignment to grade against, or its id in the course or the catalogue. Empty: the version that
            each submission was graded against.

    Raises:
        NotFound: The course does not have the batch, or the actor does not instruct it.
        UsageError: There is nothing to grade again, or the assignment does not exist.
    """
    frozen_assignment = _freeze_assignment(service, actor, course_id, assignment)
    regrade = _regrade_batch(service, actor, course_id, batch_id, frozen_assignment)
    service.notifier.grade(JobQueue.BATCH, regrade.jobs)
    return regrade


def regrade_one(service: Service, actor: Actor, course_id: int, job_id: str, assignment: Assignment | str = "") -> str:
    """Queue a regrade of one submission and notify the workers. Returns the id of the new job.

    ``assignment`` and errors as in ``regrade_batch``.
    """
    frozen_assignment = _freeze_assignment(service, actor, course_id, assignment)
    new_job_id = _regrade_one(service, actor, course_id, job_id, frozen_assignment)
    service.notifier.grade(JobQueue.INTERACTIVE)
    return new_job_id


def list_changes(
    service: Service, actor: Actor, course_id: int, batch_id: str, pass_share: Decimal = PASS_SHARE
) -> list[Change]:
    """Return the changes of a batch of regrades, by student; empty for any other batch.

    ``pass_share`` is the share of all marks that students need to pass. Raises NotFound.
    """
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        require_batch(session, course_id, batch_id)
        return regrade_changes.load_changes(session, batch_id, hidden_names, pass_share)


def show_changes_summary(
    service: Service, actor: Actor, course_id: int, batch_id: str, pass_share: Decimal = PASS_SHARE
) -> ChangesSummary:
    """Return the numbers of changes of a batch of regrades, by stage and boundary. Raises NotFound."""
    return summarise_changes(list_changes(service, actor, course_id, batch_id, pass_share), pass_share)


@retry_conflicts
def publish(
    service: Service, actor: Actor, course_id: int, batch_id: str, *, includes_held_back: bool = False
) -> PublicationCounts:
    """Publish the newest grades of a batch, which become the standing grades.

    ``includes_held_back`` includes grades with unjudged criteria. Raises NotFound.
    """
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        require_batch(session, course_id, batch_id)
        publication_counts = publishing.publish_batch(
            session, batch_id, actor=actor.name, includes_held_back=includes_held_back
        )
        return _record_publication(session, actor, course_id, "batch", batch_id, publication_counts)


@retry_conflicts
def publish_one(
    service: Service, actor: Actor, course_id: int, job_id: str, *, includes_held_back: bool = False
) -> PublicationCounts:
    """Publish the newest grade of one submission, which becomes its standing grade.

    ``includes_held_back`` permits a grade with unjudged criteria. Raises NotFound.
    """
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        require_job(session, course_id, job_id)
        publication_counts = publishing.publish_grade(
            session, job_id, actor=actor.name, includes_held_back=includes_held_back
        )
        return _record_publication(session, actor, course_id, "job", job_id, publication_counts)


def preview_publication(service: Service, actor: Actor, course_id: int, batch_id: str) -> PublicationPreview:
    """Return the effect of publishing a batch now, without unjudged grades. Raises NotFound."""
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        require_batch(session, course_id, batch_id)
        return publishing.preview_publication(session, batch_id)


def grade_over_limit(service: Service, actor: Actor, course_id: int, job_id: str) -> None:
    """Queue a submission that is over a limit, and notify the workers.

    Raises:
        NotFound: The course does not have the grade, or the actor does not instruct it.
        Conflict: The submission is not waiting for staff.
    """
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        require_job(session, course_id, job_id)
        if not jobs.queue_over_limit_job(session, job_id, now(session)):
            raise Conflict("this submission is not waiting for staff to start grading")
        audit.record_action(session, actor.name, "grade over limit", "job", job_id)
    service.notifier.grade(JobQueue.BATCH)


@retry_conflicts
def _regrade_batch(
    service: Service, actor: Actor, course_id: int, batch_id: str, frozen_assignment: FrozenAssignment | None
) -> RegradeBatch:
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        original = require_batch(session, course_id, batch_id)
        regrade = regrades.queue_regrades(
            session, original, frozen_assignment, max_attempts=service.settings.max_attempts
        )
        audit.record_action(
            session, actor.name, "regrade", "batch", batch_id, as_batch=regrade.batch_id, grades=regrade.jobs
        )
        return regrade


@retry_conflicts
def _regrade_one(
    service: Service, actor: Actor, course_id: int, job_id: str, frozen_assignment: FrozenAssignment | None
) -> str:
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        requested_job = require_job(session, course_id, job_id)
        proposal = regrades.queue_regrade(
            session, requested_job, frozen_assignment, max_attempts=service.settings.max_attempts
        )
        audit.record_action(session, actor.name, "regrade", "job", proposal.regrade_of or job_id, as_job=proposal.id)
        return proposal.id


def _freeze_assignment(
    service: Service, actor: Actor, course_id: int, assignment: Assignment | str
) -> FrozenAssignment | None:
    """Return the assignment to grade against, frozen before the transaction."""
    if isinstance(assignment, str):
        if not assignment:
            return None
        with service.store.reading() as session:
            require_course(session, actor, course_id, Role.INSTRUCTOR)
            assignment = load_course_assignment(session, course_id, assignment)
    return freeze_assignment(assignment)


def _record_publication(
    session: Session,
    actor: Actor,
    course_id: int,
    subject: Literal["batch", "job"],
    subject_id: str,
    publication_counts: PublicationCounts,
) -> PublicationCounts:
    """Record a publication in the activity log, and notify the course's webhooks if a grade was released."""
    counts = {
        name: count for name, count in asdict(publication_counts).items() if count or name in ("published", "replaced")
    }
    audit.record_action(session, actor.name, "publish", subject, subject_id, **counts)
    if publication_counts.published:
        subject_key = {"batch" if subject == "batch" else "grade": subject_id}
        webhook_events.emit_grades_published(session, course_id, **subject_key, published=publication_counts.published)
    return publication_counts
