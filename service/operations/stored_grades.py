"""Stored grades of any course, for commands on the machine: by the beginning of an id, with all names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from service.operations.context import Actor, Service
from service.operations.lookup import check_operator
from service.store.batches import batches, job_lines
from service.store.batches.job_lines import JobLine as JobLine

if TYPE_CHECKING:
    from service.grading.grade import Grade
    from submissions.grading_request import GradingRequest
    from submissions.seeds import Secret
    from submissions.submission import Submission


@dataclass(frozen=True, slots=True)
class StoredGrading:
    """A grade as the grader gave it, with the input for grading it again."""

    job_id: str
    grade: Grade
    request: GradingRequest
    grader_sha256: str | None
    own_secret: Secret  # of the installation


def find(service: Service, actor: Actor, grade: str) -> JobLine:
    """Return the job whose id begins with ``grade``.

    Raises NotFound for non-operators, UsageError for no unique match.
    """
    check_operator(actor)
    with service.store.reading() as session:
        return job_lines.load_job_line(session, batches.find_job(session, grade))


def find_previous(service: Service, actor: Actor, job_id: str) -> JobLine:
    """Return the standing grade of the same student's previous attempt. Raises NotFound, UsageError."""
    check_operator(actor)
    with service.store.reading() as session:
        return job_lines.load_job_line(session, batches.find_previous_job(session, job_id))


def load_summary(service: Service, actor: Actor, job_id: str) -> tuple[Grade, Submission]:
    """Load a grade as it counts, with its submission and recordings without ticks and images. Raises NotFound."""
    from service.store.batches import stored_requests
    from service.store.grades import results

    check_operator(actor)
    with service.store.reading() as session:
        return results.load_grade_texts(session, job_id), stored_requests.load_submission(session, job_id)


def load(service: Service, actor: Actor, job_id: str) -> Grade:
    """Load a grade as it counts, with whole recordings. Raises NotFound, and UsageError without a grade."""
    from service.store.grades import results

    check_operator(actor)
    with service.store.reading() as session:
        return results.load_grade(session, job_id)


def load_grading(service: Service, actor: Actor, grade: str) -> StoredGrading:
    """Load the grading whose id begins with ``grade``. Raises NotFound, and UsageError without a grade."""
    from service.store.batches import stored_requests
    from service.store.grades import results
    from service.store.installation import load_secret
    from service.store.tables.submissions import Job

    check_operator(actor)
    own_secret = load_secret(service.store)
    with service.store.reading() as session:
        job = session.get_one(Job, batches.find_job(session, grade))
        stored_grade, request = (
            results.load_original_grade(session, job.id),
            stored_requests.load_grading_request(session, job.id),
        )
        return StoredGrading(job.id, stored_grade, request, job.grader_sha256, own_secret)
