"""Recognition of submissions that are already stored, so that submitting a batch twice changes nothing.

``intake.py`` accepts the others.
"""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import or_, select
from sqlalchemy.orm import Session

from service.store.states import BatchState, JobState, Standing
from service.store.tables.courses import AssignmentVersion
from service.store.tables.submissions import Batch, Job, SubmissionRow
from service.version import hash_grader
from submissions.grading_request import GradingRequest


@dataclass(frozen=True, slots=True)
class KnownSubmission:
    """A submission that is identical to the student's newest one for the same assignment, so it changes nothing."""

    job_id: str
    batch_id: str | None
    student: str
    assignment: str
    state: JobState
    other_grader: bool = False  # graded by a different version of the grader


def find_known_submission(
    session: Session, grading_request: GradingRequest, enrolment_id: int, assignment_sha256: str
) -> KnownSubmission | None:
    """Return the job of the student's newest submission if it is identical; None for a new submission."""
    newest_row = session.scalar(
        select(SubmissionRow)
        .where(
            SubmissionRow.enrolment_id == enrolment_id,
            SubmissionRow.assignment == grading_request.assignment.id,
        )
        .order_by(SubmissionRow.attempt.desc())
        .limit(1)
    )
    if newest_row is None or newest_row.sha256 != grading_request.submission.sha256:
        return None
    query = (
        select(Job)
        .join(AssignmentVersion, Job.assignment_version_id == AssignmentVersion.id)
        .outerjoin(Batch, Job.batch_id == Batch.id)
        .where(
            Job.submission_id == newest_row.id,
            AssignmentVersion.sha256 == assignment_sha256,
            Job.state != JobState.CANCELLED,
            # A dead job of a cancelled batch cannot be retried, so its submission is accepted again.
            or_(Job.state != JobState.DEAD, Job.batch_id.is_(None), Batch.state != BatchState.CANCELLED),
        )
        # An unpublished regrade sorts after the standing grade.
        .order_by(Job.standing == Standing.KEPT, Job.standing == Standing.PROPOSED, Job.queued_at.desc(), Job.id)
        .limit(1)
    )
    job = session.scalar(query)
    if job is None:
        return None
    other_grader = job.state is JobState.DONE and job.grader_sha256 not in (None, hash_grader())
    student, assignment = grading_request.submission.student, newest_row.assignment
    return KnownSubmission(job.id, job.batch_id, student, assignment, job.state, other_grader)
