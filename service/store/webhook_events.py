"""Webhook events: written in the transaction of the change that they report, then claimed and sent.

The web server sends them; ``webhooks.py`` stores the addresses. Courses without webhooks write nothing.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from enum import StrEnum
from typing import Any

from sqlalchemy import ColumnElement, Select, and_, delete, func, or_, select, update
from sqlalchemy.orm import Session

from service.store.engine import Store, now, retry_conflicts
from service.store.states import UNFINISHED, JobState
from service.store.tables.courses import Delivery, OpenAssignment, Webhook
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Batch, Job, SubmissionRow

#: Time after which a delivery is given up.
RETRY_PERIOD = timedelta(days=1)
_FIRST_WAIT = timedelta(seconds=15)
_MAX_WAIT = timedelta(hours=2)
#: Time to send a claimed delivery, before it can be claimed again.
_LEASE = timedelta(minutes=2)
_RETENTION = timedelta(days=30)


class WebhookEvent(StrEnum):
    """Events that webhooks can subscribe to."""

    GRADE_FINISHED = "grade.finished"
    BATCH_FINISHED = "batch.finished"
    GRADES_PUBLISHED = "grades.published"
    APPEAL_OPENED = "appeal.opened"


@dataclass(frozen=True, slots=True)
class ClaimedDelivery:
    """A claimed delivery that is to be sent now."""

    id: str
    url: str
    secret: str
    event: str
    payload: Any
    made_at: datetime
    attempt: int  # 1 is the first


def emit_grade_finished(session: Session, job_id: str) -> None:
    """Report that a job is graded, and that its batch is finished if this was the last one."""
    if hooks := _load_job_webhooks(session, job_id):
        _add_grade_finished(session, hooks, job_id)
        _add_batch_finished(session, hooks, session.scalar(select(Job.batch_id).where(Job.id == job_id)))


def emit_grade_copied(session: Session, job_id: str) -> None:
    """Report that a job got the grade of an identical one, during the intake of its batch."""
    if hooks := _load_job_webhooks(session, job_id):
        _add_grade_finished(session, hooks, job_id)


def emit_job_ended(session: Session, job_id: str) -> None:
    """Report a batch as finished if its last job ended without a grade."""
    if hooks := _load_job_webhooks(session, job_id):
        _add_batch_finished(session, hooks, session.scalar(select(Job.batch_id).where(Job.id == job_id)))


def emit_batch_finished(session: Session, batch_id: str) -> None:
    """Report a batch as finished if all its jobs have ended."""
    course_id = select(Batch.course_id).where(Batch.id == batch_id).scalar_subquery()
    if hooks := _load_webhooks(session, select(Webhook).where(Webhook.course_id == course_id)):
        _add_batch_finished(session, hooks, batch_id)


def emit_superseded_batches(session: Session, submissions: Select[int], cancelled_at: datetime) -> None:
    """Report the batches of jobs that were cancelled at this time for newer submissions."""
    conditions = (Job.submission_id.in_(submissions), Job.state == JobState.CANCELLED, Job.finished_at == cancelled_at)
    for batch_id in session.scalars(
        select(Job.batch_id).where(*conditions, Job.batch_id.is_not(None)).distinct()
    ).all():
        emit_batch_finished(session, str(batch_id))


def emit_grades_published(session: Session, course_id: int, **event_data: object) -> None:
    """Report that grades were released to their students."""
    _add_deliveries(session, _load_course_webhooks(session, course_id), WebhookEvent.GRADES_PUBLISHED, event_data)


def emit_appeal_opened(session: Session, submission_id: int, appeal_id: int) -> None:
    """Report that a student opened an appeal."""
    course_query = select(Enrolment.course_id).join(SubmissionRow, SubmissionRow.enrolment_id == Enrolment.id)
    course_id = session.scalars(course_query.where(SubmissionRow.id == submission_id)).one()
    payload = {"appeal": appeal_id, "submission": submission_id}
    _add_deliveries(session, _load_course_webhooks(session, course_id), WebhookEvent.APPEAL_OPENED, payload)


@retry_conflicts
def claim_deliveries(store: Store, limit: int) -> list[ClaimedDelivery]:
    """Claim the oldest due delivery of up to ``limit`` webhooks; no other process gets them until the claim expires.

    Each webhook has at most one claimed delivery. Webhooks of courses with fewer claimed deliveries come first.
    """
    with store.reading() as session:
        if not _choose_webhooks(session, now(session), 1):
            return []
    with store.transaction() as session:
        current_time = now(session)
        is_abandoned = (
            Delivery.delivered_at.is_(None),
            Delivery.due_at.is_(None),
            Delivery.made_at < current_time - _RETENTION,
        )
        session.execute(
            delete(Delivery).where(or_(Delivery.delivered_at < current_time - _RETENTION, and_(*is_abandoned)))
        )
        chosen_query = select(Webhook).where(Webhook.id.in_(_choose_webhooks(session, current_time, limit)))
        hooks = session.scalars(
            chosen_query.order_by(Webhook.id).with_for_update(skip_locked=True, key_share=True)
        ).all()
        # Another process may have claimed a delivery of a webhook before it was locked here.
        busy_webhooks = _load_busy_webhooks(session, current_time)
        return [
            delivery
            for hook in hooks
            if hook.id not in busy_webhooks
            and (delivery := _claim_oldest_delivery(session, hook, current_time)) is not None
        ]


def _choose_webhooks(session: Session, current_time: datetime, limit: int) -> list[str]:
    """Return up to ``limit`` webhooks with due deliveries and without claimed ones."""
    busy = _load_busy_webhooks(session, current_time)
    query = select(Webhook.id, Webhook.course_id).join(Delivery, Delivery.webhook_id == Webhook.id)
    query = query.where(*_match_due(current_time), Webhook.id.not_in(busy)).group_by(Webhook.id, Webhook.course_id)
    claimed_by_course = Counter(busy.values())
    ranked = []
    for webhook_id, course_id in session.execute(query.order_by(func.min(Delivery.due_at), Webhook.id)):
        ranked.append((claimed_by_course[course_id], webhook_id))
        claimed_by_course[course_id] += 1
    return [webhook_id for _, webhook_id in sorted(ranked, key=lambda each: each[0])[:limit]]


def _load_busy_webhooks(session: Session, current_time: datetime) -> dict[str, int]:
    """Return the webhooks with a claimed delivery, with their courses."""
    # A delivery that waits for its next attempt has the error of the previous one.
    is_claimed = (
        Delivery.delivered_at.is_(None),
        Delivery.due_at > current_time,
        Delivery.attempts > 0,
        Delivery.error.is_(None),
    )
    query = select(Webhook.id, Webhook.course_id).join(Delivery, Delivery.webhook_id == Webhook.id)
    return dict(session.execute(query.where(*is_claimed)).all())


def _claim_oldest_delivery(session: Session, hook: Webhook, current_time: datetime) -> ClaimedDelivery | None:
    oldest_query = select(Delivery).where(*_match_due(current_time), Delivery.webhook_id == hook.id)
    delivery = session.scalar(oldest_query.order_by(Delivery.due_at, Delivery.id).limit(1))
    if delivery is None:
        return None
    attempt = delivery.attempts + 1
    is_this_delivery = Delivery.id == delivery.id
    session.execute(
        update(Delivery).where(is_this_delivery).values(attempts=attempt, due_at=current_time + _LEASE, error=None)
    )
    return ClaimedDelivery(
        delivery.id, hook.url, hook.secret, delivery.event, delivery.payload, delivery.made_at, attempt
    )


def _match_due(at: datetime) -> tuple[ColumnElement[bool], ...]:
    return (Delivery.delivered_at.is_(None), Delivery.due_at <= at)


@retry_conflicts
def record_delivery(store: Store, delivery: ClaimedDelivery) -> None:
    """Record that a delivery succeeded."""
    with store.transaction() as session:
        values = {"delivered_at": now(session), "error": None}
        session.execute(update(Delivery).where(Delivery.id == delivery.id).values(**values))


@retry_conflicts
def record_failure(store: Store, delivery: ClaimedDelivery, error: str) -> None:
    """Record that a delivery failed: it is retried later, or given up after a day."""
    delay = min(_FIRST_WAIT * 2 ** min(delivery.attempt - 1, 20), _MAX_WAIT)
    with store.transaction() as session:
        retry_at = now(session) + delay
        due_at = retry_at if retry_at < delivery.made_at + RETRY_PERIOD else None
        is_claimed = (Delivery.id == delivery.id, Delivery.attempts == delivery.attempt, Delivery.due_at.is_not(None))
        session.execute(update(Delivery).where(*is_claimed).values(due_at=due_at, error=error[:500]))


def _add_grade_finished(session: Session, hooks: Sequence[Webhook], job_id: str) -> None:
    query = select(Job.batch_id, Job.standing, SubmissionRow.id, SubmissionRow.assignment, SubmissionRow.attempt)
    grade_row = session.execute(
        query.join(SubmissionRow, Job.submission_id == SubmissionRow.id).where(Job.id == job_id)
    )
    batch_id, grade_standing, submission_id, assignment, attempt = grade_row.one()
    payload: dict[str, object] = {"job": job_id, "batch": batch_id, "standing": grade_standing.value}
    payload |= {"submission": submission_id, "assignment": assignment, "attempt": attempt}
    _add_deliveries(session, hooks, WebhookEvent.GRADE_FINISHED, payload)


def _load_job_webhooks(session: Session, job_id: str) -> Sequence[Webhook]:
    query = select(Webhook).join(Enrolment, Enrolment.course_id == Webhook.course_id)
    return _load_webhooks(session, query.join(Job, Job.enrolment_id == Enrolment.id).where(Job.id == job_id))


def _load_course_webhooks(session: Session, course_id: int) -> Sequence[Webhook]:
    return _load_webhooks(session, select(Webhook).where(Webhook.course_id == course_id))


def _load_webhooks(session: Session, query: Select[Webhook]) -> Sequence[Webhook]:
    return session.scalars(query.where(Webhook.revoked_at.is_(None)).order_by(Webhook.id)).all()


def _add_batch_finished(session: Session, hooks: Sequence[Webhook], batch_id: str | None) -> None:
    if batch_id is None:
        return
    if session.get_bind().dialect.name == "postgresql":
        # If two workers end the last two jobs at once, the second must see the change of the first.
        number = int.from_bytes(hashlib.sha256(batch_id.encode()).digest()[:8], signed=True)
        session.execute(select(func.pg_advisory_xact_lock(number)))
    accepts_submissions = (OpenAssignment.batch_id == batch_id, OpenAssignment.closed_at.is_(None))
    if session.scalar(select(OpenAssignment.id).where(*accepts_submissions)) is not None:
        return
    count_query = select(Job.state, func.count()).where(Job.batch_id == batch_id, Job.suspect.is_(None))
    states = dict(session.execute(count_query.group_by(Job.state)).all())
    if states and not any(state in UNFINISHED for state in states):
        payload = {"batch": batch_id, "states": {state.value: count for state, count in states.items()}}
        _add_deliveries(session, hooks, WebhookEvent.BATCH_FINISHED, payload)


def _add_deliveries(
    session: Session, hooks: Sequence[Webhook], event: WebhookEvent, event_data: Mapping[str, object]
) -> None:
    for hook in hooks:
        if event.value in hook.events:
            current_time = now(session)
            payload = {"course": hook.course_id, "data": dict(event_data)}
            session.add(
                Delivery(
                    webhook_id=hook.id, event=event.value, payload=payload, made_at=current_time, due_at=current_time
                )
            )
