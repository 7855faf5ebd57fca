"""API of a course's webhooks and their deliveries."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from fastapi import Depends
from fastapi.responses import Response
from pydantic import BaseModel, Field

from service.operations import webhooks
from service.operations.types import Role
from service.operations.webhooks import WebhookEvent
from service.web.access import RowName
from service.web.api.shapes import Shape, build_example_config
from service.web.api_access import CallerInCourse, require_role
from service.web.api_routes import NO_KEY, After, Limit, Listed, api_router, build_list_page, decode_cursor
from service.web.context import Context

router = api_router("webhooks")
ManageAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "manage"))]


class WebhookShape(Shape):
    """A webhook: an address that receives events."""

    id: str
    url: str
    events: list[WebhookEvent]
    created_at: datetime

    model_config = build_example_config(
        id="5h2n8q0v3w7x",
        url="https://hooks.example.org/robomark",
        events=["grade.finished"],
        created_at="2026-11-02T09:00:00Z",
    )


class NewWebhookShape(WebhookShape):
    """A new webhook, with the secret that signs its deliveries."""

    secret: str = Field(description="Shown only once.")

    model_config = build_example_config(
        id="5h2n8q0v3w7x",
        url="https://hooks.example.org/robomark",
        events=["grade.finished"],
        created_at="2026-11-02T09:00:00Z",
        secret="5f0c...",
    )


class WebhookBody(BaseModel):
    """The address and events of a new webhook."""

    url: str = Field(max_length=webhooks.MAX_URL_LENGTH, examples=["https://hooks.example.org/robomark"])
    events: list[WebhookEvent] = Field(min_length=1, max_length=20)


class DeliveryShape(Shape):
    """A completed, pending or abandoned delivery of an event to a webhook."""

    id: str
    webhook_id: str
    event: WebhookEvent
    made_at: datetime
    due_at: datetime | None = Field(
        description="Time of the next delivery attempt; null if it was delivered or abandoned."
    )
    attempts: int
    delivered_at: datetime | None
    error: str | None

    model_config = build_example_config(
        id="1d6f9k2m4p8r",
        webhook_id="5h2n8q0v3w7x",
        event="grade.finished",
        made_at="2026-11-02T09:00:04Z",
        due_at=None,
        attempts=1,
        delivered_at="2026-11-02T09:00:06Z",
        error=None,
    )


@router.get("/courses/{course_id}/webhooks")
def list_webhooks(access: ManageAccess, context: Context) -> Listed[WebhookShape]:
    """List the webhooks of the course."""
    lines = webhooks.list_webhooks(context.service, access.actor, access.course_id)
    return Listed(items=[WebhookShape.model_validate(each) for each in lines])


@router.post("/courses/{course_id}/webhooks", status_code=201, openapi_extra=dict(NO_KEY))
def create(access: ManageAccess, context: Context, body: WebhookBody) -> NewWebhookShape:
    """Create a webhook. Its secret is returned only once, so this route ignores idempotency keys."""
    line, secret = webhooks.create(context.service, access.actor, access.course_id, body.url, body.events)
    return NewWebhookShape(**WebhookShape.model_validate(line).model_dump(), secret=secret)


@router.delete("/courses/{course_id}/webhooks/{webhook_id}", status_code=204, response_class=Response)
def revoke(access: ManageAccess, context: Context, webhook_id: RowName) -> None:
    """Remove a webhook and cancel its pending deliveries."""
    webhooks.revoke(context.service, access.actor, access.course_id, webhook_id)


@router.get("/courses/{course_id}/deliveries")
def list_deliveries(
    access: ManageAccess, context: Context, limit: Limit = 50, after: After = ""
) -> Listed[DeliveryShape]:
    """List recent and pending deliveries to the course's webhooks, newest first."""
    sort_key = decode_cursor(after, datetime, str)
    cursor = (sort_key[0], sort_key[1]) if sort_key else None
    lines = webhooks.list_deliveries(context.service, access.actor, access.course_id, limit + 1, cursor)
    return build_list_page(
        [DeliveryShape.model_validate(each) for each in lines], limit, lambda each: [each.made_at, each.id]
    )
