"""Tables of grades: results and files of a job, and what staff and students add to a submission.

The marks are in the row of the job, too (``submissions.py``).
"""

from __future__ import annotations

from datetime import datetime
from decimal import Decimal
from typing import Any

from sqlalchemy import BigInteger, CheckConstraint, ForeignKey, Index, LargeBinary, String
from sqlalchemy.orm import Mapped, mapped_column

from service.store.tables.base import Base


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
    place: Mapped[int] = mapped_column(default=0, server_default="0")  # index of the pose in the scenario
    sweep: Mapped[Any] = mapped_column(default=list, server_default="[]")  # [["light_noise", 32.0]]: swept levels here
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
    curves: Mapped[Any] = mapped_column(default=list, server_default="[]")  # [{"along": ..., "levels": [...]}, ...]
    unjudged: Mapped[str | None]  # why it could not be judged; needs review by staff
    predictions: Mapped[Any]
    shown: Mapped[Any | None]  # {"message": ..., "accuracy": ..., "curves": ...} of the visible trials only
    for_staff: Mapped[str] = mapped_column(default="", server_default="")  # for a review by staff; not for students
    pool: Mapped[Any | None]  # {"size": 200, "drawn": 24, "least": 0.62, "most": 0.9, "is_decided": true}


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
