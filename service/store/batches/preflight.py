"""What would come of a batch if it were taken in now: who is new to the course, and what is known already. Only reads.

What is refused was found when it was read, or is by ``intake.py`` when it is taken in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy.orm import Session

from service.store.batches import intake
from service.store.courses.versions import freeze
from service.store.grades import result_cache
from service.store.people.students import Students
from service.version import grader_sha256
from submissions.grading_request import GradingRequest


@dataclass(frozen=True, slots=True)
class Foreseen:
    """Of one submission: whether its student is in the course, and what is known of it."""

    enrolled: bool
    known: bool  # it is the newest of its student, and stays as it is
    copied: bool  # an identical one is graded, and it gets that grade at once


def foresee(
    session: Session, course_id: int, grading_requests: Sequence[GradingRequest], secret_sha256: str
) -> list[Foreseen]:
    """One of each, in their order."""
    students = Students(session, course_id)
    versions = {id(each.assignment): each.assignment for each in grading_requests}
    frozen = {key: freeze(assignment).sha256 for key, assignment in versions.items()}
    return [
        _one(session, students.known(each.student), each, frozen[id(each.assignment)], secret_sha256)
        for each in grading_requests
    ]


def _one(
    session: Session, enrolment_id: int | None, asked: GradingRequest, assignment_sha256: str, secret_sha256: str
) -> Foreseen:
    if enrolment_id is not None and intake.already_submitted(session, asked, enrolment_id, assignment_sha256):
        return Foreseen(enrolled=True, known=True, copied=False)
    key = result_cache.key_of(asked.submission.sha256, assignment_sha256, grader_sha256(), secret_sha256)
    return Foreseen(enrolment_id is not None, known=False, copied=result_cache.find(session, key) is not None)
