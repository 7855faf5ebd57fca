"""Single-use sign-in links: for one student, for all students of a course, and for any member by an operator.

Only a person's newest link is valid. With hidden names, instructors create links only before the first submission,
because they could sign in as a student and see the student's submissions.
``service/store/people/credentials.py`` exchanges links for sessions.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.operations.errors import Invalid
from service.operations.lookup import (
    check_machine,
    check_no_names_hidden,
    check_operator,
    require_course,
    require_student,
)
from service.store import audit
from service.store.engine import now
from service.store.people import credentials, membership
from service.store.people.credentials import LINK_LIFETIME
from service.store.people.membership import Member
from service.store.people.reach import UNLIMITED_REACH, Reach
from service.store.people.students import DEFAULT_COURSE
from service.store.states import Role
from sim.errors import UsageError
from submissions.student_identity import Student

#: Lifetime in days of links for a whole course, which are distributed by other means.
DAYS, MAX_DAYS = 7, 30
_ELSEWHERE = "is also in other courses, so only the operator can create a sign-in link"


@dataclass(frozen=True, slots=True)
class StudentLink:
    """One student's link, or the reason why there is none."""

    student: Member
    secret: str | None
    expires_at: datetime | None
    reason: str


@dataclass(frozen=True, slots=True)
class UnusedLink:
    """A valid link: its secret, the person that it signs in, and its expiry time."""

    secret: str
    person_id: int
    name: str
    expires_at: datetime


def make_links(service: Service, actor: Actor, course_id: int, days: int = DAYS) -> list[StudentLink]:
    """Create a new link for each student of the course, replacing earlier ones.

    Raises NotFound, and Invalid for a number of days that is out of range, or if names are hidden.
    """
    if not 1 <= days <= MAX_DAYS:
        raise Invalid("sign-in links can be valid for 1 to %(most)s days", most=MAX_DAYS)
    lifetime = timedelta(days=days)
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        check_no_names_hidden(session, actor, course_id)
        student_list = membership.list_students(session, course_id)
        person_ids = [each.person_id for each, more in student_list if not more]
        secrets_by_person = credentials.replace_links(session, person_ids, lifetime, reach=_build_reach(course_id))
        expires_at = now(session) + lifetime
        audit.record_action(
            session, actor.name, "links", "course", str(course_id), students=len(secrets_by_person), days=days
        )
    return [
        StudentLink(each, None, None, _ELSEWHERE)
        if more
        else StudentLink(each, secrets_by_person[each.person_id], expires_at, "")
        for each, more in student_list
    ]


def make_students_link(service: Service, actor: Actor, course_id: int, enrolment_id: int, *, word: str = "") -> str:
    """Return the secret of a student's new link into this course, determined by ``word`` if given.

    Raises:
        NotFound: The student does not exist, or the actor does not instruct the course.
        Invalid: Names are hidden.
        UsageError: The student is also in other courses, or an operator.
    """
    with service.store.transaction() as session:
        row = require_student(session, actor, course_id, enrolment_id)
        check_no_names_hidden(session, actor, course_id)
        if membership.has_other_access(session, row):
            raise UsageError(f"this person {_ELSEWHERE}")
        return make_link(session, actor, row.person_id, word=word, reach=_build_reach(course_id))


def make_own_link(service: Service, actor: Actor) -> str:
    """Return the secret of a new link for the user of this command, as operator and default course instructor.

    The id is the account name. Raises Forbidden unless called by a command.
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


def make_members_link(service: Service, actor: Actor, course: str, member_id: str) -> tuple[Member, str]:
    """Return a member of a course by course name and id, with the secret of a new link. Raises NotFound, UsageError."""
    check_operator(actor)
    with service.store.transaction() as session:
        member = membership.load_member(session, course, member_id)
        return member, make_link(session, actor, member.person_id)


def find_link(service: Service, word: str) -> UnusedLink | None:
    """Return the link created from a word; None if it does not exist, was used or has expired."""
    secret = credentials.build_link_secret(word)
    with service.store.reading() as session:
        owner = credentials.find_link_owner(session, secret)
    return None if owner is None else UnusedLink(secret, owner.person_id, owner.name, owner.expires_at)


def make_link(session: Session, actor: Actor, person_id: int, *, word: str = "", reach: Reach = UNLIMITED_REACH) -> str:
    """Return the secret of a person's new link, within the transaction of an operation that has checked the actor."""
    (secret,) = credentials.replace_links(session, [person_id], LINK_LIFETIME, word, reach).values()
    audit.record_action(session, actor.name, "link", "person", str(person_id))
    return secret


def _build_reach(course_id: int) -> Reach:
    """Return the reach of a link created by an instructor: only the course, and only the student role."""
    return Reach(course_id=course_id, role=Role.STUDENT)
