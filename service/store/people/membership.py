"""Members of a course and their roles; persons with several courses.

``students.py`` enrols students; ``credentials.py`` handles sign-in.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from sqlalchemy import ColumnElement, Select, exists, func, or_, select, update
from sqlalchemy.orm import Session, aliased

from service.search_text import fold_text
from service.store.engine import now
from service.store.people import revocation
from service.store.people.students import Students, ensure_course
from service.store.states import Role
from service.store.tables.courses import Course
from service.store.tables.people import Credential, Enrolment, LtiPerson, Person
from sim.errors import UsageError
from submissions.student_identity import Student
from submissions.student_names import normalise_name


@dataclass(frozen=True, slots=True)
class Member:
    """A member of a course."""

    person_id: int
    enrolment_id: int
    course_id: int
    id: str  # the id in this course
    name: str
    email: str
    role: Role
    operator: bool

    def matches(self, text: str) -> bool:
        """Return whether the id, the name or the address contains a text, without regard to case and accents."""
        return fold_text(text.strip()) in fold_text(f"{self.id} {self.name} {self.email}")


@dataclass(frozen=True, slots=True)
class CourseLine:
    """A course, with its number of instructors and students."""

    id: int
    name: str
    instructors: int
    students: int


def make_instructor(session: Session, course: str, student: Student) -> Member:
    """Make a person an instructor of the course, creating the course if necessary.

    An id is local to its course: the same id in another course is another person, until an operator joins the two.
    Raises UsageError if a student of the course has this id, because anyone who can sign in as that student would
    become an instructor.
    """
    course_id, normal_id = ensure_course(session, course, now(session)), normalise_name(student.id)
    role_query = select(Enrolment.role).where(Enrolment.course_id == course_id, Enrolment.student == normal_id)
    if session.scalar(role_query) is Role.STUDENT:
        raise UsageError(f"{normal_id!r} is a student of this course, expected another id for an instructor")
    return _enrol_member(session, course, student, Role.INSTRUCTOR)


def set_role(session: Session, row: Enrolment, role: Role) -> None:
    """Set the role of a member. Losing the instructor role revokes the credentials that reach the course."""
    if row.role is Role.INSTRUCTOR and role is not Role.INSTRUCTOR:
        revocation.revoke_for_course(session, row.person_id, row.course_id)
    row.role = role


def find_same_id_instructors(session: Session, enrolment_id: int) -> list[tuple[str, Member]]:
    """Return instructors with the same id in other courses who are different persons, with the course names."""
    own_enrolment = session.get_one(Enrolment, enrolment_id)
    query = (
        select(Course.name, Enrolment, Person)
        .join(Course, Enrolment.course_id == Course.id)
        .join(Person, Enrolment.person_id == Person.id)
        .where(Enrolment.student == own_enrolment.student, Enrolment.role == Role.INSTRUCTOR)
        .where(Enrolment.person_id != own_enrolment.person_id)
        .order_by(Course.name)
    )
    return [(course, _build_member(enrolment, person)) for course, enrolment, person in session.execute(query)]


def load_enrolments(session: Session, person_id: int) -> list[tuple[str, Member]]:
    """Return the enrolments of a person, with the course names."""
    query = (
        select(Course.name, Enrolment, Person)
        .join(Course, Enrolment.course_id == Course.id)
        .join(Person, Enrolment.person_id == Person.id)
        .where(Enrolment.person_id == person_id)
        .order_by(Course.name)
    )
    return [(course, _build_member(enrolment, person)) for course, enrolment, person in session.execute(query)]


def is_from_platform(session: Session, person_id: int) -> bool:
    """Return whether a learning platform identifies this person."""
    return session.scalar(select(LtiPerson.id).where(LtiPerson.person_id == person_id).limit(1)) is not None


def merge_persons(session: Session, person_id: int, other_id: int) -> None:
    """Merge two persons into one with all enrolments. Revokes all credentials of both, because their reach would grow.

    The caller must have locked both.
    """
    for merged_id in (person_id, other_id):
        revocation.revoke_all(session, merged_id)
    for column in (Enrolment.person_id, LtiPerson.person_id, Credential.person_id):
        session.execute(update(column.class_).where(column == other_id).values(person_id=person_id))
    person, other = session.get_one(Person, person_id), session.get_one(Person, other_id)
    person.operator = person.operator or other.operator
    person.signed_in_at = person.signed_in_at or other.signed_in_at
    session.delete(other)
    session.flush()


def make_student(session: Session, course: str, student: Student) -> Member:
    """Enrol a person as a student, replacing any earlier role in the course."""
    return _enrol_member(session, course, student, Role.STUDENT)


def make_operator(session: Session, person_id: int) -> None:
    """Make a person an operator of the installation."""
    session.get_one(Person, person_id).operator = True


def load_member(session: Session, course: str, member_id: str) -> Member:
    """Return a member of the course by id. Raises UsageError for an unknown course or person."""
    return _load_member_by_id(session, Students(session, find_course(session, course)).load_enrolment(member_id))


def find_member(session: Session, course_id: int, student: Student) -> Member | None:
    """Return the member of the course with this id; None if there is none."""
    enrolment_id = Students(session, course_id).find_enrolment(student)
    return None if enrolment_id is None else _load_member_by_id(session, enrolment_id)


def load_enrolled_member(session: Session, row: Enrolment) -> Member:
    """Return the member of an enrolment."""
    return _build_member(row, session.get_one(Person, row.person_id))


def find_course(session: Session, name: str) -> int:
    """Return the id of the course with this name. Raises UsageError if it does not exist."""
    course_id = session.scalar(select(Course.id).where(Course.name == name))
    if course_id is None:
        raise UsageError(f"there is no course {name!r}")
    return course_id


def list_members(session: Session, course_id: int) -> list[Member]:
    """Return all members of the course, ordered by id."""
    query = _select_members().where(Enrolment.course_id == course_id).order_by(Enrolment.student)
    return [Member(*row) for row in session.execute(query)]


def list_members_after(session: Session, course_id: int, enrolment_id: int, limit: int, *roles: Role) -> list[Member]:
    """Return at most ``limit`` members of the course, with one of these roles, enrolled after this enrolment."""
    query = (
        _select_members()
        .where(Enrolment.course_id == course_id, Enrolment.id > enrolment_id, Enrolment.role.in_(roles or tuple(Role)))
        .order_by(Enrolment.id)
        .limit(limit)
    )
    return [Member(*row) for row in session.execute(query)]


def list_students(session: Session, course_id: int) -> list[tuple[Member, bool]]:
    """Return the students of the course, ordered by id, each with the result of ``has_other_access``."""
    query = (
        select(Enrolment, Person, _match_other_access())
        .join(Person, Enrolment.person_id == Person.id)
        .where(Enrolment.course_id == course_id, Enrolment.role == Role.STUDENT)
        .order_by(Enrolment.student)
    )
    return [(_build_member(enrolment, person), more) for enrolment, person, more in session.execute(query)]


def has_other_access(session: Session, row: Enrolment) -> bool:
    """Return whether the person of an enrolment is in other courses or is an operator."""
    query = (
        select(_match_other_access())
        .select_from(Enrolment)
        .join(Person, Enrolment.person_id == Person.id)
        .where(Enrolment.id == row.id)
    )
    return bool(session.scalar(query))


def list_courses(session: Session) -> list[CourseLine]:
    """Return all courses, ordered by name."""
    instructors, students = (func.count().filter(Enrolment.role == role) for role in (Role.INSTRUCTOR, Role.STUDENT))
    query = select(Course.id, Course.name, instructors, students)
    query = query.outerjoin(Enrolment, Enrolment.course_id == Course.id).group_by(Course.id, Course.name)
    return [CourseLine(*row) for row in session.execute(query.order_by(Course.name))]


@cache
def _match_other_access() -> ColumnElement[bool]:
    other = aliased(Enrolment)
    return or_(Person.operator, exists().where(other.person_id == Enrolment.person_id, other.id != Enrolment.id))


def _enrol_member(session: Session, course: str, student: Student, role: Role) -> Member:
    current_time = now(session)
    enrolment_id = Students(session, ensure_course(session, course, current_time)).enrol(student, current_time)
    row = session.get_one(Enrolment, enrolment_id)
    set_role(session, row, role)
    row.name, row.email = student.name or row.name, student.email or row.email
    session.flush()
    return _load_member_by_id(session, enrolment_id)


def _load_member_by_id(session: Session, enrolment_id: int) -> Member:
    return load_enrolled_member(session, session.get_one(Enrolment, enrolment_id))


def _select_members() -> Select[int, int, int, str, str, str, Role, bool]:
    """Return the query for the fields of members. It reads no whole rows, because a course has many members."""
    return select(
        Person.id,
        Enrolment.id,
        Enrolment.course_id,
        Enrolment.student,
        Enrolment.name,
        Enrolment.email,
        Enrolment.role,
        Person.operator,
    ).join(Person, Enrolment.person_id == Person.id)


def _build_member(enrolment: Enrolment, person: Person) -> Member:
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
