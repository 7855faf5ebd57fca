"""What is kept of learning platforms: how each is registered, which launches were begun, whom and what they mean.

Signs and fetches nothing; ``service.lti`` does.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import timedelta

from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from service.store.engine import now
from service.store.models import Course, Enrolment, Person
from service.store.people.people import is_more_than
from service.store.people.students import Students, course_of
from service.store.states import Role
from service.store.web_tables import LtiCourse, LtiKey, LtiLaunch, LtiPerson, LtiPlatform
from sim.errors import UsageError
from submissions.people import Student

_LAUNCH_TAKES = timedelta(minutes=10)


@dataclass(frozen=True, slots=True)
class Platform:
    """A learning platform, as its administrator registered Robomark there."""

    id: int
    name: str
    issuer: str
    client_id: str
    deployments: tuple[str, ...]
    authorization_url: str
    token_url: str
    keys_url: str


@dataclass(frozen=True, slots=True)
class PendingLaunch:
    """A launch whose answer has come: what it was begun with."""

    platform: Platform
    nonce: str
    target: str


@dataclass(frozen=True, slots=True)
class Launched:
    """Whom and where a launch means."""

    person_id: int
    course_id: int
    role: Role


@dataclass(frozen=True, slots=True)
class CourseLink:
    """A course that a platform launches, and where the platform's services for it are."""

    platform: Platform
    members_url: str | None
    lineitems_url: str | None


def register(
    session: Session,
    name: str,
    issuer: str,
    client_id: str,
    deployments: Iterable[str],
    authorization_url: str,
    token_url: str,
    keys_url: str,
) -> int:
    """Make a platform known, or change one of the same issuer and client; its id.

    Raises UsageError for an address that is none of the web.
    """
    for what, url in (("login", authorization_url), ("token", token_url), ("keys", keys_url)):
        if not url.startswith(("https://", "http://")):
            raise UsageError(f"the {what} address is {url!r}, expected one that begins with https://")
    row = session.scalar(select(LtiPlatform).where(LtiPlatform.issuer == issuer, LtiPlatform.client_id == client_id))
    if row is None:
        row = LtiPlatform(issuer=issuer, client_id=client_id, created_at=now(session))
        session.add(row)
    row.name, row.deployments = name, sorted(deployments)
    row.authorization_url, row.token_url, row.keys_url = authorization_url, token_url, keys_url
    session.flush()
    return row.id


def platforms(session: Session) -> list[Platform]:
    """All that are registered, by name."""
    return [_platform(row) for row in session.scalars(select(LtiPlatform).order_by(LtiPlatform.name, LtiPlatform.id))]


def find_platform(session: Session, issuer: str, client_id: str | None) -> Platform | None:
    """The platform of this issuer; of several clients of one issuer the client has to be said."""
    query = select(LtiPlatform).where(LtiPlatform.issuer == issuer)
    if client_id is not None:
        query = query.where(LtiPlatform.client_id == client_id)
    found = session.scalars(query.limit(2)).all()
    return _platform(found[0]) if len(found) == 1 else None


def begin_launch(session: Session, platform: Platform, target: str) -> tuple[str, str]:
    """A state and a nonce, each of which counts once and for a few minutes."""
    at = now(session)
    session.execute(delete(LtiLaunch).where(LtiLaunch.expires_at < at))
    state, nonce = secrets.token_urlsafe(32), secrets.token_urlsafe(32)
    session.add(
        LtiLaunch(
            state_sha256=_sha256(state),
            platform_id=platform.id,
            nonce=nonce,
            target=target,
            expires_at=at + _LAUNCH_TAKES,
        )
    )
    return state, nonce


def take_launch(session: Session, state: str) -> PendingLaunch | None:
    """What was begun with this state, which counts no more; None where nothing was, or too long ago."""
    row = session.get(LtiLaunch, _sha256(state), with_for_update=True)
    if row is None:
        return None
    session.delete(row)
    if row.expires_at <= now(session):
        return None
    return PendingLaunch(_platform(session.get_one(LtiPlatform, row.platform_id)), row.nonce, row.target)


