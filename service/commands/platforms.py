"""``robomark platform``: register learning platforms, fetch their members and send marks."""

from __future__ import annotations

from typing import Annotated

import typer

from service.commands.installation import open_installation
from service.commands.output import create_table, print_json, print_line, print_note, print_renderables
from service.operations import courses
from service.operations.courses import DEFAULT_COURSE

Course = Annotated[str, typer.Option(help="A course that the platform launches.")]


def add(
    name: Annotated[str, typer.Argument(help="The displayed name of the platform.")],
    issuer: Annotated[str, typer.Option(help="The platform's issuer, for example https://moodle.example.org.")],
    client_id: Annotated[str, typer.Option("--client", help="The client id that the platform gave to Robomark.")],
    deployments: Annotated[
        list[str], typer.Option("--deployment", help="A deployment id. Repeat the option for several.")
    ],
    authorization_url: Annotated[str, typer.Option("--login-url", help="The URL of its authentication requests.")],
    token_url: Annotated[str, typer.Option("--token-url", help="The URL of its access tokens.")],
    keys_url: Annotated[str, typer.Option("--keys-url", help="The URL of its public keys.")],
    service_origins: Annotated[
        list[str] | None,
        typer.Option("--service", help="Another URL of its services. Repeat the option for several."),
    ] = None,
) -> None:
    """Register a learning platform, or update the one with the same issuer and client id."""
    from service.operations import platforms

    origins = tuple(service_origins or ())
    asked = platforms.Registration(
        name, issuer, client_id, tuple(deployments), authorization_url, token_url, keys_url, origins
    )
    with open_installation() as (service, actor):
        registered = platforms.register(service, actor, asked)
    found = next(each for each in registered if (each.issuer, each.client_id) == (issuer, client_id))
    print_json(platform=found)
    print_line(f"platform {found.name} is registered for {found.issuer}")


def list_platforms() -> None:
    """List the registered learning platforms."""
    from service.operations import platforms

    with open_installation() as (service, actor):
        found = platforms.list_platforms(service, actor)
    print_json(platforms=found)
    if not found:
        print_line("no learning platforms yet")
        return
    listed = create_table("name", "issuer", "client", "deployments")
    for each in found:
        listed.add_row(each.name, each.issuer, each.client_id, ", ".join(each.deployments))
    print_renderables(listed)


def enrol_members(course: Course = DEFAULT_COURSE) -> None:
    """Enrol all members that the platform has in a course."""
    from service.operations import platforms

    with open_installation() as (service, actor):
        enrolled = platforms.enrol_members(service, actor, courses.find(service, actor, course))
    print_json(members=enrolled.members, refused=enrolled.refused)
    print_line(f"{enrolled.members} of the platform's members are in {course}")
    for reason in enrolled.refused:
        print_note(f"not enrolled: {reason}")


def send_marks(
    assignment: Annotated[str, typer.Argument(help="The assignment's id in the course.")],
    course: Course = DEFAULT_COURSE,
) -> None:
    """Send the published marks of an assignment to the platform's gradebook."""
    from service.operations import platforms

    with open_installation() as (service, actor):
        sent = platforms.pass_back(service, actor, courses.find(service, actor, course), assignment)
    print_json(assignment=assignment, sent=sent)
    print_line(f"{assignment}: {sent} published marks sent")
