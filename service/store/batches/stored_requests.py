"""Reading back of stored submissions and assignment versions, for grading and for reports.

``intake.py`` stores them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from typing import TYPE_CHECKING, TypeVar

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.store.courses.assignment_versions import assignment_from_bytes
from service.store.states import Role
from service.store.tables.courses import AssignmentVersion
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Job, SubmissionRow
from sim.errors import HostError, UsageError
from submissions.assignment.folder import REFERENCE
from submissions.grading_request import GradingRequest
from submissions.stored_submission import unpack_submission
from submissions.submission import Submission

if TYPE_CHECKING:
    from submissions.assignment.definition import Assignment

Read = TypeVar("Read")
#: Number of submissions fetched at once.
_CHUNK_SIZE = 10


def load_grading_request(session: Session, job_id: str) -> GradingRequest:
    """Rebuild the grading request of a job from the database.

    Raises UsageError for an unknown job, HostError if the stored data cannot be read.
    """
    source = select(SubmissionRow.source).join(Job, Job.submission_id == SubmissionRow.id)
    return GradingRequest(
        load_submission(session, job_id),
        load_assignment(session, job_id),
        session.scalars(source.where(Job.id == job_id)).one(),
    )


def load_submission(session: Session, job_id: str) -> Submission:
    """Return the submission of a job; raises like ``load_grading_request``."""
    query = select(SubmissionRow.packed).join(Job, Job.submission_id == SubmissionRow.id)
    return _unpack_stored(unpack_submission, session.scalar(query.where(Job.id == job_id)), "submission", job_id)


def load_each_submission(session: Session, job_ids: Collection[str]) -> Iterator[tuple[str, Submission]]:
    """Yield each job id with its submission, read in one statement and ordered by id.

    Only one submission is in memory at a time. Raises HostError if the stored data cannot be read.
    """
    query = select(Job.id, SubmissionRow.packed).join(SubmissionRow, Job.submission_id == SubmissionRow.id)
    query = query.where(Job.id.in_(job_ids)).order_by(Job.id)
    for job_id, packed_submission in session.execute(query, execution_options={"yield_per": _CHUNK_SIZE}):
        yield job_id, _unpack_stored(unpack_submission, packed_submission, "submission", job_id)


def load_assignment(session: Session, job_id: str) -> Assignment:
    """Return the assignment version of a job; raises like ``load_grading_request``."""
    query = select(AssignmentVersion.content).join(Job, Job.assignment_version_id == AssignmentVersion.id)
    return _unpack_stored(assignment_from_bytes, session.scalar(query.where(Job.id == job_id)), "assignment", job_id)


def load_reference(session: Session, job_id: str) -> Submission | None:
    """Return the newest reference solution that staff submitted for the assignment version of a job; None without."""
    version = select(Job.assignment_version_id).where(Job.id == job_id).scalar_subquery()
    query = (
        select(SubmissionRow.packed)
        .join(Job, Job.submission_id == SubmissionRow.id)
        .join(Enrolment, SubmissionRow.enrolment_id == Enrolment.id)
        .where(
            Job.assignment_version_id == version,
            SubmissionRow.source == REFERENCE,
            Enrolment.role == Role.INSTRUCTOR,
        )
    )
    packed = session.scalar(query.order_by(SubmissionRow.id.desc()).limit(1))
    return None if packed is None else _unpack_stored(unpack_submission, packed, "reference solution", job_id)


def _unpack_stored(decode_content: Callable[[bytes], Read], content: bytes | None, subject: str, job_id: str) -> Read:
    if content is None:
        raise UsageError(f"there is no job {job_id}")
    try:
        return decode_content(content)
    except (UsageError, ValueError, TypeError, KeyError) as error:
        raise HostError(f"The {subject} of {job_id} cannot be read back: {error}") from error
