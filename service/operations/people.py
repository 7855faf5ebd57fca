"""Members of a course and the persons behind them: enrol, show, sign out, remove and join them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta

from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.operations.credentials import check_scopes, check_token_count
from service.operations.errors import Conflict, Invalid, NotFound
from service.operations.lookup import check_no_names_hidden, check_operator, require_course
from service.store import audit
from service.store.engine import now, retry_conflicts
from service.store.locks import lock_course, lock_persons
from service.store.people import credentials, membership, revocation
from service.store.people.credentials import CredentialLine
from service.store.people.membership import Member as Member
from service.store.people.reach import Reach
from service.store.people.students import Students
from service.store.purge import remove_student
from service.store.states import CredentialKind, Role
from service.store.tables.people import Enrolment, Person
from sim.sentences import Sentence
from submissions.student_identity import Student

_MAX_TEXT_LENGTH = 200


@dataclass(frozen=True, slots=True)
class PersonView:
    """A person, for operators: their enrolments with course names, and their credentials."""

    member: Member
    enrolments: tuple[tuple[str, Member], ...]
    credentials: tuple[CredentialLine, ...]
    from_platform: bool
    elsewhere: tuple[tuple[str, Member], ...]  # other persons who are instructors with the same id in other courses


@dataclass(frozen=True, slots=True)
class JoinRequest:
    """Two enrolments whose persons are merged. ``from_platform`` permits merging people from a learning platform."""

    enrolment_id: int
    other_id: int
    from_platform: bool = False


@dataclass(frozen=True, slots=True)
class TokenForRequest:
    """A token for a member of a course, limited to this course."""

    name: str
    scopes: frozenset[str]
    days: int


def find(service: Service, actor: Actor, course: str, student: str) -> Member:
    """Return the member of a course by course name and id. Raises NotFound, and UsageError if there is none."""
    check_operator(actor)
    with service.store.reading() as session:
        return membership.load_member(session, course, student)


def show(service: Service, actor: Actor, enrolment_id: int) -> PersonView:
    """Return the person of an enrolment. Raises NotFound."""
    check_operator(actor)
    with service.store.reading() as session:
        row = _require_enrolment(session, enrolment_id)
        return PersonView(
            membership.load_enrolled_member(session, row),
            tuple(membership.load_enrolments(session, row.person_id)),
            tuple(credentials.list_credentials(session, row.person_id)),
            membership.is_from_platform(session, row.person_id),
            tuple(membership.find_same_id_instructors(session, row.id)),
        )


def sign_out(service: Service, actor: Actor, enrolment_id: int, *, release: bool = False) -> int:
    """End all links, sessions and tokens of a person. Returns the number ended.

    With ``release``, the student's next launch from the course's learning platform may claim this enrolment, even if
    the person has signed in before. Raises NotFound.
    """
    check_operator(actor)
    with service.store.transaction() as session:
        row = _require_enrolment(session, enrolment_id)
        ended_count = revocation.revoke_all(session, row.person_id)
        if release:
            session.get_one(Person, row.person_id).signed_in_at = None
        audit.record_action(
            session, actor.name, "sign out", "person", str(row.person_id), ended=ended_count, released=release
        )
    return ended_count


@retry_conflicts
def join(service: Service, actor: Actor, request: JoinRequest) -> Member:
    """Merge the persons of two enrolments in different courses, and sign both out.

    Raises NotFound. Raises Conflict if they are the same person or are in the same course. Raises Invalid if one is
    from a learning platform and the request does not permit it.
    """
    check_operator(actor)
    with service.store.transaction() as session:
        row, other = _require_enrolment(session, request.enrolment_id), _require_enrolment(session, request.other_id)
        person_id, other_person = row.person_id, other.person_id
        if person_id == other_person:
            raise Conflict("these two accounts already belong to one person")
        members = [
            each for which in (person_id, other_person) for _, each in membership.load_enrolments(session, which)
        ]
        # A launch by one of them into a course of the other waits, or has enrolled them before the next statement.
        for course_id in sorted({each.course_id for each in members}):
            lock_course(session, course_id)
        lock_persons(session, person_id, other_person)
        own_courses, other_courses = (
            {each.enrolment_id: name for name, each in membership.load_enrolments(session, which)}
            for which in (person_id, other_person)
        )
        if shared_courses := sorted(set(own_courses.values()) & set(other_courses.values())):
            raise Conflict(
                "both accounts are in the course %(course)s, so they cannot belong to one person",
                course=shared_courses[0],
            )
        has_platform_member = any(membership.is_from_platform(session, each) for each in (person_id, other_person))
        if has_platform_member and not request.from_platform:
            raise Invalid(
                "one of the accounts signs in through a learning platform; "
                "confirm that the platform may sign in the joined person"
            )
        membership.merge_persons(session, person_id, other_person)
        detail = {"joined": other_person, "enrolments": sorted(other_courses)}
        audit.record_action(session, actor.name, "join", "person", str(person_id), **detail)
        return membership.load_enrolled_member(session, row)


def enrol(service: Service, actor: Actor, course_id: int, students: Sequence[Student]) -> list[int]:
    """Enrol students, all or none, and update the names and e-mail addresses of enrolled ones. Returns enrolments.

    Raises:
        NotFound: The course does not exist, or the actor does not instruct it.
        Invalid: An id, name or e-mail address is too long.
        UsageError: An id is empty or ambiguous.
    """
    check_lengths(students)
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        return _enrol_students(session, actor, course_id, students)


def enrol_new(service: Service, actor: Actor, course_id: int, student: Student) -> int:
    """Enrol a student who is not in the course yet. Returns the enrolment. Raises like ``enrol``, and Conflict."""
    check_lengths([student])
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        existing_member = membership.find_member(session, course_id, student)
        if existing_member is not None:
            raise _build_enrolled_error(existing_member)
        return _enrol_students(session, actor, course_id, [student])[0]


def check_lengths(students: Sequence[Student]) -> None:
    """Raise Invalid if an id, a name or an e-mail address is too long."""
    for student in students:
        if max(map(len, (student.id, student.name, student.email))) > _MAX_TEXT_LENGTH:
            raise Invalid(
                "%(id)s: the ID, name or address is too long, expected at most %(most)s characters",
                id=student.id[:_MAX_TEXT_LENGTH],
                most=_MAX_TEXT_LENGTH,
            )


@retry_conflicts
def remove(service: Service, actor: Actor, course_id: int, enrolment_id: int) -> str:
    """Remove a member without submissions from a course, and revoke their credentials there. Returns their id.

    Instructors can remove students; operators can also remove instructors. Raises NotFound, Invalid if names are
    hidden, and UsageError for a member with submissions.
    """
    with service.store.transaction() as session:
        lock_course(session, course_id)
        row = _require_enrolment(session, enrolment_id)
        is_ours = row.course_id == course_id
        is_permitted = actor.roles.get(course_id) is Role.INSTRUCTOR and row.role is Role.STUDENT
        if not is_ours or not (actor.operator or is_permitted):
            raise NotFound("this person is not a member of the course")
        check_no_names_hidden(session, actor, course_id)
        student_id = row.student
        membership.set_role(session, row, Role.STUDENT)
        remove_student(session, row.id, actor.name)
    return student_id


def issue_token(service: Service, actor: Actor, enrolment_id: int, request: TokenForRequest) -> str:
    """Return the secret of a new token for a member, limited to their course. Raises NotFound, Invalid and Conflict."""
    check_operator(actor)
    with service.store.transaction() as session:
        row = _require_enrolment(session, enrolment_id)
        check_scopes(request.scopes, [row.role], operator=False)
        check_token_count(session, row.person_id)
        secret = credentials.issue_credential(
            session,
            row.person_id,
            CredentialKind.TOKEN,
            timedelta(days=request.days),
            name=request.name,
            reach=Reach(course_id=row.course_id, scopes=request.scopes),
        )
        audit.record_action(session, actor.name, "token", "person", str(row.person_id), scopes=sorted(request.scopes))
        return secret


def _enrol_students(session: Session, actor: Actor, course_id: int, new_students: Sequence[Student]) -> list[int]:
    lock_course(session, course_id)
    current_time, students = now(session), Students(session, course_id)
    enrolment_ids = [students.enrol(each, current_time) for each in new_students]
    audit.record_action(session, actor.name, "enrol", "course", str(course_id), students=len(new_students))
    return enrolment_ids


def _build_enrolled_error(member: Member) -> Conflict:
    has_name = member.name and member.name != member.id
    name_note = Sentence(", as %(name)s", name=member.name) if has_name else ""
    if member.role is Role.INSTRUCTOR:
        return Conflict(
            "%(id)s is an instructor of this course%(called)s; expected the ID of a student.",
            id=member.id,
            called=name_note,
        )
    return Conflict(
        "%(id)s is already enrolled in this course%(called)s; to change the name or address, upload a table.",
        id=member.id,
        called=name_note,
    )


def _require_enrolment(session: Session, enrolment_id: int) -> Enrolment:
    row = session.get(Enrolment, enrolment_id)
    if row is None:
        raise NotFound("this person is not a member of any course")
    return row
