"""The tables: people, submissions, jobs and results.

Contains only columns and constraints; the modules beside this one contain the operations. A class has the name of its
table. The suffix ``...Row`` is added if a class with that name exists (``Submission``, ``Trial``, ``CriterionResult``).
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
from service.store.ids import generate_id
from service.store.states import BatchState, CancelReason, CredentialKind, JobQueue, JobState, PlotState, Role, Standing


def _build_enum_type(kind: type[StrEnum]) -> Enum:
    return Enum(
        kind,
        native_enum=False,
        length=16,
        create_constraint=False,
        values_callable=lambda values: [value.value for value in values],
    )


class Base(DeclarativeBase):
    """Base of all tables: the names of constraints, and the column type of each Python type."""

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
        Role: _build_enum_type(Role),
        CredentialKind: _build_enum_type(CredentialKind),
        JobQueue: _build_enum_type(JobQueue),
        JobState: _build_enum_type(JobState),
        CancelReason: _build_enum_type(CancelReason),
        PlotState: _build_enum_type(PlotState),
        BatchState: _build_enum_type(BatchState),
        Standing: _build_enum_type(Standing),
    }


class Installation(Base):
    """The installation: one row, created with the tables."""

    __tablename__ = "installation"

    id: Mapped[int] = mapped_column(primary_key=True)
    secret: Mapped[str] = mapped_column(String(64))  # determines the seeds of trials; never shown
    made_at: Mapped[datetime]


class SchemaCompatibility(Base):
    """Schema compatibility: one row, written by the migrations."""

    __tablename__ = "schema_compatibility"

    id: Mapped[int] = mapped_column(primary_key=True)
    oldest_compatible: Mapped[str] = mapped_column(String(32))  # oldest revision whose code can use the tables


class Course(Base):
    """A course with a unique name."""

    __tablename__ = "course"

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(unique=True)
    created_at: Mapped[datetime]


class Person(Base):
    """A person in one or more courses; each enrolment has the id, name and address used in that course."""

    __tablename__ = "person"

    id: Mapped[int] = mapped_column(primary_key=True)
    operator: Mapped[bool] = mapped_column(default=False)  # administers the whole installation
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
    written: Mapped[str]  # the id as it was first written
    role: Mapped[Role]
    name: Mapped[str] = mapped_column(default="", server_default="")
    email: Mapped[str] = mapped_column(default="", server_default="")


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


class Batch(Base):
    """Submissions of one course that were accepted together, or a regrade of them."""

    __tablename__ = "batch"

    id: Mapped[str] = mapped_column(String(ID_LENGTH), primary_key=True, default=generate_id)
    course_id: Mapped[int] = mapped_column(ForeignKey("course.id"))
    name: Mapped[str]
    state: Mapped[BatchState] = mapped_column(default=BatchState.OPEN)
    refusals: Mapped[Any] = mapped_column(default=list)  # one ``RejectedSubmission`` for each rejected file
    regrade_of: Mapped[str | None] = mapped_column(ForeignKey("batch.id"))  # the batch that was graded again
    created_at: Mapped[datetime]


class SubmissionRow(Base):
    """A submission of a student; ``attempt`` counts per student and assignment."""

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
    sha256: Mapped[str] = mapped_column(String(64), index=True)  # of the submission
    source: Mapped[str]  # the name of its file or folder
    size: Mapped[int]
    packed: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)
    created_at: Mapped[datetime]
    submitted_at: Mapped[datetime | None]  # by the student; None if unknown
    days_late: Mapped[int] = mapped_column(default=0)
    staff_only: Mapped[str | None]  # the limit that it exceeds: the submission is marked, but only staff see it
    exceeded: Mapped[Any | None]  # the same limit as data: {"limit": "attempts", "actual": 3, "allowed": 2}


_STANDS = text("standing = 'stands'")


class Job(Base):
    """One grading of one submission. The row is the job; the broker only notifies."""

    __tablename__ = "job"
    __table_args__ = (
        Index(None, "state", "lane", "due_at"),
        Index(None, "state", "lease_until"),
        Index(None, "started_at"),
        Index(None, "plots", "plots_due_at"),
        Index(None, "worker", "finished_at"),
        # All columns counted for a batch, so that counting reads no job row.
        Index(None, "batch_id", "state", "plots", "suspect"),
        Index("uq_job_standing", "submission_id", unique=True, sqlite_where=_STANDS, postgresql_where=_STANDS),
        CheckConstraint("(state = 'running') = (lease IS NOT NULL)", name="lease"),
    )

    id: Mapped[str] = mapped_column(String(ID_LENGTH), primary_key=True, default=generate_id)
    submission_id: Mapped[int] = mapped_column(ForeignKey("submission.id"), index=True)
    assignment_version_id: Mapped[int] = mapped_column(ForeignKey("assignment_version.id"), index=True)
    # The shares that a claim weighs, stored in the job so that a claim reads one table.
    enrolment_id: Mapped[int] = mapped_column(ForeignKey("enrolment.id"), index=True)
    batch_id: Mapped[str | None] = mapped_column(ForeignKey("batch.id"))
    lane: Mapped[JobQueue]
    state: Mapped[JobState] = mapped_column(default=JobState.QUEUED)

    attempt: Mapped[int] = mapped_column(default=0)  # times started; not the student's attempts
    max_attempts: Mapped[int]
    due_at: Mapped[datetime]  # earliest start: after ``queued_at`` following a host fault
    lease: Mapped[str | None] = mapped_column(String(32))
    lease_until: Mapped[datetime | None]
    heartbeat_at: Mapped[datetime | None]
    worker: Mapped[str | None]  # the current or last owner
    process: Mapped[int | None]  # the process of that worker
    progress: Mapped[float] = mapped_column(default=0.0)  # 0 to 1
    error: Mapped[str | None]  # a sentence: the last host fault, or the reason of the final failure
    cancelled_for: Mapped[CancelReason | None]
    superseded_by: Mapped[str | None] = mapped_column(String(ID_LENGTH))  # a newer submission's job, if known

    queued_at: Mapped[datetime]
    notified_at: Mapped[datetime | None]
    started_at: Mapped[datetime | None]
    graded_at: Mapped[datetime | None]  # grading ended, results not yet stored
    finished_at: Mapped[datetime | None]  # results stored, or job failed

    verdict: Mapped[str | None] = mapped_column(String(32))
    marks: Mapped[Decimal | None]
    max_marks: Mapped[Decimal | None]
    grader_version: Mapped[str | None]
    sandbox: Mapped[str | None]
    notes: Mapped[Any] = mapped_column(default=list)
    hints: Mapped[Any] = mapped_column(default=list)  # sentences on the probable causes of lost marks
    missing: Mapped[str] = mapped_column(default="")  # the required part that was not submitted
    cost: Mapped[Any | None]  # {"limits": {"cpu_seconds": 240.0, ...}, "spent": {"cpu_seconds": 3.2, ...}}

    #: Times of one grading, ISO 8601 UTC, by the names in ``phases``.
    phases: Mapped[Any] = mapped_column(default=dict)
    grader_sha256: Mapped[str | None] = mapped_column(String(64))  # of all code that affects marks
    secret_sha256: Mapped[str | None] = mapped_column(String(64))  # of the secret that its seeds use; None: no secret
    cache_key: Mapped[str | None] = mapped_column(String(64), index=True)  # equal only if the grades must be equal
    forced: Mapped[bool] = mapped_column(default=False)  # run it even if an identical grade exists
    copied_from: Mapped[str | None] = mapped_column(ForeignKey("job.id"), index=True)  # the original grade
    regrade_of: Mapped[str | None] = mapped_column(ForeignKey("job.id"), index=True)  # the previous standing grade
    standing: Mapped[Standing] = mapped_column(default=Standing.STANDS)
    suspect: Mapped[str | None]  # why its grade is not trusted
    published_at: Mapped[datetime | None]
    published_by: Mapped[str | None]

    plots: Mapped[PlotState] = mapped_column(default=PlotState.NONE)
    plots_due_at: Mapped[datetime | None]
    plots_attempt: Mapped[int] = mapped_column(default=0)
    plotted_at: Mapped[datetime | None]


class TrialRow(Base):
    """One trial; its recording is the job's artifact ``recording-<position>``."""

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
    place: Mapped[int] = mapped_column(default=0)  # index of the pose in the scenario
    sweep: Mapped[Any] = mapped_column(default=list)  # [["light_noise", 32.0]]: swept values and their levels here
    surprise: Mapped[str | None]  # an error in Robomark's own code, if one occurred


