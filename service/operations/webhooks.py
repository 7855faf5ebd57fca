"""Webhooks of a course: addresses that receive events, and the deliveries to them."""

from __future__ import annotations

from collections.abc import Collection
from datetime import datetime

from service.operations.context import Actor, Service
from service.operations.errors import NotFound
from service.operations.lookup import require_course
from service.store import audit
from service.store.people import webhooks
from service.store.people.webhooks import MAX_URL_LENGTH as MAX_URL_LENGTH
from service.store.people.webhooks import DeliveryLine, WebhookLine
from service.store.states import Role
from service.store.webhook_events import WebhookEvent as WebhookEvent


def list_webhooks(service: Service, actor: Actor, course_id: int) -> list[WebhookLine]:
    """Return the webhooks of a course, oldest first. Raises NotFound."""
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        return webhooks.list_webhooks(session, course_id)


def create(
    service: Service, actor: Actor, course_id: int, url: str, events: Collection[WebhookEvent]
) -> tuple[WebhookLine, str]:
    """Create a webhook and the secret that signs its deliveries, which is returned only once.

    Raises NotFound, and UsageError for an invalid address or too many webhooks in the course.
    """
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        line, secret = webhooks.create_webhook(session, course_id, url, [event.value for event in events])
        audit.record_action(session, actor.name, "create webhook", "course", str(course_id), webhook=line.id, url=url)
        return line, secret


def revoke(service: Service, actor: Actor, course_id: int, webhook_id: str) -> None:
    """Revoke a webhook and its pending deliveries. Raises NotFound."""
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        if not webhooks.revoke_webhook(session, course_id, webhook_id):
            raise NotFound("There is no such page or item, or you have no access to it.")
        audit.record_action(session, actor.name, "revoke webhook", "course", str(course_id), webhook=webhook_id)


def list_deliveries(
    service: Service, actor: Actor, course_id: int, limit: int, cursor: tuple[datetime, str] | None = None
) -> list[DeliveryLine]:
    """Return deliveries of a course, newest first, after the one with this time and id. Raises NotFound."""
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        return webhooks.list_deliveries(session, course_id, limit, cursor)
