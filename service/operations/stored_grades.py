"""Stored grades of any course as commands on the machine load them: by the beginning of an id, with all names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from service.operations.context import Actor, Service
from service.operations.lookup import check_operator
from service.store.batches import batches
from service.store.batches.batches import JobLine as JobLine

if TYPE_CHECKING:
    from service.grading.grade import Grade
    from submissions.grading_request import GradingRequest
    from submissions.seeds import Secret
    from submissions.submission import Submission


@dataclass(frozen=True, slots=True)
class Grading:
    """A grade as the grader gave it, and what to grade it again with."""

    job_id: str
    grade: Grade
    request: GradingRequest
    grader_sha256: str | None
    secret_sha256: str | None  # None where it was graded before the installation had a secret
    own_secret: Secret  # of the installation


def find(service: Service, actor: Actor, grade: str) -> JobLine:
    """The job whose id begins so. Raises NotFound for anybody but operators, UsageError where none or several do."""
    check_operator(actor)
    with service.store.reading() as session:
        return batches.job_line(session, batches.find_job(session, grade))


def find_previous(service: Service, actor: Actor, job_id: str) -> JobLine:
    """The grade that stands for the same student's attempt before this one. Raises NotFound, UsageError."""
    check_operator(actor)
    with service.store.reading() as session:
        return batches.job_line(session, batches.job_before(session, job_id))


def load_words(service: Service, actor: Actor, job_id: str) -> tuple[Grade, Submission]:
    """A grade as it counts, with recordings without ticks and images, and its submission. Raises NotFound."""
    from service.store.batches import intake
    from service.store.grades import results

    check_operator(actor)
    with service.store.reading() as session:
        return results.load_words(session, job_id), intake.load_submission(session, job_id)


def load(service: Service, actor: Actor, job_id: str) -> Grade:
    """A grade as it counts, with whole recordings. Raises NotFound, and UsageError where there is no grade."""
    from service.store.grades import results

    check_operator(actor)
    with service.store.reading() as session:
        return results.load(session, job_id)


def load_grading(service: Service, actor: Actor, grade: str) -> Grading:
    """The grading whose id begins so. Raises NotFound, and UsageError where there is no grade."""
    from service.store.batches import intake
    from service.store.grades import results
    from service.store.installation import secret_of
    from service.store.models import Job

    check_operator(actor)
    own_secret = secret_of(service.store)
    with service.store.reading() as session:
        job = session.get_one(Job, batches.find_job(session, grade))
        stored, request = results.load_graded(session, job.id), intake.load_grading_request(session, job.id)
        return Grading(job.id, stored, request, job.grader_sha256, job.secret_sha256, own_secret)
