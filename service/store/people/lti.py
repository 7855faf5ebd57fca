"""Learning platforms: registrations, and the persons and courses that launches map to.

``lti_launches.py`` keeps the pending launches. Signs and fetches nothing; ``service.lti`` does.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from urllib.parse import urlsplit

from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from service.store.conditional_insert import insert_if_new
from service.store.engine import now
from service.store.people import revocation
from service.store.people.membership import has_other_access, is_from_platform, set_role
from service.store.people.students import DEFAULT_COURSE, Students, ensure_course
from service.store.states import Role
from service.store.tables.courses import Course
from service.store.tables.people import (
    Credential,
    Enrolment,
    LtiCourse,
    LtiKey,
    LtiPerson,
    LtiPlatform,
    Person,
)
from sim.errors import UsageError
from submissions.student_identity import Student

#: Longest id of a subject, context or deployment. Longer ones are rejected, because cut ones could collide.
MAX_ID_LENGTH = 250
_MAX_STUDENT_ID_LENGTH = 500
#: Longest issuer and client id: a PostgreSQL index contains both.
MAX_REGISTERED_LENGTH = 255


@dataclass(frozen=True, slots=True)
class Registration:
    """Registration of a learning platform, identified by its issuer and client id together.

    ``service_origins`` are additional origins that may be queried for members and sent marks.
    """

    name: str
    issuer: str
    client_id: str
    deployments: tuple[str, ...]
    authorization_url: str
    token_url: str
    keys_url: str
    service_origins: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Platform(Registration):
    """A registered learning platform."""

    id: int = field(kw_only=True)

    def has_registered_origin(self, url: str) -> bool:
        """Return whether the origin of this address is registered, in a platform address or as a service origin."""
        origin = parse_origin(url)
        own_origins = (parse_origin(each) for each in (self.authorization_url, self.token_url, self.keys_url))
        return origin is not None and origin in {*own_origins, *self.service_origins}


@dataclass(frozen=True, slots=True)
class LaunchResult:
    """The person and course of a launch."""

    person_id: int
    course_id: int
    role: Role


@dataclass(frozen=True, slots=True)
class CourseLink:
    """A course that a platform launches, with the addresses of the platform's services for it."""

    platform: Platform
    members_url: str | None
    lineitems_url: str | None


def parse_origin(url: str) -> str | None:
    """Return the scheme, host and port of a web address; None if it is not one."""
    try:
        parts = urlsplit(url)
        port = parts.port or {"https": 443, "http": 80}.get(parts.scheme)
    except ValueError:
        return None
    if port is None or not parts.hostname or parts.username is not None:
        return None
    host = f"[{parts.hostname}]" if ":" in parts.hostname else parts.hostname
    return f"{parts.scheme}://{host}:{port}"


def register_platform(session: Session, registration: Registration) -> int:
    """Register a platform, or update the one with the same issuer and client. Returns its id.

    Raises UsageError for an id that is too long, and for an address without a host or that does not begin with https://
    or http://.
    """
    for kind, value in (("issuer", registration.issuer), ("client", registration.client_id)):
        if len(value) > MAX_REGISTERED_LENGTH:
            raise UsageError(f"the platform's {kind} is longer than {MAX_REGISTERED_LENGTH} characters")
    deployments = sorted(registration.deployments)
    for deployment in deployments:
        _check_id("deployment", deployment)
    origins = {parse_origin(each): each for each in registration.service_origins}
    if None in origins:
        raise UsageError(f"the service address is {origins[None]!r}, expected one like https://platform.example.org")
    for subject, url in (
        ("login", registration.authorization_url),
        ("token", registration.token_url),
        ("keys", registration.keys_url),
    ):
        if not url.startswith(("https://", "http://")) or parse_origin(url) is None:
            raise UsageError(f"the {subject} address is {url!r}, expected one like https://platform.example.org/path")
    values = {
        "name": registration.name,
        "deployments": deployments,
        "authorization_url": registration.authorization_url,
        "token_url": registration.token_url,
        "keys_url": registration.keys_url,
        "service_origins": sorted(filter(None, origins)),
    }
    identity = {"issuer": registration.issuer, "client_id": registration.client_id}
    insert_if_new(session, LtiPlatform, created_at=now(session), **identity, **values)
    is_same = (LtiPlatform.issuer == registration.issuer, LtiPlatform.client_id == registration.client_id)
    row = session.scalars(select(LtiPlatform).where(*is_same).with_for_update(key_share=True)).one()
    for column, setting in values.items():
        setattr(row, column, setting)
    session.flush()
    return row.id


