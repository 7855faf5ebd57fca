"""Links that sign people in once: for one student, for all of a course, and for any member by an operator.

A person's newest link alone counts. What a link is exchanged for is in ``service/store/people/credentials.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.operations.errors import Invalid
from service.operations.lookup import check_machine, check_operator, course_for, student_in
from service.store import audit
from service.store.engine import now
from service.store.people import credentials, membership
from service.store.people.credentials import EVERYWHERE, LINK_LIFETIME, Reach
from service.store.people.membership import Member
from service.store.people.students import DEFAULT_COURSE
from service.store.states import Role
from sim.errors import UsageError
from submissions.student_identity import Student

#: How long links for a whole course last, which are passed on by other means.
DAYS, MOST_DAYS = 7, 30
_ELSEWHERE = "is in other courses, too, and signs in by whoever runs Robomark"


@dataclass(frozen=True, slots=True)
class StudentLink:
    """One student's link, or the reason why there is none."""

    student: Member
    secret: str | None
    expires_at: datetime | None
    reason: str


@dataclass(frozen=True, slots=True)
class UnusedLink:
    """A link that still signs somebody in: its secret, whom it signs in, and until when."""

    secret: str
    person_id: int
    name: str
    expires_at: datetime


def make_links(service: Service, actor: Actor, course_id: int, days: int = DAYS) -> list[StudentLink]:
    """A new link for each student of the course, by id, in place of earlier ones. Raises NotFound, Invalid."""
    if not 1 <= days <= MOST_DAYS:
        raise Invalid("sign-in links last from 1 to %(most)s days", most=MOST_DAYS)
    lifetime = timedelta(days=days)
    with service.store.transaction() as session:
        course_for(session, actor, course_id, Role.INSTRUCTOR)
        listed = membership.students(session, course_id)
        person_ids = [each.person_id for each, more in listed if not more]
        made = credentials.replace_links(session, person_ids, lifetime, reach=_reach(course_id))
        until = now(session) + lifetime
        audit.note(session, actor.name, "links", "course", str(course_id), students=len(made), days=days)
    return [
        StudentLink(each, None, None, _ELSEWHERE) if more else StudentLink(each, made[each.person_id], until, "")
        for each, more in listed
    ]


def make_students_link(service: Service, actor: Actor, course_id: int, enrolment_id: int, *, word: str = "") -> str:
    """The secret of a student's new link into this course; with a ``word`` it follows from that.

    Raises:
        NotFound: there is no such student, or the actor does not instruct the course.
        UsageError: the student is in other courses, too, or an operator.
    """
    with service.store.transaction() as session:
        row = student_in(session, actor, course_id, enrolment_id)
        if membership.is_more_than(session, row):
            raise UsageError(f"this person {_ELSEWHERE}")
        return make_link(session, actor, row.person_id, word=word, reach=_reach(course_id))


def make_own_link(service: Service, actor: Actor) -> str:
    """The secret of a new link for whoever runs a command here: an instructor of the default course, and operator.

    The account is their id. Raises Forbidden for anybody but commands.
    """
    check_machine(actor)
    account = actor.name.partition("@")[0]
    with service.store.transaction() as session:
        try:
            member = membership.make_instructor(session, DEFAULT_COURSE, Student(account))
        except UsageError:
            # A student has the account's name as their id.
            member = membership.make_instructor(session, DEFAULT_COURSE, Student(f"operator {account}"))
        membership.make_operator(session, member.person_id)
        return make_link(session, actor, member.person_id)


def make_members_link(service: Service, actor: Actor, course: str, who: str) -> tuple[Member, str]:
    """A member of a course by its name and their id, with the secret of their new link. Raises NotFound, UsageError."""
    check_operator(actor)
    with service.store.transaction() as session:
        member = membership.member(session, course, who)
        return member, make_link(session, actor, member.person_id)


def find_link(service: Service, word: str) -> UnusedLink | None:
    """The link that was made of a word; None where there is none, or it was used or has expired."""
    secret = credentials.link_of(word)
    with service.store.reading() as session:
        owner = credentials.owner(session, secret)
    return None if owner is None else UnusedLink(secret, owner.person_id, owner.name, owner.expires_at)


def make_link(session: Session, actor: Actor, person_id: int, *, word: str = "", reach: Reach = EVERYWHERE) -> str:
    """The secret of a person's new link, in the transaction of an operation that has checked the actor."""
    (secret,) = credentials.replace_links(session, [person_id], LINK_LIFETIME, word, reach).values()
    audit.note(session, actor.name, "link", "person", str(person_id))
    return secret


def _reach(course_id: int) -> Reach:
    """The reach of a link that an instructor makes: not beyond the course, nor what the student becomes later."""
    return Reach(course_id=course_id, role=Role.STUDENT)
