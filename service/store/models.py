"""The tables: who, what was submitted, the jobs, and what came of them.

Only shapes and constraints; what is done with them stands in the modules beside this one. A class is called as its
table is, and ``...Row`` only where what it keeps has a class of that name itself (``Submission``, ``Trial``,
``CriterionResult``).
"""

from __future__ import annotations

from datetime import datetime
from decimal import Decimal
from enum import StrEnum
from typing import Any

from sqlalchemy import BigInteger, CheckConstraint, Enum, ForeignKey, Index, LargeBinary, MetaData, String, text
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

from service.store.columns import ExactDecimal, SafeJson, SafeText, UtcDateTime
from service.store.ids import LENGTH as ID_LENGTH
from service.store.ids import new_id
from service.store.states import BatchState, CancelReason, CredentialKind, JobState, Lane, PlotState, Role, Standing


def _enum(kind: type[StrEnum]) -> Enum:
    return Enum(
        kind,
        native_enum=False,
        length=16,
        create_constraint=False,
        values_callable=lambda values: [value.value for value in values],
    )


class Base(DeclarativeBase):
    """What all tables share: the names of their constraints, and the column type of each Python type."""

    metadata = MetaData(
        naming_convention={
            "ix": "ix_%(table_name)s_%(column_0_N_name)s",
            "uq": "uq_%(table_name)s_%(column_0_N_name)s",
            "ck": "ck_%(table_name)s_%(constraint_name)s",
            "fk": "fk_%(table_name)s_%(column_0_name)s_%(referred_table_name)s",
            "pk": "pk_%(table_name)s",
        }
    )
    type_annotation_map = {  # noqa: RUF012 - SQLAlchemy reads it as a class attribute
        datetime: UtcDateTime(),
        Decimal: ExactDecimal(),
        str: SafeText(),
        Any: SafeJson(),
        Role: _enum(Role),
        CredentialKind: _enum(CredentialKind),
        Lane: _enum(Lane),
        JobState: _enum(JobState),
        CancelReason: _enum(CancelReason),
        PlotState: _enum(PlotState),
        BatchState: _enum(BatchState),
        Standing: _enum(Standing),
    }


class Installation(Base):
    """One row, made with the tables."""

    __tablename__ = "installation"

    id: Mapped[int] = mapped_column(primary_key=True)
    secret: Mapped[str] = mapped_column(String(64))  # what the seeds of trials depend on; shown nowhere
    made_at: Mapped[datetime]


class SchemaCompatibility(Base):
    """One row, which the migrations write."""

    __tablename__ = "schema_compatibility"

    id: Mapped[int] = mapped_column(primary_key=True)
    oldest_compatible: Mapped[str] = mapped_column(String(32))  # the revision whose code can still use the tables


class Course(Base):
    """A course; no two have the same name."""

    __tablename__ = "course"

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(unique=True)
    created_at: Mapped[datetime]


class Person(Base):
    """Somebody who is in a course; their id, name and address are those that each course has of them."""

    __tablename__ = "person"

    id: Mapped[int] = mapped_column(primary_key=True)
    operator: Mapped[bool] = mapped_column(default=False)  # runs the whole installation
    created_at: Mapped[datetime]
    signed_in_at: Mapped[datetime | None]  # first, or had a token; since then no platform may take their place


