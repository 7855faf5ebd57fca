"""Tables of people: who is in which course, credentials, and the learning platforms that people come from by LTI.

The courses are in ``courses.py``.
"""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy import ForeignKey, Index, String, false
from sqlalchemy.orm import Mapped, mapped_column

from service.store.ids import LENGTH as ID_LENGTH
from service.store.ids import generate_id
from service.store.states import CredentialKind, Role
from service.store.tables.base import Base


class Person(Base):
    """A person in one or more courses; each enrolment has the id, name and address used in that course."""

    __tablename__ = "person"

    id: Mapped[int] = mapped_column(primary_key=True)
    operator: Mapped[bool] = mapped_column(default=False, server_default=false())  # administers the whole installation
    created_at: Mapped[datetime]
    signed_in_at: Mapped[datetime | None]  # or got a token, first; from then on no platform may replace them


class Enrolment(Base):
    """A member of a course, with an id that is unique in it: from the roster, or else from the folder or file name."""

    __tablename__ = "enrolment"
    __table_args__ = (Index(None, "course_id", "student", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    course_id: Mapped[int] = mapped_column(ForeignKey("course.id"))
    person_id: Mapped[int] = mapped_column(ForeignKey("person.id"))
    student: Mapped[str]  # the id, in its normal form
    written: Mapped[str] = mapped_column(server_default="")  # the id as it was first written
    role: Mapped[Role]
    name: Mapped[str] = mapped_column(default="", server_default="")
    email: Mapped[str] = mapped_column(default="", server_default="")


class Credential(Base):
    """A credential; only the hash of its secret is stored."""

    __tablename__ = "credential"

    id: Mapped[str] = mapped_column(String(ID_LENGTH), primary_key=True, default=generate_id)
    person_id: Mapped[int] = mapped_column(ForeignKey("person.id"), index=True)
    kind: Mapped[CredentialKind]
    sha256: Mapped[str] = mapped_column(String(64), unique=True)  # of the secret
    name: Mapped[str] = mapped_column(default="")  # chosen by its owner
    scopes: Mapped[Any] = mapped_column(default=list)  # permitted actions; empty for a session without a scope limit
    # Reach: one course, one role, the courses of one platform. None means unlimited.
    course_id: Mapped[int | None] = mapped_column(ForeignKey("course.id"))
    role: Mapped[Role | None]
    platform_id: Mapped[int | None] = mapped_column(ForeignKey("lti_platform.id"))
    token_id: Mapped[str | None] = mapped_column(ForeignKey("credential.id"), index=True)  # it ends with this one
    created_at: Mapped[datetime]
    expires_at: Mapped[datetime]
    used_at: Mapped[datetime | None]
    revoked_at: Mapped[datetime | None]


class LtiPlatform(Base):
    """A learning platform that launches Robomark by LTI 1.3, as registered by its administrator."""

    __tablename__ = "lti_platform"
    __table_args__ = (Index(None, "issuer", "client_id", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str]
    issuer: Mapped[str]
    client_id: Mapped[str]
    deployments: Mapped[Any] = mapped_column(default=list)
    authorization_url: Mapped[str]
    token_url: Mapped[str]
    keys_url: Mapped[str]
    # Additional origins for the platform's services.
    service_origins: Mapped[Any] = mapped_column(default=list, server_default="[]")
    created_at: Mapped[datetime]


class LtiCourse(Base):
    """The course of a platform's context, with the addresses of the platform's services for it."""

    __tablename__ = "lti_course"
    __table_args__ = (Index(None, "platform_id", "deployment", "context", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    platform_id: Mapped[int] = mapped_column(ForeignKey("lti_platform.id"))
    # The id of a context is unique within its deployment. Empty if an older release did not record it.
    deployment: Mapped[str] = mapped_column(default="", server_default="")
    context: Mapped[str]
    course_id: Mapped[int] = mapped_column(ForeignKey("course.id"), index=True)
    members_url: Mapped[str | None]
    lineitems_url: Mapped[str | None]


class LtiPerson(Base):
    """The person of a platform's subject."""

    __tablename__ = "lti_person"
    __table_args__ = (Index(None, "platform_id", "subject", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    platform_id: Mapped[int] = mapped_column(ForeignKey("lti_platform.id"))
    subject: Mapped[str]
    person_id: Mapped[int] = mapped_column(ForeignKey("person.id"), index=True)


class LtiKey(Base):
    """A key pair for signing; platforms read the public key."""

    __tablename__ = "lti_key"

    id: Mapped[str] = mapped_column(String(ID_LENGTH), primary_key=True, default=generate_id)
    private_pem: Mapped[str]
    created_at: Mapped[datetime]


class LtiLaunch(Base):
    """A pending launch: its state and nonce are valid once."""

    __tablename__ = "lti_launch"

    state_sha256: Mapped[str] = mapped_column(String(64), primary_key=True)
    platform_id: Mapped[int] = mapped_column(ForeignKey("lti_platform.id"))
    nonce: Mapped[str] = mapped_column(String(64))
    target: Mapped[str]
    expires_at: Mapped[datetime] = mapped_column(index=True)
