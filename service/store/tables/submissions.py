"""Tables of submissions: batches, submissions, jobs and test runs.

The results of jobs are in ``grades.py``.
"""

from __future__ import annotations

from datetime import datetime
from decimal import Decimal
from typing import Any

from sqlalchemy import CheckConstraint, ForeignKey, Index, LargeBinary, String, false, text
from sqlalchemy.orm import Mapped, mapped_column

from service.store.ids import LENGTH as ID_LENGTH
from service.store.ids import generate_id
from service.store.states import BatchState, CancelReason, JobQueue, JobState, PlotState, Standing
from service.store.tables.base import Base


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
    days_late: Mapped[int] = mapped_column(default=0, server_default="0")
    staff_only: Mapped[str | None]  # the limit that it exceeds: the submission is marked, but only staff see it
    exceeded: Mapped[Any | None]  # the same limit as data: {"limit": "attempts", "actual": 3, "allowed": 2}


_STANDS = text("standing = 'stands'")
_IS_QUEUED = text("state = 'queued'")


class Job(Base):
    """One grading of one submission. The row is the job; the broker only notifies."""

    __tablename__ = "job"
    __table_args__ = (
        Index(None, "state", "lane", "due_at"),
        Index(None, "state", "lease_until"),
        # The columns that a claim counts and compares, so that it reads only the row of the claimed job.
        Index(None, "started_at", "lane", "batch_id", "enrolment_id"),
        Index(
            "ix_job_waiting",
            "state",
            "lane",
            "batch_id",
            "queued_at",
            "id",
            "enrolment_id",
            "due_at",
            sqlite_where=_IS_QUEUED,
            postgresql_where=_IS_QUEUED,
        ),
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
    hints: Mapped[Any] = mapped_column(default=list, server_default="[]")  # on the probable causes of lost marks
    #: [["template", {"name": value}], ...]: those texts of the grade that can be translated.
    sentences: Mapped[Any] = mapped_column(default=list, server_default="[]", deferred=True)
    missing: Mapped[str] = mapped_column(default="", server_default="")  # the required part that was not submitted
    #: Run all trials of pools, not only the first.
    whole_pools: Mapped[bool] = mapped_column(default=False, server_default=false())
    #: Its marks depend on a pool that was not run completely.
    provisional: Mapped[bool] = mapped_column(default=False, server_default=false())
    cost: Mapped[Any | None]  # {"limits": {"cpu_seconds": 240.0, ...}, "spent": {"cpu_seconds": 3.2, ...}}

    #: Times of one grading, ISO 8601 UTC, by the names in ``phases``.
    phases: Mapped[Any] = mapped_column(default=dict, server_default="{}")
    grader_sha256: Mapped[str | None] = mapped_column(String(64))  # of all code that affects marks
    secret_sha256: Mapped[str | None] = mapped_column(String(64))  # of the secret that its seeds use; None: no secret
    cache_key: Mapped[str | None] = mapped_column(String(64), index=True)  # equal only if the grades must be equal
    forced: Mapped[bool] = mapped_column(default=False, server_default=false())  # run even if an identical grade exists
    copied_from: Mapped[str | None] = mapped_column(ForeignKey("job.id"), index=True)  # the original grade
    regrade_of: Mapped[str | None] = mapped_column(ForeignKey("job.id"), index=True)  # the previous standing grade
    standing: Mapped[Standing] = mapped_column(default=Standing.STANDS, server_default=Standing.STANDS.value)
    suspect: Mapped[str | None]  # why its grade is not trusted
    published_at: Mapped[datetime | None]
    published_by: Mapped[str | None]

    plots: Mapped[PlotState] = mapped_column(default=PlotState.NONE)
    plots_due_at: Mapped[datetime | None]
    plots_attempt: Mapped[int] = mapped_column(default=0)
    plotted_at: Mapped[datetime | None]


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
