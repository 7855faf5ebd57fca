"""A student's files become a submission and its job: the one way in for the pages and for the API.

Whose it is follows from who is signed in, whatever the files say; what they have to be is ``submissions.bundle``'s.
"""

from __future__ import annotations

from collections.abc import Sequence

from service.store import intake, open_assignments
from service.store.credentials import Identity
from service.store.intake import Accepted
from service.store.models import Course
from service.store.states import Lane
from service.web.access import enrolment_in, nothing_here
from service.web.context import WebContext
from sim.errors import UsageError
from submissions.bundle import submission_of
from submissions.grading_request import GradingRequest
from submissions.people import Student
from submissions.raw_files import SentFile, read_sent, shown


def submit(
    context: WebContext, identity: Identity, course_id: int, assignment: str, sent: Sequence[SentFile]
) -> Accepted:
    """Take in what a student of the course sent for an assignment, and tell the workers.

    Raises HTTPException where there is no such assignment for students or it comes too often, and UsageError, one
    sentence, where nothing may be submitted any more or the files are no submission.
    """
    with context.store.reading() as session:
        course = session.get_one(Course, course_id).name
        student = Student(enrolment_in(session, identity, course_id).written)
        opened = {each.assignment: each for each in open_assignments.of_course(session, course_id)}.get(assignment)
        if opened is None or opened.opened_at is None:
            raise nothing_here()
        if not opened.open:
            raise UsageError(f"{opened.title} is closed; nothing can be submitted to it any more.")
        asked = open_assignments.load(session, course_id, assignment)
    context.limits.submissions.spend(str(identity.person_id))
    if not sent:
        raise UsageError("nothing was sent; choose a file, or paste a program.")
    source = shown(", ".join(each.flat_name for each in sent))
    submission = submission_of(read_sent(sent, source), source, student.id, asked.id, asked.parts)
    accepted = intake.accept(
        context.store,
        GradingRequest(submission, asked, source, whose=student),
        course=course,
        max_attempts=context.settings.max_attempts,
        lane=Lane.INTERACTIVE,
    )
    if accepted.copied_from is None:
        context.notifier.grade(Lane.BATCH if accepted.staff_only else Lane.INTERACTIVE)
    return accepted
