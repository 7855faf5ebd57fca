"""The tables behind the web: how people sign in, what a course has open, what instructors set, and whom else we tell.

Only shapes and constraints, like ``models.py``, whose tables know nothing of these.
"""

from __future__ import annotations

from datetime import datetime
from decimal import Decimal
from typing import Any

from sqlalchemy import CheckConstraint, ForeignKey, Index, LargeBinary, String
from sqlalchemy.orm import Mapped, mapped_column

from service.store.ids import LENGTH as ID_LENGTH
from service.store.ids import new_id
from service.store.models import Base
from service.store.states import CredentialKind, Role


class Credential(Base):
    """What somebody signs in with, or is signed in by: only the hash of its secret is kept."""

    __tablename__ = "credential"

    id: Mapped[str] = mapped_column(String(ID_LENGTH), primary_key=True, default=new_id)
    person_id: Mapped[int] = mapped_column(ForeignKey("person.id"), index=True)
    kind: Mapped[CredentialKind]
    sha256: Mapped[str] = mapped_column(String(64), unique=True)  # of the secret
    name: Mapped[str] = mapped_column(default="")  # what its owner calls it
    scopes: Mapped[Any] = mapped_column(default=list)  # what it may do; empty for a session without such a limit
    # How far it reaches: one course, one role, the courses of one platform. None where that is no limit.
    course_id: Mapped[int | None] = mapped_column(ForeignKey("course.id"))
    role: Mapped[Role | None]
    platform_id: Mapped[int | None] = mapped_column(ForeignKey("lti_platform.id"))
    token_id: Mapped[str | None] = mapped_column(ForeignKey("credential.id"), index=True)  # that started the session
    created_at: Mapped[datetime]
    expires_at: Mapped[datetime]
    used_at: Mapped[datetime | None]
    revoked_at: Mapped[datetime | None]


