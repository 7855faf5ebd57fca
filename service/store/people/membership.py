"""Members of a course and their roles; persons who are in several courses.

Students are enrolled by ``students.py``; how people sign in is ``credentials.py``'s.
"""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import ColumnElement, exists, func, or_, select, update
from sqlalchemy.orm import Session, aliased

from service.store.engine import now
from service.store.models import Course, Enrolment, Person
from service.store.people import credentials
from service.store.people.students import Students, course_of
from service.store.states import Role
from service.store.web_tables import Credential, LtiPerson
from sim.errors import UsageError
from submissions.names import shown_name
from submissions.student_identity import Student


@dataclass(frozen=True, slots=True)
class Member:
    """Somebody in a course."""

    person_id: int
    enrolment_id: int
    course_id: int
    id: str  # what the course knows them by
    name: str
    email: str
    role: Role
    operator: bool


@dataclass(frozen=True, slots=True)
class CourseLine:
    """A course, and how many are in it."""

    id: int
    name: str
    instructors: int
    students: int


def make_instructor(session: Session, course: str, who: Student) -> Member:
    """Make somebody an instructor of the course, which is made where there is none of that name.

    An id belongs to its course: the same id in another course is another person, until an operator joins the two.
    Raises UsageError where a student of the course has this id: whoever can sign in as that student would be an
    instructor.
    """
    course_id, own = course_of(session, course, now(session)), shown_name(who.id)
    taken = select(Enrolment.role).where(Enrolment.course_id == course_id, Enrolment.student == own)
    if session.scalar(taken) is Role.STUDENT:
        raise UsageError(f"{own!r} is a student of this course, expected another id for an instructor")
    return _make(session, course, who, Role.INSTRUCTOR)


def set_role(session: Session, row: Enrolment, role: Role) -> None:
    """Give a member of a course a role. Losing the instructor's role ends what they sign in with there."""
    if row.role is Role.INSTRUCTOR and role is not Role.INSTRUCTOR:
        credentials.revoke_reaching(session, row.person_id, row.course_id)
    row.role = role


def elsewhere(session: Session, enrolment_id: int) -> list[tuple[str, Member]]:
    """Instructors with the id of this one in other courses who are other persons, each with the course's name."""
    own = session.get_one(Enrolment, enrolment_id)
    query = (
        select(Course.name, Enrolment, Person)
        .join(Course, Enrolment.course_id == Course.id)
        .join(Person, Enrolment.person_id == Person.id)
        .where(Enrolment.student == own.student, Enrolment.role == Role.INSTRUCTOR)
        .where(Enrolment.person_id != own.person_id)
        .order_by(Course.name)
    )
    return [(course, _line(enrolment, person)) for course, enrolment, person in session.execute(query)]


def enrolments(session: Session, person_id: int) -> list[tuple[str, Member]]:
    """What a person is in each of their courses, with the course's name."""
    query = (
        select(Course.name, Enrolment, Person)
        .join(Course, Enrolment.course_id == Course.id)
        .join(Person, Enrolment.person_id == Person.id)
        .where(Enrolment.person_id == person_id)
        .order_by(Course.name)
    )
    return [(course, _line(enrolment, person)) for course, enrolment, person in session.execute(query)]


def is_from_platform(session: Session, person_id: int) -> bool:
    """Whether a learning platform vouches for this person."""
    return session.scalar(select(LtiPerson.id).where(LtiPerson.person_id == person_id).limit(1)) is not None


def join(session: Session, person_id: int, other_id: int) -> None:
    """Make two persons one, who keeps all enrolments. What either signs in with ends, for it would reach further.

    The caller has locked both.
    """
    for each in (person_id, other_id):
        credentials.revoke_all(session, each)
    for column in (Enrolment.person_id, LtiPerson.person_id, Credential.person_id):
        session.execute(update(column.class_).where(column == other_id).values(person_id=person_id))
    person, other = session.get_one(Person, person_id), session.get_one(Person, other_id)
    person.operator = person.operator or other.operator
    person.signed_in_at = person.signed_in_at or other.signed_in_at
    session.delete(other)
    session.flush()


def make_student(session: Session, course: str, who: Student) -> Member:
    """Enrol somebody as a student, whatever they were in the course before."""
    return _make(session, course, who, Role.STUDENT)