class Enrolment(Base):
    """A student is a course and an id in it: from the roster, else the name of the folder or file."""

    __tablename__ = "enrolment"
    __table_args__ = (Index(None, "course_id", "student", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    course_id: Mapped[int] = mapped_column(ForeignKey("course.id"))
    person_id: Mapped[int] = mapped_column(ForeignKey("person.id"))
    student: Mapped[str]  # the id, in its normal form
    written: Mapped[str]  # the id as it was first written
    role: Mapped[Role]
    name: Mapped[str] = mapped_column(default="", server_default="")
    email: Mapped[str] = mapped_column(default="", server_default="")


class AssignmentVersion(Base):
    """An assignment, frozen: ``content`` is all a worker on another machine needs."""

    __tablename__ = "assignment_version"

    id: Mapped[int] = mapped_column(primary_key=True)
    assignment: Mapped[str] = mapped_column(index=True)
    sha256: Mapped[str] = mapped_column(String(64), unique=True)  # of the content
    version: Mapped[str]  # what the assignment calls itself: the hash of its folder
    title: Mapped[str]
    max_marks: Mapped[Decimal]
    content: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)
    created_at: Mapped[datetime]


class Batch(Base):
    """Submissions of one course that were taken in together, or the regrade of such."""

    __tablename__ = "batch"

    id: Mapped[str] = mapped_column(String(ID_LENGTH), primary_key=True, default=new_id)
    course_id: Mapped[int] = mapped_column(ForeignKey("course.id"))
    name: Mapped[str]
    state: Mapped[BatchState] = mapped_column(default=BatchState.OPEN)
    refusals: Mapped[Any] = mapped_column(default=list)  # what was not taken in: a ``Refusal`` each
    regrade_of: Mapped[str | None] = mapped_column(ForeignKey("batch.id"))  # whose submissions these are
    created_at: Mapped[datetime]


class SubmissionRow(Base):
    """What a student submitted; ``attempt`` counts within the student and the assignment."""

    __tablename__ = "submission"
    __table_args__ = (
        Index(None, "enrolment_id", "assignment", "attempt", unique=True),
        CheckConstraint("attempt > 0", name="attempt"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    enrolment_id: Mapped[int] = mapped_column(ForeignKey("enrolment.id"))
    assignment: Mapped[str]
    batch_id: Mapped[str | None] = mapped_column(ForeignKey("batch.id"), index=True)
    attempt: Mapped[int]
    sha256: Mapped[str] = mapped_column(String(64), index=True)  # of what was submitted
    source: Mapped[str]  # the name it came under
    size: Mapped[int]
    packed: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)
    created_at: Mapped[datetime]
    submitted_at: Mapped[datetime | None]  # by the student; None where nobody said
    days_late: Mapped[int] = mapped_column(default=0)
    staff_only: Mapped[str | None]  # the limit that this submission is over: it is marked, and shown to staff alone
    exceeded: Mapped[Any | None]  # the same limit as data: {"limit": "attempts", "actual": 3, "allowed": 2}


_STANDS = text("standing = 'stands'")


class Job(Base):
    """One grading of one submission. The row is the job; the broker only notices."""

    __tablename__ = "job"
    __table_args__ = (
        Index(None, "state", "lane", "due_at"),
        Index(None, "state", "lease_until"),
        Index(None, "started_at"),
        Index(None, "plots", "plots_due_at"),
        Index(None, "worker", "finished_at"),
        # All that the counts of a batch are made of, so that they read no job.
        Index(None, "batch_id", "state", "plots", "suspect"),
        Index("uq_job_standing", "submission_id", unique=True, sqlite_where=_STANDS, postgresql_where=_STANDS),
        CheckConstraint("(state = 'running') = (lease IS NOT NULL)", name="lease"),
    )

    id: Mapped[str] = mapped_column(String(ID_LENGTH), primary_key=True, default=new_id)
    submission_id: Mapped[int] = mapped_column(ForeignKey("submission.id"), index=True)
    assignment_version_id: Mapped[int] = mapped_column(ForeignKey("assignment_version.id"), index=True)
    # The two shares that a claim weighs, beside the job so that a claim reads one table.
    enrolment_id: Mapped[int] = mapped_column(ForeignKey("enrolment.id"), index=True)
    batch_id: Mapped[str | None] = mapped_column(ForeignKey("batch.id"))
    lane: Mapped[Lane]
    state: Mapped[JobState] = mapped_column(default=JobState.QUEUED)

    attempt: Mapped[int] = mapped_column(default=0)  # times begun; not the student's attempts
    max_attempts: Mapped[int]
    due_at: Mapped[datetime]  # not before this: later than ``queued_at`` after a fault of ours
    lease: Mapped[str | None] = mapped_column(String(32))
    lease_until: Mapped[datetime | None]
    heartbeat_at: Mapped[datetime | None]
    worker: Mapped[str | None]  # who holds it or held it last
    process: Mapped[int | None]  # which of that worker's
    progress: Mapped[float] = mapped_column(default=0.0)  # 0 to 1
    error: Mapped[str | None]  # a sentence, of the last fault of ours or the reason of death
    cancelled_for: Mapped[CancelReason | None]
    superseded_by: Mapped[str | None] = mapped_column(String(ID_LENGTH))  # a newer submission's job, where known

    queued_at: Mapped[datetime]
    notified_at: Mapped[datetime | None]
    started_at: Mapped[datetime | None]
    graded_at: Mapped[datetime | None]  # grading ended, results not yet stored
    finished_at: Mapped[datetime | None]  # results stored, or given up

    verdict: Mapped[str | None] = mapped_column(String(32))
    marks: Mapped[Decimal | None]
    max_marks: Mapped[Decimal | None]
    grader_version: Mapped[str | None]
    sandbox: Mapped[str | None]
    notes: Mapped[Any] = mapped_column(default=list)
    hints: Mapped[Any] = mapped_column(default=list)  # sentences on what probably cost marks
    missing: Mapped[str] = mapped_column(default="")  # the part that was asked for and not submitted
    cost: Mapped[Any | None]  # {"limits": {"cpu_seconds": 240.0, ...}, "spent": {"cpu_seconds": 3.2, ...}}

    #: Moments of one grading, ISO 8601 UTC, by the names of ``phases``.
    phases: Mapped[Any] = mapped_column(default=dict)
    grader_sha256: Mapped[str | None] = mapped_column(String(64))  # of all that decides over marks
    secret_sha256: Mapped[str | None] = mapped_column(String(64))  # of what its seeds depend on; None: of nothing
    cache_key: Mapped[str | None] = mapped_column(String(64), index=True)  # alike only where grades must be
    forced: Mapped[bool] = mapped_column(default=False)  # to be run even where an identical grade is there
    copied_from: Mapped[str | None] = mapped_column(ForeignKey("job.id"), index=True)  # the grade that was run
    regrade_of: Mapped[str | None] = mapped_column(ForeignKey("job.id"), index=True)  # the grade that stood before
    standing: Mapped[Standing] = mapped_column(default=Standing.STANDS)
    suspect: Mapped[str | None]  # why its grade is not to be trusted
    published_at: Mapped[datetime | None]
    published_by: Mapped[str | None]

    plots: Mapped[PlotState] = mapped_column(default=PlotState.NONE)
    plots_due_at: Mapped[datetime | None]
    plots_attempt: Mapped[int] = mapped_column(default=0)
    plotted_at: Mapped[datetime | None]


class TrialRow(Base):
    """One run; its recording is the job's artifact ``recording-<position>``."""

    __tablename__ = "trial"
    __table_args__ = (Index(None, "job_id", "position", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    job_id: Mapped[str] = mapped_column(ForeignKey("job.id", ondelete="CASCADE"))
    position: Mapped[int]
    scenario: Mapped[str]
    scenario_index: Mapped[int]
    seed: Mapped[int] = mapped_column(BigInteger)
    light_noise: Mapped[float]
    motor_noise: Mapped[float]
    visibility: Mapped[str] = mapped_column(String(32))
    verdict: Mapped[str] = mapped_column(String(32))
    sha256: Mapped[str] = mapped_column(String(64))
    end_t: Mapped[float]
    place: Mapped[int] = mapped_column(default=0)  # which of the scenario's poses
    sweep: Mapped[Any] = mapped_column(default=list)  # [["light_noise", 32.0]]: what is swept, and its level here
    surprise: Mapped[str | None]  # what our own code stumbled over, if it did


class CriterionResultRow(Base):
    """One marked line. Accuracy is data of its own, so that a course can be asked about it."""

    __tablename__ = "criterion_result"
    __table_args__ = (Index(None, "job_id", "position", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    job_id: Mapped[str] = mapped_column(ForeignKey("job.id", ondelete="CASCADE"))
    position: Mapped[int]
    criterion: Mapped[str]
    title: Mapped[str]
    marks: Mapped[Decimal]
    max_marks: Mapped[Decimal]
    message: Mapped[str]
    visibility: Mapped[str] = mapped_column(String(32))
    evidence: Mapped[Any]
    accuracy: Mapped[float | None]
    accuracy_low: Mapped[float | None]
    accuracy_high: Mapped[float | None]
    accuracy_n: Mapped[int | None]
    labels: Mapped[Any | None]  # ["square", ...]
    confusion: Mapped[Any | None]  # [[truth, answer or null, count], ...]
    counts: Mapped[Any | None]  # {"sent": 6, "answered": 5, "late": 0, "malformed": 0, "unanswered": 1, ...}
    confidence: Mapped[Any | None]  # {"right": 0.93, "n_right": 5, "wrong": null, "n_wrong": 0}
    curves: Mapped[Any] = mapped_column(default=list)  # [{"along": "light_noise", "levels": [...]}, ...]
    unjudged: Mapped[str | None]  # why it could not be judged; staff have to look
    predictions: Mapped[Any]
    shown: Mapped[Any | None]  # {"message": ..., "accuracy": ..., "curves": ...} as of the visible trials alone
    for_staff: Mapped[str] = mapped_column(default="")  # where somebody should look, which no student is told


class Artifact(Base):
    """A named file of a job: a recording, a plot. Small ones only; ``artifacts`` caps them."""

    __tablename__ = "artifact"
    __table_args__ = (Index(None, "job_id", "name", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    job_id: Mapped[str] = mapped_column(ForeignKey("job.id", ondelete="CASCADE"))
    name: Mapped[str]
    media_type: Mapped[str]
    sha256: Mapped[str] = mapped_column(String(64))  # of the content before compression
    size: Mapped[int]  # bytes before compression
    compressed: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)  # zlib
    created_at: Mapped[datetime]


class Policy(Base):
    """When and how often a course's students may submit; an empty ``assignment`` is for all that have none."""

    __tablename__ = "policy"
    __table_args__ = (Index(None, "course_id", "assignment", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    course_id: Mapped[int] = mapped_column(ForeignKey("course.id"))
    assignment: Mapped[str] = mapped_column(default="")
    due_at: Mapped[datetime | None]
    late_days: Mapped[int] = mapped_column(default=0)
    attempts: Mapped[int | None]
    cool_down_seconds: Mapped[float] = mapped_column(default=0.0)
    zone: Mapped[str] = mapped_column(String(64), default="")  # late days are days of it; empty: of the server's zone


class Extension(Base):
    """What one student is allowed beyond the policy."""

    __tablename__ = "extension"
    __table_args__ = (Index(None, "enrolment_id", "assignment", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    enrolment_id: Mapped[int] = mapped_column(ForeignKey("enrolment.id"))
    assignment: Mapped[str] = mapped_column(default="")  # empty: all
    due_at: Mapped[datetime | None]
    more_attempts: Mapped[int] = mapped_column(default=0)


class Worker(Base):
    """A worker that has graded a known answer. One that got it wrong is in quarantine and claims nothing."""

    __tablename__ = "worker"

    name: Mapped[str] = mapped_column(primary_key=True)
    grader_version: Mapped[str]
    grader_sha256: Mapped[str] = mapped_column(String(64))
    first_at: Mapped[datetime]
    self_tested_at: Mapped[datetime]  # of the last known answer, right or wrong
    quarantined_at: Mapped[datetime | None]
    reason: Mapped[str | None]


class SelfTest(Base):
    """When a process of a worker last graded the known answer rightly; what it graded since is not vouched for."""

    __tablename__ = "self_test"
    __table_args__ = (Index(None, "worker", "process", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    worker: Mapped[str]
    process: Mapped[int]
    right_at: Mapped[datetime]


class Heartbeat(Base):
    """A worker that lives, or lived until lately: it says so every few seconds, and takes its row away at its end."""

    __tablename__ = "heartbeat"

    worker: Mapped[str] = mapped_column(primary_key=True)
    host: Mapped[str]
    concurrency: Mapped[int]  # gradings at a time
    grader_version: Mapped[str]
    sandbox: Mapped[str]  # what stands round student code there
    problem: Mapped[str | None]  # why it must be restarted
    started_at: Mapped[datetime]
    seen_at: Mapped[datetime] = mapped_column(index=True)


class Audit(Base):
    """Who did what to which row; never deleted, and changed only where the name of who is erased stands in it."""

    __tablename__ = "audit"
    __table_args__ = (Index(None, "subject", "subject_id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    at: Mapped[datetime] = mapped_column(index=True)
    actor: Mapped[str]
    action: Mapped[str]
    subject: Mapped[str] = mapped_column(String(32))  # a table's name
    subject_id: Mapped[str]
    detail: Mapped[Any] = mapped_column(default=dict)
