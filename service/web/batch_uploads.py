"""Reads a zip of submissions that an instructor uploads, for the pages and for the API, one at a time.

What of it can be taken in is ``submissions.batch_folder``'s to say.
"""

from __future__ import annotations

from pathlib import Path

from service.operations.batches import assignment_for
from service.operations.context import Actor
from service.web.context import WebContext
from service.web.refusing import Declined
from sim.sentences import Sentence
from submissions.batch_folder import BatchContents, read_batch_for
from submissions.student_identity import People

_UNPACKING_SECONDS = 30


def read_upload(
    context: WebContext, actor: Actor, course_id: int, path: Path, assignment: str, people: People | None = None
) -> BatchContents:
    """What of a zip or folder would be taken in, and what not. Raises UsageError where it cannot be read at all.

    Without ``assignment`` each submission names its own.
    """
    asked = assignment_for(context.service, actor, course_id, assignment)
    # Each may need gigabytes of temporary disk.
    if not context.unpacking.acquire(timeout=_UNPACKING_SECONDS):
        raise Declined(503, Sentence("Another upload is being read; try again in a minute."), {"retry-after": "60"})
    try:
        return read_batch_for(path, asked, people)
    finally:
        context.unpacking.release()
