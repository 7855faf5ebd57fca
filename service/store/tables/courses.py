"""Tables of courses: assignments and their versions, deadlines and attempts, and webhooks.

The people of a course are in ``people.py``.
"""

from __future__ import annotations

from datetime import datetime
from decimal import Decimal
from typing import Any

from sqlalchemy import ForeignKey, Index, LargeBinary, String
from sqlalchemy.orm import Mapped, mapped_column

from service.store.ids import LENGTH as ID_LENGTH
from service.store.ids import generate_id
from service.store.states import CompletionRule, CountedAttempt, ReleaseRule
from service.store.tables.base import Base


class Course(Base):
    """A course with a unique name."""

    __tablename__ = "course"

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(unique=True)
    created_at: Mapped[datetime]
    # Older releases add courses without these columns.
    counted_attempt: Mapped[CountedAttempt] = mapped_column(
        default=CountedAttempt.LATEST, server_default=CountedAttempt.LATEST.value
    )
    completion_rule: Mapped[CompletionRule] = mapped_column(
        default=CompletionRule.HIGHER, server_default=CompletionRule.HIGHER.value
    )


class AssignmentVersion(Base):
    """A frozen assignment; ``content`` contains everything that a worker on another machine needs."""

    __tablename__ = "assignment_version"

    id: Mapped[int] = mapped_column(primary_key=True)
    assignment: Mapped[str] = mapped_column(index=True)
    sha256: Mapped[str] = mapped_column(String(64), unique=True)  # of the content
    version: Mapped[str]  # the assignment's own version: the hash of its folder
    title: Mapped[str]
    max_marks: Mapped[Decimal]
    content: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)
    created_at: Mapped[datetime]


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


class Policy(Base):
    """Deadline, attempts and release of grades; an empty ``assignment`` is the default for those without a policy."""

    __tablename__ = "policy"
    __table_args__ = (Index(None, "course_id", "assignment", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    course_id: Mapped[int] = mapped_column(ForeignKey("course.id"))
    assignment: Mapped[str] = mapped_column(default="")
    due_at: Mapped[datetime | None]
    late_days: Mapped[int] = mapped_column(default=0)
    attempts: Mapped[int | None]
    cool_down_seconds: Mapped[float] = mapped_column(default=0.0)
    zone: Mapped[str] = mapped_column(String(64), default="", server_default="")  # of late days; empty: the server's
    release: Mapped[ReleaseRule] = mapped_column(
        default=ReleaseRule.OWN_AT_ONCE, server_default=ReleaseRule.OWN_AT_ONCE.value
    )
    released_at: Mapped[datetime | None]  # students see all grades from this moment on


class Extension(Base):
    """An extension of the policy for one student."""

    __tablename__ = "extension"
    __table_args__ = (Index(None, "enrolment_id", "assignment", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    enrolment_id: Mapped[int] = mapped_column(ForeignKey("enrolment.id"))
    assignment: Mapped[str] = mapped_column(default="")  # empty: all
    due_at: Mapped[datetime | None]
    more_attempts: Mapped[int] = mapped_column(default=0)


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
