"""Courses of an installation: find, list and create them."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import select

from service.operations.context import Actor, Service
from service.operations.errors import Forbidden, Invalid
from service.operations.lookup import check_operator, require_course, require_named_course
from service.operations.people import check_lengths
from service.operations.sign_in_links import make_link
from service.store import audit
from service.store.engine import now
from service.store.grades import appeals
from service.store.people import membership
from service.store.people.membership import CourseLine as CourseLine
from service.store.people.membership import Member
from service.store.people.students import DEFAULT_COURSE as DEFAULT_COURSE
from service.store.people.students import ensure_course
from service.store.states import Role
from service.store.tables.courses import Course
from submissions.student_identity import Student

#: Longest name of a course.
MAX_NAME_LENGTH = 100


@dataclass(frozen=True, slots=True)
class MemberRequest:
    """A person to add to a course. ``word`` determines their sign-in link; empty for a random one."""

    course: str
    id: str
    name: str = ""
    email: str = ""
    role: Role = Role.INSTRUCTOR
    operator: bool = False
    word: str = ""


@dataclass(frozen=True, slots=True)
class AddedMember:
    """A new member, the secret of their sign-in link, and instructors with the same id in other courses."""

    member: Member
    secret: str
    elsewhere: tuple[tuple[str, Member], ...]


@dataclass(frozen=True, slots=True)
class OwnCourse:
    """A course, and the actor's role in it."""

    id: int
    name: str
    role: Role


@dataclass(frozen=True, slots=True)
class TaughtCourse:
    """A course, as its instructors see it on each of its pages."""

    id: int
    name: str
    open_appeals: int


def find(service: Service, actor: Actor, name: str) -> int:
    """Return the id of the course with this name. Creates the default course if it does not exist.

    Raises NotFound for any other unknown name.
    """
    check_operator(actor)
    with service.store.reading() as session:
        if name != DEFAULT_COURSE or name in {each.name for each in membership.list_courses(session)}:
            return require_named_course(session, actor, name).id
    with service.store.transaction() as session:
        return ensure_course(session, name, now(session))


def show_own(service: Service, actor: Actor, course_id: int, role: Role) -> OwnCourse:
    """Return a course in which the actor has this role. Raises NotFound."""
    with service.store.reading() as session:
        return OwnCourse(course_id, require_course(session, actor, course_id, role).name, role)


def show_membership(service: Service, actor: Actor, course_id: int) -> OwnCourse:
    """Return a course in which the actor has any role. Raises NotFound."""
    return show_own(service, actor, course_id, actor.roles.get(course_id, Role.STUDENT))


def show_taught(service: Service, actor: Actor, course_id: int) -> TaughtCourse:
    """Return a course that the actor instructs. Raises NotFound."""
    with service.store.reading() as session:
        row = require_course(session, actor, course_id, Role.INSTRUCTOR)
        return TaughtCourse(row.id, row.name, appeals.count_open_appeals(session, row.id))


def list_own(service: Service, actor: Actor) -> list[OwnCourse]:
    """Return the courses in which the actor has a role, ordered by id."""
    with service.store.reading() as session:
        rows = session.scalars(select(Course).where(Course.id.in_(actor.roles)).order_by(Course.id))
        return [OwnCourse(row.id, row.name, actor.roles[row.id]) for row in rows]


def list_courses(service: Service, actor: Actor) -> list[CourseLine]:
    """Return all courses by name, with their numbers of members, for operators. Raises NotFound."""
    check_operator(actor)
    with service.store.reading() as session:
        return membership.list_courses(session)


def add_member(service: Service, actor: Actor, request: MemberRequest) -> AddedMember:
    """Add an instructor or student to a course and create a single-use sign-in link.

    Adding an instructor creates the course if necessary; adding a student does not.

    Raises:
        NotFound: The actor is not an operator, or the course does not exist.
        Forbidden: Only commands on the machine can make operators.
        Invalid: A name is blank or too long.
        UsageError: The id belongs to a student already, or is ambiguous.
    """
    check_operator(actor)
    if request.operator and not actor.is_machine:
        raise Forbidden("operators can be added only with a command on the server")
    course, student = request.course.strip(), Student(request.id.strip(), request.name.strip(), request.email.strip())
    if not course or not student.id:
        raise Invalid("names of courses and members must contain visible characters")
    if len(course) > MAX_NAME_LENGTH:
        raise Invalid("the course name is too long; use at most %(most)s characters", most=MAX_NAME_LENGTH)
    check_lengths([student])
    is_student = request.role is Role.STUDENT
    if is_student:
        find(service, actor, course)
    with service.store.transaction() as session:
        member = (membership.make_student if is_student else membership.make_instructor)(session, course, student)
        if request.operator:
            membership.make_operator(session, member.person_id)
        detail = {"role": member.role.value, "operator": request.operator}
        audit.record_action(session, actor.name, "add", "person", str(member.person_id), **detail)
        secret = make_link(session, actor, member.person_id, word=request.word)
        same_id_instructors = (
            () if is_student else tuple(membership.find_same_id_instructors(session, member.enrolment_id))
        )
    return AddedMember(member, secret, same_id_instructors)
