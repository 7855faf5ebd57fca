"""Rate-limited submissions, test runs and runs in the playground, for pages and API. Only a few are read at a time."""

from __future__ import annotations

from collections.abc import Sequence

from service.operations import courses, playground, submissions, test_runs
from service.operations.context import Actor
from service.operations.playground import PlaygroundRequest
from service.operations.submissions import AcceptedSubmission, SubmissionRequest
from service.web.context import UPLOAD_IN_PROGRESS, WebContext, hold_slot
from submissions.raw_files import UploadedFile


def submit(context: WebContext, actor: Actor, course_id: int, request: SubmissionRequest) -> AcceptedSubmission:
    """Submit files. Raises HTTPException 429 above the rate limit or 503, and the errors of ``submissions.submit``."""
    submissions.load_submission_target(context.service, actor, course_id, request.assignment)
    context.limits.submissions.spend(str(actor.person_id))
    with hold_slot(context.reading, UPLOAD_IN_PROGRESS):
        return submissions.submit(context.service, actor, course_id, request)


def start_test_run(
    context: WebContext, actor: Actor, course_id: int, assignment: str, files: Sequence[UploadedFile]
) -> str:
    """Start a test run. Raises HTTPException 429 above the rate limit or 503, and the errors of ``test_runs.start``."""
    submissions.load_submission_target(context.service, actor, course_id, assignment)
    context.limits.test_runs.spend(str(actor.person_id))
    with hold_slot(context.reading, UPLOAD_IN_PROGRESS):
        return test_runs.start(context.service, actor, course_id, assignment, files)


def start_playground_run(context: WebContext, actor: Actor, course_id: int, request: PlaygroundRequest) -> str:
    """Start a run. Raises HTTPException 429 above the rate limit or 503, and the errors of ``playground.start``."""
    courses.show_membership(context.service, actor, course_id)
    context.limits.test_runs.spend(str(actor.person_id))
    with hold_slot(context.reading, UPLOAD_IN_PROGRESS):
        return playground.start(context.service, actor, course_id, request)
