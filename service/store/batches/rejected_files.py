"""Files of one student that were rejected in batches. Without the reasons, which can name other students."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.store.tables.people import Enrolment
from service.store.tables.submissions import Batch
from submissions.student_names import normalise_name


@dataclass(frozen=True, slots=True)
class RejectedFile:
    """A rejected file or folder; an empty ``assignment`` if it was not known."""

    source: str
    assignment: str
    created_at: datetime  # of the batch


def load_rejected_files(session: Session, enrolment: Enrolment) -> list[RejectedFile]:
    """Return the student's rejected files in all batches of the course, oldest first."""
    query = (
        select(Batch.refusals, Batch.created_at)
        .where(Batch.course_id == enrolment.course_id)
        .order_by(Batch.created_at, Batch.id)
    )
    return [
        RejectedFile(each["source"], each["assignment"], created_at)
        for refusals, created_at in session.execute(query)
        for each in refusals
        if normalise_name(each["student"]["id"]) == enrolment.student
    ]
