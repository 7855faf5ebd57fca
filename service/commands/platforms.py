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
    registration = platforms.Registration(
        name, issuer, client_id, tuple(deployments), authorization_url, token_url, keys_url, origins
    )
    with open_installation() as (service, actor):
        platform_list = platforms.register(service, actor, registration)
    platform = next(each for each in platform_list if (each.issuer, each.client_id) == (issuer, client_id))
    print_json(platform=platform)
    print_line(f"platform {platform.name} is registered for {platform.issuer}")


def list_platforms() -> None:
    """List the registered learning platforms."""
    from service.operations import platforms

    with open_installation() as (service, actor):
        platform_list = platforms.list_platforms(service, actor)
    print_json(platforms=platform_list)
    if not platform_list:
        print_line("no learning platforms yet")
        return
    table = create_table("name", "issuer", "client", "deployments")
    for platform in platform_list:
        table.add_row(platform.name, platform.issuer, platform.client_id, ", ".join(platform.deployments))
    print_renderables(table)


def enrol_members(course: Course = DEFAULT_COURSE) -> None:
    """Enrol all members that the platform has in a course."""
    from service.operations import platforms

    with open_installation() as (service, actor):
        enrolment = platforms.enrol_members(service, actor, courses.find(service, actor, course))
    print_json(members=enrolment.members, refused=enrolment.refused)
    print_line(f"{enrolment.members} of the platform's members are in {course}")
    for reason in enrolment.refused:
        print_note(f"not enrolled: {reason}")


def send_marks(
    assignment: Annotated[str, typer.Argument(help="The assignment's id in the course.")],
    course: Course = DEFAULT_COURSE,
) -> None:
    """Send the published marks of an assignment to the platform's gradebook."""
    from service.operations import platforms

    with open_installation() as (service, actor):
        sent_count = platforms.pass_back(service, actor, courses.find(service, actor, course), assignment)
    print_json(assignment=assignment, sent=sent_count)
    print_line(f"{assignment}: {sent_count} published marks sent")
