"""Reading of uploaded zips with submissions, for pages and API. Only one upload is read at a time.

``submissions.batch_folder`` decides which submissions are accepted.
"""

from __future__ import annotations

from pathlib import Path

from service.operations.batches import find_batch_assignment
from service.operations.context import Actor
from service.web.context import UPLOAD_IN_PROGRESS, WebContext, hold_slot
from submissions.batch_folder import BatchContents, read_batch
from submissions.student_identity import People


def read_upload(
    context: WebContext, actor: Actor, course_id: int, path: Path, assignment: str, people: People | None = None
) -> BatchContents:
    """Read a zip or folder and return its accepted and rejected submissions.

    Args:
        context: The web server's context.
        actor: The instructor.
        course_id: The course.
        path: The zip or folder.
        assignment: Id of the assignment. If it is empty, each submission names its own.
        people: Table of names and email addresses.

    Raises:
        UsageError: The upload cannot be read.
        HTTPException: 503 if another upload is being read.
    """
    batch_assignment = find_batch_assignment(context.service, actor, course_id, assignment)
    # One at a time, because an upload may need gigabytes of temporary disk space.
    with hold_slot(context.unpacking, UPLOAD_IN_PROGRESS):
        return read_batch(path, batch_assignment, people)
