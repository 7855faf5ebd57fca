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

    chosen = _parse_events(events)
    with open_installation() as (service, actor):
        line, secret = webhooks.create(service, actor, courses.find(service, actor, course), url, chosen)
    print_json(webhook=line, secret=secret)
    print_line(secret)
    print_note(f"webhook {line.id} added; its secret is shown only once")


def list_webhooks(course: Course = DEFAULT_COURSE) -> None:
    """List the webhooks of a course, the oldest first."""
    from service.operations import webhooks

    with open_installation() as (service, actor):
        found = webhooks.list_webhooks(service, actor, courses.find(service, actor, course))
    print_json(webhooks=found)
    if not found:
        print_line("no webhooks yet")
        return
    listed = create_table("id", "created", "events", "address")
    for each in found:
        created = each.created_at.astimezone().strftime("%Y-%m-%d %H:%M")
        listed.add_row(each.id, created, ", ".join(each.events), each.url)
    print_renderables(listed)


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
        found = webhooks.list_deliveries(service, actor, courses.find(service, actor, course), limit)
    print_json(deliveries=found)
    if not found:
        print_line("no deliveries yet")
        return
    listed = create_table("made", "webhook", "event", "attempts", "delivered", "error", right=("attempts",))
    for each in found:
        made, delivered = (
            "" if at is None else at.astimezone().strftime("%Y-%m-%d %H:%M") for at in (each.made_at, each.delivered_at)
        )
        listed.add_row(made, each.webhook_id, each.event, str(each.attempts), delivered, each.error or "")
    print_renderables(listed)


def _parse_events(names: Sequence[str]) -> list[WebhookEvent]:
    from service.operations.webhooks import WebhookEvent

    known = [event.value for event in WebhookEvent]
    for name in names:
        if name not in known:
            raise UsageError(f"--event is {name!r}, expected one of {', '.join(known)}")
    return [WebhookEvent(name) for name in names]