def make_operator(session: Session, person_id: int) -> None:
    """Let a person run the installation."""
    session.get_one(Person, person_id).operator = True


def member(session: Session, course: str, written: str) -> Member:
    """Somebody in the course, by id. Raises UsageError for a course or a person that there is not."""
    return _member(session, Students(session, find_course(session, course)).find(written))


def known(session: Session, course_id: int, who: Student) -> Member | None:
    """Whoever in the course has this id; None where nobody has."""
    enrolment_id = Students(session, course_id).known(who)
    return None if enrolment_id is None else _member(session, enrolment_id)


def member_of(session: Session, row: Enrolment) -> Member:
    """Whom an enrolment is of."""
    return _line(row, session.get_one(Person, row.person_id))


def find_course(session: Session, name: str) -> int:
    """The course of this name. Raises UsageError where there is none."""
    course_id = session.scalar(select(Course.id).where(Course.name == name))
    if course_id is None:
        raise UsageError(f"there is no course {name!r}")
    return course_id


def members(session: Session, course_id: int) -> list[Member]:
    """Everybody in the course, by id."""
    query = (
        select(Enrolment, Person)
        .join(Person, Enrolment.person_id == Person.id)
        .where(Enrolment.course_id == course_id)
        .order_by(Enrolment.student)
    )
    return [_line(enrolment, person) for enrolment, person in session.execute(query)]


def members_after(session: Session, course_id: int, enrolment_id: int, limit: int) -> list[Member]:
    """Some of the course, in the order in which they came in: those who came after this one."""
    query = (
        select(Enrolment, Person)
        .join(Person, Enrolment.person_id == Person.id)
        .where(Enrolment.course_id == course_id, Enrolment.id > enrolment_id)
        .order_by(Enrolment.id)
        .limit(limit)
    )
    return [_line(enrolment, person) for enrolment, person in session.execute(query)]


def students(session: Session, course_id: int) -> list[tuple[Member, bool]]:
    """The students of the course, by id, each with whether they are more than that."""
    query = (
        select(Enrolment, Person, _more_than())
        .join(Person, Enrolment.person_id == Person.id)
        .where(Enrolment.course_id == course_id, Enrolment.role == Role.STUDENT)
        .order_by(Enrolment.student)
    )
    return [(_line(enrolment, person), more) for enrolment, person, more in session.execute(query)]


def is_more_than(session: Session, row: Enrolment) -> bool:
    """Whether a person is more than this enrolment says: in other courses, or runs the installation."""
    query = (
        select(_more_than())
        .select_from(Enrolment)
        .join(Person, Enrolment.person_id == Person.id)
        .where(Enrolment.id == row.id)
    )
    return bool(session.scalar(query))


def courses(session: Session) -> list[CourseLine]:
    """All courses, by name."""
    instructors, students = (func.count().filter(Enrolment.role == role) for role in (Role.INSTRUCTOR, Role.STUDENT))
    query = select(Course.id, Course.name, instructors, students)
    query = query.outerjoin(Enrolment, Enrolment.course_id == Course.id).group_by(Course.id, Course.name)
    return [CourseLine(*row) for row in session.execute(query.order_by(Course.name))]


def _more_than() -> ColumnElement[bool]:
    other = aliased(Enrolment)
    return or_(Person.operator, exists().where(other.person_id == Enrolment.person_id, other.id != Enrolment.id))


def _make(session: Session, course: str, who: Student, role: Role) -> Member:
    at = now(session)
    enrolment_id = Students(session, course_of(session, course, at)).enrol(who, at)
    row = session.get_one(Enrolment, enrolment_id)
    set_role(session, row, role)
    row.name, row.email = who.name or row.name, who.email or row.email
    session.flush()
    return _member(session, enrolment_id)


def _member(session: Session, enrolment_id: int) -> Member:
    return member_of(session, session.get_one(Enrolment, enrolment_id))


def _line(enrolment: Enrolment, person: Person) -> Member:
    return Member(
        person.id,
        enrolment.id,
        enrolment.course_id,
        enrolment.student,
        enrolment.name,
        enrolment.email,
        enrolment.role,
        person.operator,
    )
