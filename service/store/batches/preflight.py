"""Preview of an intake: new students and known submissions of a batch. Read-only.

Rejections are found when the batch is read, or by ``intake.py`` when it is accepted.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from sqlalchemy.orm import Session

from service.store.batches import known_submissions
from service.store.courses.assignment_versions import freeze_assignment
from service.store.grades import result_cache
from service.store.people.students import Students
from service.version import hash_grader
from submissions.grading_request import GradingRequest


@dataclass(frozen=True, slots=True)
class IntakePreview:
    """Preview of one submission: whether its student is enrolled and whether the submission is known."""

    enrolled: bool
    known: bool  # it is the student's newest and stays unchanged
    copied: bool  # an identical one is graded, and its grade is copied


def preview_intake(
    session: Session,
    course_id: int,
    grading_requests: Sequence[GradingRequest],
    secret_sha256: str,
    hidden_assignments: Collection[str] = (),
) -> list[IntakePreview]:
    """Return a preview of each grading request, in their order.

    For the assignments in ``hidden_assignments``, whose students' names are hidden, it does not depend on what the
    student submitted. Otherwise an instructor could submit the files of a row under each name and find out the student.
    """
    students = Students(session, course_id)
    versions = {id(each.assignment): each.assignment for each in grading_requests}
    digests = {key: freeze_assignment(assignment).sha256 for key, assignment in versions.items()}
    return [
        _preview_request(
            session,
            students.find_enrolment(each.student),
            each,
            digests[id(each.assignment)],
            secret_sha256,
            may_be_known=each.assignment.id not in hidden_assignments,
        )
        for each in grading_requests
    ]


def _preview_request(
    session: Session,
    enrolment_id: int | None,
    grading_request: GradingRequest,
    assignment_sha256: str,
    secret_sha256: str,
    *,
    may_be_known: bool,
) -> IntakePreview:
    if (
        may_be_known
        and enrolment_id is not None
        and known_submissions.find_known_submission(session, grading_request, enrolment_id, assignment_sha256)
    ):
        return IntakePreview(enrolled=True, known=True, copied=False)
    key = result_cache.combine_cache_key(
        grading_request.submission.sha256, assignment_sha256, hash_grader(), secret_sha256
    )
    return IntakePreview(
        enrolment_id is not None, known=False, copied=result_cache.find_cached_grade(session, key) is not None
    )
