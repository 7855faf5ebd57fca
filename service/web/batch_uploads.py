"""A zip of submissions that an instructor uploads becomes a batch: the one way in for the pages and for the API.

What of it can be taken in is ``submissions.batch_folder``'s to say.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from sqlalchemy.orm import Session

from service.store.batches import intake
from service.store.courses import open_assignments
from service.store.models import Course
from service.store.states import Lane
from service.web.context import WebContext
from sim.errors import UsageError
from submissions.assignment.definition import Assignment
from submissions.assignment.reader import find_in_catalogue
from submissions.batch_folder import BatchContents, read_batch_for
from submissions.people import People, Refusal


@dataclass(frozen=True, slots=True)
class UploadedBatch:
    """What was taken in, and all that was not."""

    accepted: intake.AcceptedNew
    refusals: tuple[Refusal, ...]


def assignment_of(session: Session, course_id: int, name: str) -> Assignment:
    """An assignment as the course has it, else the catalogue's; never a folder. Raises UsageError for neither."""
    if name in {each.assignment for each in open_assignments.of_course(session, course_id)}:
        return open_assignments.load(session, course_id, name)
    return find_in_catalogue(name)


def upload_batch(
    context: WebContext, course_id: int, path: Path, name: str, assignment: str, *, again: bool
) -> UploadedBatch:
    """Take in what is new of a zip, or with ``again`` all of it, and tell the workers.

    Without ``assignment`` each submission names its own. Raises UsageError where nothing can be taken in.
    """
    return take_in(context, course_id, name, read_upload(context, course_id, path, assignment), again=again)


def read_upload(
    context: WebContext, course_id: int, path: Path, assignment: str, people: People | None = None
) -> BatchContents:
    """What of a zip or folder would be taken in, and what not. Raises UsageError where it cannot be read at all."""
    with context.store.reading() as session:
        asked = assignment_of(session, course_id, assignment) if assignment else None
    return read_batch_for(path, asked, people)


def take_in(context: WebContext, course_id: int, name: str, checked: BatchContents, *, again: bool) -> UploadedBatch:
    """Make a batch of what was read, and tell the workers. Raises UsageError where nothing can be taken in."""
    if not checked.grading_requests:
        raise UsageError(f"none of {len(checked.refusals)} submissions can be taken in; {_first(checked.refusals)}")
    with context.store.reading() as session:
        course = session.get_one(Course, course_id).name
    batch = (name, checked.grading_requests, checked.refusals)
    most = context.settings.max_attempts
    if again:
        made = intake.accept_batch(context.store, *batch, course=course, max_attempts=most)
        accepted = intake.AcceptedNew(made, (), made.refused)
    else:
        accepted = intake.accept_new(context.store, *batch, course=course, max_attempts=most)
    refusals = (*checked.refusals, *accepted.refused)
    if accepted.batch is None and not accepted.known:
        raise UsageError(f"none of {len(refusals)} submissions can be taken in; {_first(refusals)}")
    if accepted.batch is not None:
        context.notifier.grade(Lane.BATCH, sum(job.copied_from is None for job in accepted.batch.jobs))
    return UploadedBatch(accepted, refusals)


def _first(refusals: tuple[Refusal, ...]) -> str:
    return refusals[0].sentence if refusals else "there are none"