def list_platforms(session: Session) -> list[Platform]:
    """Return all registered platforms, ordered by name."""
    return [
        build_platform(row) for row in session.scalars(select(LtiPlatform).order_by(LtiPlatform.name, LtiPlatform.id))
    ]


def find_platform(session: Session, issuer: str, client_id: str | None) -> Platform | None:
    """Return the platform of this issuer. If an issuer has several clients, the client id is required."""
    query = select(LtiPlatform).where(LtiPlatform.issuer == issuer)
    if client_id is not None:
        query = query.where(LtiPlatform.client_id == client_id)
    platform_rows = session.scalars(query.limit(2)).all()
    return build_platform(platform_rows[0]) if len(platform_rows) == 1 else None


def resolve_launch(
    session: Session,
    platform: Platform,
    deployment: str,
    context: str,
    course_title: str,
    subject: str,
    student: Student,
    role: Role,
    members_url: str | None,
    lineitems_url: str | None,
) -> LaunchResult | None:
    """Return the person and course of a launch; enrols new members. An instructor's first launch creates the course.

    Returns None for a student in a context that no instructor has launched. A platform reaches only courses that were
    created from it. Only an instructor's launch sets the addresses of the platform's services.

    Raises UsageError for ids that are too long, and if the student's id belongs to another person.
    """
    _check_id("deployment", deployment)
    _check_id("context", context)
    lock_platform(session, platform)
    link = _find_context_course(session, platform, deployment, context, subject)
    if link is None:
        if role is not Role.INSTRUCTOR:
            return None
        link = LtiCourse(
            platform_id=platform.id,
            deployment=deployment,
            context=context,
            course_id=_create_course(session, course_title),
        )
        session.add(link)
    if role is Role.INSTRUCTOR:
        link.members_url = members_url or link.members_url
        link.lineitems_url = lineitems_url or link.lineitems_url
    session.flush()
    person_id = enrol_subject(session, platform, link.course_id, subject, student, role)
    return LaunchResult(person_id, link.course_id, role)


def enrol_subject(
    session: Session, platform: Platform, course_id: int, subject: str, student: Student, role: Role
) -> int:
    """Enrol a platform's subject in the course with this role and return the person's id.

    Updates the role of the subject's existing enrolment. An older enrolment with the same id is reused only if it
    belongs to no other person. Otherwise a user could choose any identity by choosing an id on the platform.

    Raises UsageError if the id belongs to another person or is too long.
    """
    _check_id("subject", subject)
    if len(student.id) > _MAX_STUDENT_ID_LENGTH:
        raise UsageError("the platform's user ID is longer than %(most)s characters", most=_MAX_STUDENT_ID_LENGTH)
    lock_platform(session, platform)
    session.get_one(Course, course_id, with_for_update={"key_share": True})
    is_subject = (LtiPerson.platform_id == platform.id, LtiPerson.subject == subject)
    known_person = session.scalar(select(LtiPerson).where(*is_subject))
    row = None if known_person is None else _find_enrolment(session, known_person.person_id, course_id)
    if row is None:
        row = _create_enrolment(session, course_id, student, None if known_person is None else known_person.person_id)
        if known_person is None:
            session.add(LtiPerson(platform_id=platform.id, subject=subject, person_id=row.person_id))
    row.name, row.email = student.name or row.name, student.email or row.email
    set_role(session, row, role)
    session.flush()
    return row.person_id


def _create_enrolment(session: Session, course_id: int, student: Student, person_id: int | None) -> Enrolment:
    """Return an unclaimed enrolment for the student, belonging to the given person or to a new one.

    Raises UsageError if another person has claimed the student's id.
    """
    row = session.get_one(Enrolment, Students(session, course_id).enrol(student, now(session)))
    if not _is_unclaimed(session, row):
        raise UsageError(
            "another person already has the ID '%(id)s' in this course; ask an operator of Robomark",
            id=student.id[:MAX_ID_LENGTH],
        )
    # Existing links to it would sign in another user as this person.
    revocation.revoke_all(session, row.person_id)
    if person_id is not None:
        unused_person_id, row.person_id = row.person_id, person_id
        session.flush()
        session.execute(delete(Credential).where(Credential.person_id == unused_person_id))
        session.execute(delete(Person).where(Person.id == unused_person_id))
    return row