class CriterionResultRow(Base):
    """The result of one criterion. Accuracy has its own columns for queries over a course."""

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
    unjudged: Mapped[str | None]  # why it could not be judged; needs review by staff
    predictions: Mapped[Any]
    shown: Mapped[Any | None]  # {"message": ..., "accuracy": ..., "curves": ...} of the visible trials only
    for_staff: Mapped[str] = mapped_column(default="")  # hint for a review by staff; never shown to students


class Artifact(Base):
    """A named file of a job, such as a recording or a plot. Small files only; ``artifacts`` limits the size."""

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
    """Deadline and attempts of a course; an empty ``assignment`` is the default for those without a policy."""

    __tablename__ = "policy"
    __table_args__ = (Index(None, "course_id", "assignment", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    course_id: Mapped[int] = mapped_column(ForeignKey("course.id"))
    assignment: Mapped[str] = mapped_column(default="")
    due_at: Mapped[datetime | None]
    late_days: Mapped[int] = mapped_column(default=0)
    attempts: Mapped[int | None]
    cool_down_seconds: Mapped[float] = mapped_column(default=0.0)
    zone: Mapped[str] = mapped_column(String(64), default="")  # zone of late days; empty: the server's


class Extension(Base):
    """An extension of the policy for one student."""

    __tablename__ = "extension"
    __table_args__ = (Index(None, "enrolment_id", "assignment", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    enrolment_id: Mapped[int] = mapped_column(ForeignKey("enrolment.id"))
    assignment: Mapped[str] = mapped_column(default="")  # empty: all
    due_at: Mapped[datetime | None]
    more_attempts: Mapped[int] = mapped_column(default=0)


class Worker(Base):
    """A worker that has run a self-test. After a failed one it is in quarantine and claims no jobs."""

    __tablename__ = "worker"

    name: Mapped[str] = mapped_column(primary_key=True)
    grader_version: Mapped[str]
    grader_sha256: Mapped[str] = mapped_column(String(64))
    first_at: Mapped[datetime]
    self_tested_at: Mapped[datetime]  # time of the last self-test, passed or failed
    quarantined_at: Mapped[datetime | None]
    reason: Mapped[str | None]


class SelfTest(Base):
    """The last passed self-test of a worker process; its later grades are not confirmed yet."""

    __tablename__ = "self_test"
    __table_args__ = (Index(None, "worker", "process", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    worker: Mapped[str]
    process: Mapped[int]
    right_at: Mapped[datetime]


class Heartbeat(Base):
    """A live worker, or one that was alive recently.

    It updates its row every few seconds and deletes it when it exits.
    """

    __tablename__ = "heartbeat"

    worker: Mapped[str] = mapped_column(primary_key=True)
    host: Mapped[str]
    concurrency: Mapped[int]  # gradings at a time
    grader_version: Mapped[str]
    sandbox: Mapped[str]  # sandbox layers on that machine
    problem: Mapped[str | None]  # why it must be restarted
    started_at: Mapped[datetime]
    seen_at: Mapped[datetime] = mapped_column(index=True)


class Audit(Base):
    """Activity log; never deleted, and changed only to erase the name of a person."""

    __tablename__ = "audit"
    __table_args__ = (Index(None, "subject", "subject_id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    at: Mapped[datetime] = mapped_column(index=True)
    actor: Mapped[str]
    action: Mapped[str]
    subject: Mapped[str] = mapped_column(String(32))  # name of a table
    subject_id: Mapped[str]
    detail: Mapped[Any] = mapped_column(default=dict)
