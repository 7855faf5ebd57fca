"""Tables of the web service: credentials, open assignments, overrides, appeals, test runs, webhooks and LTI.

Contains only columns and constraints, like ``models.py``, whose tables do not refer to these.
"""

from __future__ import annotations

from datetime import datetime
from decimal import Decimal
from typing import Any

from sqlalchemy import CheckConstraint, ForeignKey, Index, LargeBinary, String
from sqlalchemy.orm import Mapped, mapped_column

from service.store.ids import LENGTH as ID_LENGTH
from service.store.ids import generate_id
from service.store.models import Base
from service.store.states import CredentialKind, Role


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


class OpenAssignment(Base):
    """An assignment of a course, in the version used for marking."""

    __tablename__ = "open_assignment"
    __table_args__ = (Index(None, "course_id", "assignment", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    course_id: Mapped[int] = mapped_column(ForeignKey("course.id"))
    assignment: Mapped[str]
    assignment_version_id: Mapped[int] = mapped_column(ForeignKey("assignment_version.id"))
    opened_at: Mapped[datetime | None]  # None: prepared, and visible only to instructors
    closed_at: Mapped[datetime | None]
    names_hidden: Mapped[bool] = mapped_column(default=False)  # during marking
    # All web submissions to it are in one batch, created when it is first opened.
    batch_id: Mapped[str | None] = mapped_column(ForeignKey("batch.id"), index=True)


class Override(Base):
    """An override of one criterion of a submission; it remains in force after a regrade."""

    __tablename__ = "override"
    __table_args__ = (
        Index(None, "submission_id", "criterion"),
        CheckConstraint("(marks IS NULL) = excused", name="marks"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    submission_id: Mapped[int] = mapped_column(ForeignKey("submission.id"))
    criterion: Mapped[str]
    marks: Mapped[Decimal | None]
    excused: Mapped[bool] = mapped_column(default=False)  # neither its marks nor its maximum count
    reason: Mapped[str]
    actor: Mapped[str]
    made_at: Mapped[datetime]
    withdrawn_at: Mapped[datetime | None]


class Comment(Base):
    """A comment by staff for the student; an empty ``criterion`` refers to the whole submission."""

    __tablename__ = "comment"

    id: Mapped[int] = mapped_column(primary_key=True)
    submission_id: Mapped[int] = mapped_column(ForeignKey("submission.id"), index=True)
    criterion: Mapped[str] = mapped_column(default="")
    text: Mapped[str]
    actor: Mapped[str]
    made_at: Mapped[datetime]
    withdrawn_at: Mapped[datetime | None]


class Appeal(Base):
    """An appeal of a student against a grade, with the answer of an instructor."""

    __tablename__ = "appeal"

    id: Mapped[int] = mapped_column(primary_key=True)
    submission_id: Mapped[int] = mapped_column(ForeignKey("submission.id"), index=True)
    text: Mapped[str]
    asked_at: Mapped[datetime] = mapped_column(index=True)
    answer: Mapped[str | None]
    actor: Mapped[str | None]  # the instructor who answered
    answered_at: Mapped[datetime | None]


class Tryout(Base):
    """A test run: a program that a student runs without submitting it."""

    __tablename__ = "tryout"
    __table_args__ = (Index(None, "state", "queued_at"),)

    id: Mapped[str] = mapped_column(String(ID_LENGTH), primary_key=True, default=generate_id)
    enrolment_id: Mapped[int] = mapped_column(ForeignKey("enrolment.id"), index=True)
    assignment_version_id: Mapped[int] = mapped_column(ForeignKey("assignment_version.id"))
    packed: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)
    state: Mapped[str] = mapped_column(String(16))
    lease_until: Mapped[datetime | None]
    attempt: Mapped[int] = mapped_column(default=0)
    queued_at: Mapped[datetime]
    finished_at: Mapped[datetime | None]
    words: Mapped[Any | None]  # the result, as data for display
    replay: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
    error: Mapped[str | None]  # a sentence


class Webhook(Base):
    """A webhook: an address that receives events of a course."""

    __tablename__ = "webhook"

    id: Mapped[str] = mapped_column(String(ID_LENGTH), primary_key=True, default=generate_id)
    course_id: Mapped[int] = mapped_column(ForeignKey("course.id"), index=True)
    url: Mapped[str]
    secret: Mapped[str] = mapped_column(String(64))  # signs the deliveries
    events: Mapped[Any] = mapped_column(default=list)
    created_at: Mapped[datetime]
    revoked_at: Mapped[datetime | None]


class Delivery(Base):
    """The outbox: an event for one webhook, written in the transaction of the change that it reports."""

    __tablename__ = "delivery"
    __table_args__ = (Index(None, "delivered_at", "due_at"),)

    id: Mapped[str] = mapped_column(String(ID_LENGTH), primary_key=True, default=generate_id)
    webhook_id: Mapped[str] = mapped_column(ForeignKey("webhook.id"), index=True)
    event: Mapped[str]
    payload: Mapped[Any]
    made_at: Mapped[datetime]
    due_at: Mapped[datetime | None]  # None: given up
    attempts: Mapped[int] = mapped_column(default=0)
    delivered_at: Mapped[datetime | None]
    error: Mapped[str | None]


class IdempotentReply(Base):
    """The reply to a request with an idempotency key, so that repeating the request changes nothing."""

    __tablename__ = "idempotent_reply"
    __table_args__ = (Index(None, "credential_id", "key", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    credential_id: Mapped[str] = mapped_column(ForeignKey("credential.id"))
    key: Mapped[str]
    request_sha256: Mapped[str] = mapped_column(String(64))
    status: Mapped[int]
    body: Mapped[bytes] = mapped_column(LargeBinary)
    made_at: Mapped[datetime] = mapped_column(index=True)


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


#: All tables: these and those of ``models.py``.
METADATA = Base.metadata
