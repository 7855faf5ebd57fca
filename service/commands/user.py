"""``robomark user``: instructors, operators and sign-in credentials.

Students are added with their submissions or by ``robomark course enrol``.
"""

from __future__ import annotations

from typing import Annotated

import typer

from service.commands.installation import open_installation
from service.commands.output import create_table, print_json, print_line, print_note, print_renderables
from service.operations import courses, people, people_views, sign_in_links
from service.operations.courses import DEFAULT_COURSE, MemberRequest
from service.operations.people import JoinRequest, Member, TokenForRequest
from service.operations.types import Role
from service.settings import Settings
from sim.errors import UsageError

PersonId = Annotated[str, typer.Argument(help="The person's id in the course.")]
Course = Annotated[str, typer.Option(help="The course.")]


def add(
    who: PersonId,
    name: Annotated[str, typer.Option(help="The displayed name.")] = "",
    email: Annotated[str, typer.Option(help="The e-mail address.")] = "",
    course: Course = DEFAULT_COURSE,
    operator: Annotated[
        bool, typer.Option("--operator", help="Also make the person an operator of this installation.")
    ] = False,
    student: Annotated[
        bool, typer.Option("--student", help="Enrol the person as a student instead of an instructor.")
    ] = False,
) -> None:
    """Add an instructor or a student to a course, and print a sign-in link, which works once."""
    if student and operator:
        raise UsageError("a student cannot be an operator: use --student or --operator")
    role = Role.STUDENT if student else Role.INSTRUCTOR
    with open_installation() as (service, actor):
        added = courses.add_member(service, actor, MemberRequest(course, who, name, email, role, operator))
    member = added.member
    _print_link(service.settings, member.id, added.secret)
    for other_course, instructor in added.elsewhere:
        print_note(
            f"{_format_member(instructor)} is also an instructor of {other_course}. If this is the same person: "
            f"robomark user join {member.id} --course {course} --same-as {instructor.id} --of {other_course}"
        )


def link(who: PersonId, course: Course = DEFAULT_COURSE) -> None:
    """Print a new sign-in link, which works once."""
    with open_installation() as (service, actor):
        member, secret = sign_in_links.make_members_link(service, actor, course, who)
    _print_link(service.settings, member.id, secret)


def links(
    course: Course = DEFAULT_COURSE,
    days: Annotated[
        int, typer.Option(min=1, max=sign_in_links.MAX_DAYS, help="Number of days until the links expire.")
    ] = sign_in_links.DAYS,
) -> None:
    """Print a new sign-in link for each student of a course. Earlier links expire."""
    with open_installation() as (service, actor):
        link_list = sign_in_links.make_links(service, actor, courses.find(service, actor, course), days)
    public = service.settings.public_url
    lines = [
        {
            "id": each.student.id,
            "name": each.student.name,
            "email": each.student.email,
            "path": each.secret and f"/sign-in/{each.secret}",
            "url": each.secret and public and f"{public}/sign-in/{each.secret}",
            "expires_at": each.expires_at,
            "reason": each.reason,
        }
        for each in link_list
    ]
    print_json(links=lines)
    if not lines:
        print_line("no students yet")
        return
    table = create_table("id", "name", "address", "link")
    for line in lines:
        link = line["url"] or line["path"] or line["reason"]
        table.add_row(*(str(each) for each in (line["id"], line["name"], line["email"], link)))
    print_renderables(table)
    if not public:
        print_note("add each link to the address that robomark up or serve prints")


def token(
    who: PersonId,
    scopes: Annotated[list[str], typer.Option("--scope", help="A scope of the token: read, submit, mark or manage.")],
    name: Annotated[str, typer.Option(help="The name of the token.")] = "",
    course: Course = DEFAULT_COURSE,
    days: Annotated[int, typer.Option(min=1, max=366, help="Number of days until the token expires.")] = 90,
) -> None:
    """Print a token for programs, valid in one course."""
    from service.operations.scopes import SCOPES

    for scope in scopes:
        if scope not in SCOPES:
            raise UsageError(f"--scope is {scope!r}, expected one of {', '.join(SCOPES)}")
    with open_installation() as (service, actor):
        member = people.find(service, actor, course, who)
        request = TokenForRequest(name or "command line", frozenset(scopes), days)
        secret = people.issue_token(service, actor, member.enrolment_id, request)
    print_json(id=member.id, token=secret, scopes=sorted(scopes), days=days)
    print_line(secret)


def sign_out(
    who: PersonId,
    course: Course = DEFAULT_COURSE,
    release: Annotated[
        bool, typer.Option("--release", help="A student's next launch with this id may take this place in the course.")
    ] = False,
) -> None:
    """End all links, sessions and tokens of a person."""
    with open_installation() as (service, actor):
        member = people.find(service, actor, course, who)
        revoked_count = people.sign_out(service, actor, member.enrolment_id, release=release)
    print_json(id=member.id, ended=revoked_count)
    print_line(f"{_format_member(member)} is signed out: {revoked_count} links, sessions and tokens revoked")


def remove(who: PersonId, course: Course = DEFAULT_COURSE) -> None:
    """Remove a person without submissions from a course."""
    with open_installation() as (service, actor):
        member = people.find(service, actor, course, who)
        people.remove(service, actor, member.course_id, member.enrolment_id)
    print_json(id=member.id, course=course)
    print_line(f"{_format_member(member)} is removed from {course}")


def join(
    who: PersonId,
    same_as: Annotated[str, typer.Option("--same-as", help="The id of the same person in the other course.")],
    of: Annotated[str, typer.Option("--of", help="The other course.")],
    course: Course = DEFAULT_COURSE,
    from_platform: Annotated[
        bool, typer.Option("--from-platform", help="Also join a person whom a learning platform signs in.")
    ] = False,
) -> None:
    """Join the accounts of one person in different courses, and sign both out."""
    with open_installation() as (service, actor):
        member = people.find(service, actor, course, who)
        other_member = people.find(service, actor, of, same_as)
        people.join(service, actor, JoinRequest(member.enrolment_id, other_member.enrolment_id, from_platform))
    print_json(id=member.id, course=course, same_as=other_member.id, of=of)
    print_line(f"{_format_member(member)} in {course} and {_format_member(other_member)} in {of} are now one person")


def list_people(course: Course = DEFAULT_COURSE) -> None:
    """List who is in a course."""
    with open_installation() as (service, actor):
        members = people_views.list_members(service, actor, courses.find(service, actor, course))
    print_json(
        people=[
            {"id": each.id, "name": each.name, "email": each.email, "role": each.role, "operator": each.operator}
            for each in members
        ]
    )
    table = create_table("id", "name", "address", "role")
    for member in members:
        table.add_row(member.id, member.name, member.email, f"{member.role}{', operator' if member.operator else ''}")
    print_renderables(table)


def _print_link(settings: Settings, person_id: str, secret: str) -> None:
    path = f"/sign-in/{secret}"
    address = f"{settings.public_url}{path}" if settings.public_url else path
    print_json(id=person_id, path=path, url=f"{settings.public_url}{path}" if settings.public_url else None)
    print_line(
        address if settings.public_url else f"{path}   (add this to the address that robomark up or serve prints)"
    )


def _format_member(member: Member) -> str:
    return f"{member.name} ({member.id})" if member.name else member.id