class OpenAssignment(Base):
    """An assignment that students of a course may submit to, in the version that they are marked against."""

    __tablename__ = "open_assignment"
    __table_args__ = (Index(None, "course_id", "assignment", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    course_id: Mapped[int] = mapped_column(ForeignKey("course.id"))
    assignment: Mapped[str]
    assignment_version_id: Mapped[int] = mapped_column(ForeignKey("assignment_version.id"))
    opened_at: Mapped[datetime | None]  # None: prepared, and seen by instructors alone
    closed_at: Mapped[datetime | None]
    names_hidden: Mapped[bool] = mapped_column(default=False)  # while it is marked
    # What its students submit on the web is all in one batch, made when it is opened first.
    batch_id: Mapped[str | None] = mapped_column(ForeignKey("batch.id"), index=True)


class Override(Base):
    """What an instructor says of one criterion of a submission, in place of the grader; it outlives a regrade."""

    __tablename__ = "override"
    __table_args__ = (
        Index(None, "submission_id", "criterion"),
        CheckConstraint("(marks IS NULL) = excused", name="marks"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    submission_id: Mapped[int] = mapped_column(ForeignKey("submission.id"))
    criterion: Mapped[str]
    marks: Mapped[Decimal | None]
    excused: Mapped[bool] = mapped_column(default=False)  # neither its marks nor its most count
    reason: Mapped[str]
    actor: Mapped[str]
    made_at: Mapped[datetime]
    withdrawn_at: Mapped[datetime | None]


class Comment(Base):
    """What an instructor writes to the student of a submission; an empty ``criterion`` is for all of it."""

    __tablename__ = "comment"

    id: Mapped[int] = mapped_column(primary_key=True)
    submission_id: Mapped[int] = mapped_column(ForeignKey("submission.id"), index=True)
    criterion: Mapped[str] = mapped_column(default="")
    text: Mapped[str]
    actor: Mapped[str]
    made_at: Mapped[datetime]
    withdrawn_at: Mapped[datetime | None]


class Appeal(Base):
    """A student asks for a second look at a submission, and an instructor answers."""

    __tablename__ = "appeal"

    id: Mapped[int] = mapped_column(primary_key=True)
    submission_id: Mapped[int] = mapped_column(ForeignKey("submission.id"), index=True)
    text: Mapped[str]
    asked_at: Mapped[datetime] = mapped_column(index=True)
    answer: Mapped[str | None]
    actor: Mapped[str | None]  # who answered
    answered_at: Mapped[datetime | None]


class Tryout(Base):
    """A robot program that a student runs without submitting it."""

    __tablename__ = "tryout"
    __table_args__ = (Index(None, "state", "queued_at"),)

    id: Mapped[str] = mapped_column(String(ID_LENGTH), primary_key=True, default=new_id)
    enrolment_id: Mapped[int] = mapped_column(ForeignKey("enrolment.id"), index=True)
    assignment_version_id: Mapped[int] = mapped_column(ForeignKey("assignment_version.id"))
    packed: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)
    state: Mapped[str] = mapped_column(String(16))
    lease_until: Mapped[datetime | None]
    attempt: Mapped[int] = mapped_column(default=0)
    queued_at: Mapped[datetime]
    finished_at: Mapped[datetime | None]
    words: Mapped[Any | None]  # what came of it, as it is told
    replay: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
    error: Mapped[str | None]  # a sentence


class Webhook(Base):
    """Where somebody wants to be told of what happens in a course."""

    __tablename__ = "webhook"

    id: Mapped[str] = mapped_column(String(ID_LENGTH), primary_key=True, default=new_id)
    course_id: Mapped[int] = mapped_column(ForeignKey("course.id"), index=True)
    url: Mapped[str]
    secret: Mapped[str] = mapped_column(String(64))  # what deliveries are signed with
    events: Mapped[Any] = mapped_column(default=list)
    created_at: Mapped[datetime]
    revoked_at: Mapped[datetime | None]


class Delivery(Base):
    """One thing to be told to one webhook: the outbox, written in the transaction of what it tells of."""

    __tablename__ = "delivery"
    __table_args__ = (Index(None, "delivered_at", "due_at"),)

    id: Mapped[str] = mapped_column(String(ID_LENGTH), primary_key=True, default=new_id)
    webhook_id: Mapped[str] = mapped_column(ForeignKey("webhook.id"), index=True)
    event: Mapped[str]
    payload: Mapped[Any]
    made_at: Mapped[datetime]
    due_at: Mapped[datetime | None]  # None: given up
    attempts: Mapped[int] = mapped_column(default=0)
    delivered_at: Mapped[datetime | None]
    error: Mapped[str | None]


class IdempotentReply(Base):
    """What was answered to a request that had a key, so that its repetition changes nothing."""

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
    """A learning platform that launches Robomark by LTI 1.3, as its administrator registered us there."""

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
    # Where else its services may be asked than at the addresses above.
    service_origins: Mapped[Any] = mapped_column(default=list, server_default="[]")
    created_at: Mapped[datetime]


class LtiCourse(Base):
    """Which course a platform's context is, and where the platform's services for it are."""

    __tablename__ = "lti_course"
    __table_args__ = (Index(None, "platform_id", "deployment", "context", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    platform_id: Mapped[int] = mapped_column(ForeignKey("lti_platform.id"))
    # A context's id is unique within its deployment. Empty where an older release did not record it.
    deployment: Mapped[str] = mapped_column(default="", server_default="")
    context: Mapped[str]
    course_id: Mapped[int] = mapped_column(ForeignKey("course.id"), index=True)
    members_url: Mapped[str | None]
    lineitems_url: Mapped[str | None]


class LtiPerson(Base):
    """Whom a platform means by a subject."""

    __tablename__ = "lti_person"
    __table_args__ = (Index(None, "platform_id", "subject", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    platform_id: Mapped[int] = mapped_column(ForeignKey("lti_platform.id"))
    subject: Mapped[str]
    person_id: Mapped[int] = mapped_column(ForeignKey("person.id"), index=True)


class LtiKey(Base):
    """A key pair that we sign with; platforms read the public half."""

    __tablename__ = "lti_key"

    id: Mapped[str] = mapped_column(String(ID_LENGTH), primary_key=True, default=new_id)
    private_pem: Mapped[str]
    created_at: Mapped[datetime]


class LtiLaunch(Base):
    """A launch that was begun: its state and nonce count once."""

    __tablename__ = "lti_launch"

    state_sha256: Mapped[str] = mapped_column(String(64), primary_key=True)
    platform_id: Mapped[int] = mapped_column(ForeignKey("lti_platform.id"))
    nonce: Mapped[str] = mapped_column(String(64))
    target: Mapped[str]
    expires_at: Mapped[datetime] = mapped_column(index=True)


#: All tables there are: these and those of ``models.py``.
METADATA = Base.metadata
