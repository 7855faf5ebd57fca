"""A student's files become a submission and its job, or a tryout: the one way in for the pages and for the API.

Whose it is follows from who is signed in, whatever the files say; what they have to be is ``submissions.bundle``'s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy.orm import Session

from service import own_work
from service.store.batches import intake
from service.store.batches.intake import Accepted
from service.store.courses import open_assignments
from service.store.courses.open_assignments import CourseAssignment
from service.store.models import Course
from service.store.people.credentials import Identity
from service.store.queue import tryouts
from service.store.states import Lane
from service.trying import tryout_assignment
from service.web.access import enrolment_in, nothing_here
from service.web.context import WebContext
from sim.errors import UsageError
from submissions.assignment.definition import Assignment
from submissions.bundle import empty_parts, missing_part, submission_of
from submissions.grading_request import GradingRequest
from submissions.packed import pack_submission
from submissions.people import Student
from submissions.raw_files import SentFile, read_sent, shown
from submissions.submission import PART_FILES


class LacksPart(UsageError):
    """One of two parts is not there: whoever sends it may have forgotten it, or do without it."""


def submit(
    context: WebContext,
    identity: Identity,
    course_id: int,
    assignment: str,
    sent: Sequence[SentFile],
    *,
    even_in_part: bool,
) -> Accepted:
    """Take in what a student of the course sent for an assignment, and tell the workers.

    Raises HTTPException where there is no such assignment for students or it comes too often, and UsageError, one
    sentence, where nothing may be submitted any more or the files are no submission; LacksPart where one of two parts
    is not there, unless it is taken in ``even_in_part``.
    """
    way = _way_in(context, identity, course_id, assignment)
    context.limits.submissions.spend(str(identity.person_id))
    asked = _read(way, sent)
    lacking = missing_part(asked.submission, way.asked.parts)
    if lacking is not None and not even_in_part:
        raise LacksPart(
            "there is no %(name)s: add it, or say below that you submit without it, which uses an attempt.",
            name=PART_FILES[lacking],
        )
    accepted = intake.accept(
        context.store,
        asked,
        course=way.course,
        max_attempts=context.settings.max_attempts,
        batch_id=way.opened.batch_id,
    )
    if accepted.copied_from is None:
        context.notifier.grade(Lane.BATCH if accepted.staff_only else Lane.INTERACTIVE)
    return accepted


def try_out(context: WebContext, identity: Identity, course_id: int, assignment: str, sent: Sequence[SentFile]) -> str:
    """Let what a student sent be run without submitting it, and tell the workers. Returns the tryout's id.

    Raises as ``submit`` does, and UsageError where there is nothing to try, or the student tries too much.
    """
    way = _way_in(context, identity, course_id, assignment)
    context.limits.tryouts.spend(str(identity.person_id))
    if tryout_assignment(way.asked) is None:
        raise UsageError("there is nothing to try here: no robot is run that you would see.")
    packed = pack_submission(_read(way, sent).submission)
    with context.store.transaction() as session:
        made = tryouts.ask(session, way.enrolment_id, way.opened.version_id, packed)
    context.notifier.try_out()
    return made


def seen_assignment(session: Session, identity: Identity, course_id: int, assignment: str) -> Assignment:
    """An assignment that a student may see: it was opened, or they have submitted to it."""
    prepared = {each.assignment: each for each in open_assignments.of_course(session, course_id)}.get(assignment)
    if prepared is not None and prepared.open:
        return open_assignments.load(session, course_id, assignment)
    submitted = own_work.own_submissions(session, enrolment_in(session, identity, course_id).id, assignment)
    if not submitted:
        raise nothing_here()
    return intake.load_assignment(session, submitted[0].job_id)


@dataclass(frozen=True, slots=True)
class _WayIn:
    """Who sends something, and for what."""

    course: str
    enrolment_id: int
    student: Student
    opened: CourseAssignment
    asked: Assignment


def _way_in(context: WebContext, identity: Identity, course_id: int, assignment: str) -> _WayIn:
    with context.store.reading() as session:
        enrolment = enrolment_in(session, identity, course_id)
        opened = {each.assignment: each for each in open_assignments.of_course(session, course_id)}.get(assignment)
        if opened is None or opened.opened_at is None:
            raise nothing_here()
        if not opened.open:
            raise UsageError("%(title)s is closed; nothing can be submitted to it any more.", title=opened.title)
        asked = open_assignments.load(session, course_id, assignment)
        course = session.get_one(Course, course_id).name
        return _WayIn(course, enrolment.id, Student(enrolment.written), opened, asked)


def _read(way: _WayIn, sent: Sequence[SentFile]) -> GradingRequest:
    if not sent:
        raise UsageError("nothing was sent; choose a file, or paste a program.")
    source = shown(", ".join(dict.fromkeys(each.flat_name for each in sent)))
    submission = submission_of(read_sent(sent, source), source, way.student.id, way.asked.id, way.asked.parts)
    for name in empty_parts(submission):
        raise UsageError("%(name)s is empty, expected a program.", name=name)
    return GradingRequest(submission, way.asked, source, whose=way.student)