def _is_unclaimed(session: Session, row: Enrolment) -> bool:
    """Return whether an enrolment is unclaimed: a student in this course only, who never signed in."""
    person = session.get_one(Person, row.person_id)
    has_signed_in = person.signed_in_at is not None or is_from_platform(session, person.id)
    return not (has_signed_in or row.role is not Role.STUDENT or has_other_access(session, row))


def _find_enrolment(session: Session, person_id: int, course_id: int) -> Enrolment | None:
    conditions = (Enrolment.person_id == person_id, Enrolment.course_id == course_id)
    return session.scalar(select(Enrolment).where(*conditions).limit(1))


def _find_context_course(
    session: Session, platform: Platform, deployment: str, context: str, subject: str
) -> LtiCourse | None:
    """Return the course of a deployment's context.

    A course without a recorded deployment is assigned to the first deployment from which one of its instructors
    launches it.
    """
    is_context = (LtiCourse.platform_id == platform.id, LtiCourse.context == context)
    course_row = session.scalar(select(LtiCourse).where(*is_context, LtiCourse.deployment == deployment))
    if course_row is not None:
        return course_row
    undeployed_row = session.scalar(select(LtiCourse).where(*is_context, LtiCourse.deployment == ""))
    if undeployed_row is None:
        return None
    instructor_query = (
        select(Enrolment.id)
        .join(LtiPerson, LtiPerson.person_id == Enrolment.person_id)
        .where(LtiPerson.platform_id == platform.id, LtiPerson.subject == subject)
        .where(Enrolment.course_id == undeployed_row.course_id, Enrolment.role == Role.INSTRUCTOR)
    )
    if session.scalar(instructor_query.limit(1)) is None:
        return None
    undeployed_row.deployment = deployment
    return undeployed_row


def lock_platform(session: Session, platform: Platform) -> None:
    """Lock the platform, so that concurrent launches of one subject or context do not both create it."""
    session.get_one(LtiPlatform, platform.id, with_for_update={"key_share": True})


def _check_id(kind: str, value: str) -> None:
    if len(value) > MAX_ID_LENGTH:
        raise UsageError("the platform's %(kind)s ID is longer than %(most)s characters", kind=kind, most=MAX_ID_LENGTH)


def find_course_link(session: Session, course_id: int) -> CourseLink | None:
    """Return the platform that launches the course; None if none does."""
    row = session.scalar(select(LtiCourse).where(LtiCourse.course_id == course_id).limit(1))
    if row is None:
        return None
    return CourseLink(build_platform(session.get_one(LtiPlatform, row.platform_id)), row.members_url, row.lineitems_url)


def load_subjects(session: Session, platform: Platform, course_id: int) -> dict[str, str]:
    """Return the platform's subjects for the students of a course, by student id."""
    query = (
        select(Enrolment.student, LtiPerson.subject)
        .join(LtiPerson, LtiPerson.person_id == Enrolment.person_id)
        .where(Enrolment.course_id == course_id, LtiPerson.platform_id == platform.id)
    )
    return dict(session.execute(query).all())


def load_private_keys(session: Session) -> list[tuple[str, str]]:
    """Return the tool's own keys, newest first, as (id, private key in PEM)."""
    rows = session.scalars(select(LtiKey).order_by(LtiKey.created_at.desc(), LtiKey.id))
    return [(row.id, row.private_pem) for row in rows]


def add_private_key(session: Session, pem: str) -> None:
    """Store a key, which is used for signing from now on."""
    session.add(LtiKey(private_pem=pem, created_at=now(session)))
    session.flush()


def _create_course(session: Session, title: str) -> int:
    """Create a course with this name, or with a number appended if the name is taken.

    Never uses the name of the default course, even before it exists, because its instructors may become operators.
    """
    name, number = title, 1
    while name == DEFAULT_COURSE or session.scalar(select(Course.id).where(Course.name == name)) is not None:
        number += 1
        name = f"{title} ({number})"
    return ensure_course(session, name, now(session))


def build_platform(row: LtiPlatform) -> Platform:
    """Return the platform of a row."""
    return Platform(
        row.name,
        row.issuer,
        row.client_id,
        tuple(row.deployments),
        row.authorization_url,
        row.token_url,
        row.keys_url,
        tuple(row.service_origins),
        id=row.id,
    )
