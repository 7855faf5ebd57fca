"""``robomark webhook``: manage the webhooks of a course and list their deliveries."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from service.commands.installation import open_installation
from service.commands.output import create_table, print_json, print_line, print_note, print_renderables
from service.operations import courses
from service.operations.courses import DEFAULT_COURSE
from sim.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from service.operations.webhooks import WebhookEvent

Course = Annotated[str, typer.Option(help="The course.")]


def add(
    url: Annotated[str, typer.Argument(help="The address, for example https://hooks.example.org/robomark.")],
    events: Annotated[
        list[str],
        typer.Option(
            "--event",
            help="grade.finished, batch.finished, grades.published or appeal.opened. Repeat the option for several.",
        ),
    ],
    course: Course = DEFAULT_COURSE,
) -> None:
    """Add a webhook to a course, and print the secret that signs its deliveries."""
    from service.operations import webhooks

    event_types = _parse_events(events)
    with open_installation() as (service, actor):
        line, secret = webhooks.create(service, actor, courses.find(service, actor, course), url, event_types)
    print_json(webhook=line, secret=secret)
    print_line(secret)
    print_note(f"webhook {line.id} added; its secret is shown only once")


def list_webhooks(course: Course = DEFAULT_COURSE) -> None:
    """List the webhooks of a course, the oldest first."""
    from service.operations import webhooks

    with open_installation() as (service, actor):
        webhook_list = webhooks.list_webhooks(service, actor, courses.find(service, actor, course))
    print_json(webhooks=webhook_list)
    if not webhook_list:
        print_line("no webhooks yet")
        return
    table = create_table("id", "created", "events", "address")
    for webhook in webhook_list:
        created_text = webhook.created_at.astimezone().strftime("%Y-%m-%d %H:%M")
        table.add_row(webhook.id, created_text, ", ".join(webhook.events), webhook.url)
    print_renderables(table)


def remove(
    webhook: Annotated[str, typer.Argument(help="The webhook's id, as shown by robomark webhook list.")],
    course: Course = DEFAULT_COURSE,
) -> None:
    """Remove a webhook and its pending deliveries."""
    from service.operations import webhooks

    with open_installation() as (service, actor):
        webhooks.revoke(service, actor, courses.find(service, actor, course), webhook)
    print_json(webhook=webhook)
    print_line(f"webhook {webhook} removed")


def list_deliveries(
    course: Course = DEFAULT_COURSE,
    limit: Annotated[int, typer.Option(min=1, max=1000, help="Maximum number of deliveries to show.")] = 50,
) -> None:
    """List the newest deliveries to the webhooks of a course."""
    from service.operations import webhooks

    with open_installation() as (service, actor):
        deliveries = webhooks.list_deliveries(service, actor, courses.find(service, actor, course), limit)
    print_json(deliveries=deliveries)
    if not deliveries:
        print_line("no deliveries yet")
        return
    table = create_table("made", "webhook", "event", "attempts", "delivered", "error", right=("attempts",))
    for delivery in deliveries:
        made_text, delivered_text = (
            "" if at is None else at.astimezone().strftime("%Y-%m-%d %H:%M")
            for at in (delivery.made_at, delivery.delivered_at)
        )
        table.add_row(
            made_text, delivery.webhook_id, delivery.event, str(delivery.attempts), delivered_text, delivery.error or ""
        )
    print_renderables(table)


def _parse_events(names: Sequence[str]) -> list[WebhookEvent]:
    from service.operations.webhooks import WebhookEvent

    event_names = [event.value for event in WebhookEvent]
    for name in names:
        if name not in event_names:
            raise UsageError(f"--event is {name!r}, expected one of {', '.join(event_names)}")
    return [WebhookEvent(name) for name in names]
