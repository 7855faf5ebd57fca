"""API of notebooks: run a magic's robot to its next question, check a notebook, and wait for the result.

The responder is in the notebook. A run ends at the first question without an answer; send the magic again with one more
answer, and the run repeats exactly to the next question.
"""

from __future__ import annotations

import zlib
from typing import Annotated, Any, Literal

from fastapi import Depends, Query, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response
from pydantic import Field

from service.notebook_engine.requests import MagicRequest
from service.operations import notebook_runs
from service.operations.notebook_runs import NotebookRunWithResult
from service.operations.types import Role, RunState
from service.web.access import RowName
from service.web.api.shapes import Shape, build_example_config
from service.web.api_access import CallerInCourse, require_role
from service.web.api_routes import api_router
from service.web.api_uploads import MAX_SUBMISSION_BYTES, SENT_BODY, SentFiles
from service.web.compression import compress_response
from service.web.context import UPLOAD_IN_PROGRESS, Context, hold_slot
from service.web.request_bodies import takes_upload

router = api_router("mine")
SubmitAccess = Annotated[CallerInCourse, Depends(require_role(Role.STUDENT, "submit"))]
PREFIX = "/courses/{course_id}/mine/notebook-runs"
_MAX_ANSWERS = 200
_MAX_WAIT_SECONDS = 20.0


class NotebookRunRequest(MagicRequest):
    """A magic that a cell has called, and the answers to the first questions of its run."""

    answers: Annotated[list[str | None], Field(max_length=_MAX_ANSWERS)] = Field(
        description="Answers of the responder in order; null if it returned nothing."
    )


class NotebookRunShape(Shape):
    """A run or check of a notebook."""

    id: str
    kind: Literal["run", "check"]
    state: RunState
    before: int = Field(description="Number of runs ahead in the queue.")
    refused: str = Field(description="Reason for rejecting the request; empty if it was not rejected.")
    error: str = Field(description="Reason for a failure of the system; empty if there is none.")
    result: dict[str, Any] | None = Field(
        description="Result of a run: `question` with `number`, `t`, `text`, `data`, `images`; or `page`, `notes` and "
        "`run`. Of a check: `title`, `happened`, `marks`, `out_of`, `criteria`, `next_steps`, `notes`, `replay`. Null "
        "until then.",
        default=None,
    )

    model_config = build_example_config(
        id="7xk2v9q4m0ab", kind="run", state="done", before=0, refused="", error="", result=None
    )


@router.post(PREFIX, status_code=201)
def run(access: SubmitAccess, context: Context, request: NotebookRunRequest) -> NotebookRunShape:
    """Perform a magic of a notebook, and run the robot if it starts one, to the first question without an answer.

    It belongs to no assignment, has no marks and does not count as an attempt. `page` is that of the last result.
    """
    context.limits.notebook_runs.spend(str(access.actor.person_id))
    return NotebookRunShape.model_validate(
        notebook_runs.start_run(context.service, access.actor, access.course_id, request, request.answers)
    )


@router.post(PREFIX + "/checks", status_code=201, openapi_extra=SENT_BODY)
@takes_upload(MAX_SUBMISSION_BYTES, Role.STUDENT)
def check(
    access: SubmitAccess,
    context: Context,
    uploaded_files: SentFiles,
    assignment: Annotated[str, Query(min_length=1, max_length=100, examples=["shape-recognition"])],
) -> NotebookRunShape:
    """Check a notebook in the visible scenarios of an assignment.

    A check has no marks that count and is not an attempt. Send each file as a form part `files`.
    """
    context.limits.test_runs.spend(str(access.actor.person_id))
    with hold_slot(context.reading, UPLOAD_IN_PROGRESS):
        started = notebook_runs.start_check(context.service, access.actor, access.course_id, assignment, uploaded_files)
    return NotebookRunShape.model_validate(started)


@router.get(PREFIX + "/{run_id}", response_model=NotebookRunShape)
async def one_run(
    request: Request,
    access: SubmitAccess,
    context: Context,
    run_id: RowName,
    wait: Annotated[float, Query(ge=0, le=_MAX_WAIT_SECONDS, description="Seconds to wait for the end.")] = 0.0,
) -> Response:
    """Return a run or check with its result. With `wait`, the response comes at its end, or after this time."""
    parts = (context.service, access.actor, access.course_id, run_id)
    found = await run_in_threadpool(notebook_runs.show, *parts)
    if found.run.waits and wait:
        await context.ended_runs.wait(run_id, wait)
        found = await run_in_threadpool(notebook_runs.show, *parts)
    return await run_in_threadpool(_respond, request, found)


def _respond(request: Request, found: NotebookRunWithResult) -> Response:
    """Return the state with the stored JSON of the result, which is not parsed again."""
    state = NotebookRunShape.model_validate(found.run).model_dump_json(exclude={"result"}).encode()
    result = b"null" if found.result is None else zlib.decompress(found.result)
    return compress_response(
        request, Response(b'%s,"result":%s}' % (state[:-1], result), media_type="application/json")
    )