def meet(
    session: Session,
    platform: Platform,
    context: str,
    course_title: str,
    subject: str,
    student: Student,
    role: Role,
    members_url: str | None,
    lineitems_url: str | None,
) -> Launched | None:
    """Whom a launch means: enrolled where new; the course is made when one of its instructors comes first.

    None where a student comes to a course that no instructor has launched. A platform reaches no course but those that
    it made itself, and makes nobody an instructor elsewhere.
    """
    of_context = (LtiCourse.platform_id == platform.id, LtiCourse.context == context)
    link = session.scalar(select(LtiCourse).where(*of_context))
    if link is None:
        if role is not Role.INSTRUCTOR:
            return None
        link = LtiCourse(platform_id=platform.id, context=context, course_id=_new_course(session, course_title))
        session.add(link)
    link.members_url = members_url or link.members_url
    link.lineitems_url = lineitems_url or link.lineitems_url
    session.flush()
    person_id = enrol(session, platform, link.course_id, subject, student, role)
    return Launched(person_id, link.course_id, role)


def enrol(session: Session, platform: Platform, course_id: int, subject: str, student: Student, role: Role) -> int:
    """The person whom the platform calls so, in the course with this role.

    Raises UsageError where their id is that of somebody who cannot be taken for them.
    """
    of_subject = (LtiPerson.platform_id == platform.id, LtiPerson.subject == subject)
    known = session.scalar(select(LtiPerson).where(*of_subject))
    if known is not None:
        in_course = (Enrolment.person_id == known.person_id, Enrolment.course_id == course_id)
        row = session.scalar(select(Enrolment).where(*in_course).limit(1))
        person = session.get_one(Person, known.person_id)
        person.name, person.email = student.name or person.name, student.email or person.email
        if row is not None:
            row.role = role
            return known.person_id
    enrolment_id = Students(session, course_id).enrol(student, now(session))
    row = session.get_one(Enrolment, enrolment_id)
    claimed = select(LtiPerson.id).where(LtiPerson.platform_id == platform.id, LtiPerson.person_id == row.person_id)
    is_another = row.role is not Role.STUDENT or is_more_than(session, row) or session.scalar(claimed) is not None
    if known is None and is_another:
        # Else whoever chooses an id on the platform would choose whom they are here.
        raise UsageError(f"somebody else is called {student.id!r} in this course; ask whoever runs it")
    row.role = role
    if known is None:
        session.add(LtiPerson(platform_id=platform.id, subject=subject, person_id=row.person_id))
    else:
        # The same person in another course of the platform.
        row.person_id = known.person_id
    session.flush()
    return row.person_id


def course_link(session: Session, course_id: int) -> CourseLink | None:
    """The platform that launches the course, if one does."""
    row = session.scalar(select(LtiCourse).where(LtiCourse.course_id == course_id).limit(1))
    if row is None:
        return None
    return CourseLink(_platform(session.get_one(LtiPlatform, row.platform_id)), row.members_url, row.lineitems_url)


def subjects(session: Session, platform: Platform, course_id: int) -> dict[str, str]:
    """What the platform calls the students of a course, by the ids that the course knows them by."""
    query = (
        select(Enrolment.student, LtiPerson.subject)
        .join(LtiPerson, LtiPerson.person_id == Enrolment.person_id)
        .where(Enrolment.course_id == course_id, LtiPerson.platform_id == platform.id)
    )
    return dict(session.execute(query).all())


def private_keys(session: Session) -> list[tuple[str, str]]:
    """Our keys, the newest first: id and private half, as PEM."""
    rows = session.scalars(select(LtiKey).order_by(LtiKey.created_at.desc(), LtiKey.id))
    return [(row.id, row.private_pem) for row in rows]


def add_private_key(session: Session, pem: str) -> None:
    """Keep a key; it is signed with from now on."""
    session.add(LtiKey(private_pem=pem, created_at=now(session)))
    session.flush()


def _new_course(session: Session, title: str) -> int:
    """A course of this name, or of one like it where another course has it."""
    name, number = title, 1
    while session.scalar(select(Course.id).where(Course.name == name)) is not None:
        number += 1
        name = f"{title} ({number})"
    return course_of(session, name, now(session))


def _platform(row: LtiPlatform) -> Platform:
    return Platform(
        row.id,
        row.name,
        row.issuer,
        row.client_id,
        tuple(row.deployments),
        row.authorization_url,
        row.token_url,
        row.keys_url,
    )


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
