"""Webhooks of a course and the state of their deliveries.

``webhook_events.py`` defines the events; the web server sends them.
"""

from __future__ import annotations

import secrets
from collections.abc import Collection
from dataclasses import dataclass
from datetime import datetime
from urllib.parse import urlsplit

from sqlalchemy import func, select, update
from sqlalchemy.orm import Session

from service.store.engine import now
from service.store.tables.courses import Delivery, Webhook
from service.store.webhook_events import WebhookEvent
from sim.errors import UsageError

MAX_URL_LENGTH = 1000
MAX_WEBHOOKS = 20


@dataclass(frozen=True, slots=True)
class WebhookLine:
    """A webhook, as its course sees it."""

    id: str
    url: str
    events: tuple[str, ...]
    created_at: datetime


@dataclass(frozen=True, slots=True)
class DeliveryLine:
    """A delivery, sent or pending."""

    id: str
    webhook_id: str
    event: str
    made_at: datetime
    due_at: datetime | None  # None: given up
    attempts: int
    delivered_at: datetime | None
    error: str | None


def create_webhook(session: Session, course_id: int, url: str, events: Collection[str]) -> tuple[WebhookLine, str]:
    """Create a webhook and the secret that signs its deliveries, which is returned only once.

    Raises UsageError for an invalid address or event, or if the course has too many webhooks.
    """
    _check_url(url)
    event_names = [event.value for event in WebhookEvent]
    if not events or not set(events) <= set(event_names):
        raise UsageError(f"events: expected some of {', '.join(event_names)}")
    is_active = (Webhook.course_id == course_id, Webhook.revoked_at.is_(None))
    if (session.scalar(select(func.count()).select_from(Webhook).where(*is_active)) or 0) >= MAX_WEBHOOKS:
        raise UsageError(f"this course has {MAX_WEBHOOKS} webhooks; revoke one first")
    secret = secrets.token_hex(32)
    chosen_events = [event for event in event_names if event in events]
    row = Webhook(course_id=course_id, url=url, secret=secret, events=chosen_events, created_at=now(session))
    session.add(row)
    session.flush()
    return _build_line(row), secret


def list_webhooks(session: Session, course_id: int) -> list[WebhookLine]:
    """Return the active webhooks of a course, oldest first."""
    conditions = (Webhook.course_id == course_id, Webhook.revoked_at.is_(None))
    return [
        _build_line(row) for row in session.scalars(select(Webhook).where(*conditions).order_by(Webhook.created_at))
    ]


def revoke_webhook(session: Session, course_id: int, webhook_id: str) -> bool:
    """Revoke a webhook and its pending deliveries. Returns False if the course does not have it."""
    row = session.get(Webhook, webhook_id)
    if row is None or row.course_id != course_id or row.revoked_at is not None:
        return False
    row.revoked_at = now(session)
    is_pending = (Delivery.webhook_id == webhook_id, Delivery.delivered_at.is_(None))
    session.execute(update(Delivery).where(*is_pending).values(due_at=None, error="the webhook was revoked"))
    return True


def list_deliveries(
    session: Session, course_id: int, limit: int, cursor: tuple[datetime, str] | None
) -> list[DeliveryLine]:
    """Return deliveries of a course, newest first, after the one with this time and id."""
    query = select(Delivery).join(Webhook, Delivery.webhook_id == Webhook.id).where(Webhook.course_id == course_id)
    if cursor is not None:
        same_time = (Delivery.made_at == cursor[0]) & (Delivery.id > cursor[1])
        query = query.where((Delivery.made_at < cursor[0]) | same_time)
    return [
        DeliveryLine(
            row.id,
            row.webhook_id,
            row.event,
            row.made_at,
            row.due_at,
            row.attempts,
            row.delivered_at,
            row.error,
        )
        for row in session.scalars(query.order_by(Delivery.made_at.desc(), Delivery.id).limit(limit))
    ]


def _check_url(url: str) -> None:
    try:
        parts = urlsplit(url)
        is_valid = parts.scheme in ("http", "https") and parts.hostname and parts.port != 0
    except ValueError:
        is_valid = False
    if not is_valid or not url.isascii() or not url.isprintable() or " " in url or len(url) > MAX_URL_LENGTH:
        raise UsageError("url: expected http:// or https:// with a name, in ASCII")
    if parts.username is not None or parts.fragment:
        raise UsageError("url: expected neither a user nor a fragment in it")


def _build_line(row: Webhook) -> WebhookLine:
    return WebhookLine(row.id, row.url, tuple(row.events), row.created_at)
