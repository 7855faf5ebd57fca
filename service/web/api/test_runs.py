"""API of test runs and runs in the playground: start one, follow its progress and read its output, without marks."""

from __future__ import annotations

import zlib
from datetime import datetime
from typing import Annotated, Any

from fastapi import Depends, Query, Request
from fastapi.responses import Response
from pydantic import Field

from service.operations import playground, test_runs
from service.operations.playground import DEFAULT_WORLD, RANGES, PlaygroundRequest
from service.operations.test_runs import StudentTestRun
from service.operations.types import Role, RunState
from service.web.access import RowName
from service.web.api.grades import REPLAY_RESPONSES
from service.web.api.shapes import Shape, build_example_config
from service.web.api_access import CallerInCourse, require_member, require_role
from service.web.api_routes import api_router, respond_with_etag
from service.web.api_uploads import MAX_SUBMISSION_BYTES, SENT_BODY, SentFiles
from service.web.context import Context
from service.web.request_bodies import takes_upload
from service.web.student_submissions import start_playground_run, start_test_run

router = api_router("mine")
ReadAccess = Annotated[CallerInCourse, Depends(require_member("read"))]
SubmitAccess = Annotated[CallerInCourse, Depends(require_role(Role.STUDENT, "submit"))]
MemberSubmitAccess = Annotated[CallerInCourse, Depends(require_member("submit"))]
PREFIX = "/courses/{course_id}/mine/tryouts"


class TestRunShape(Shape):
    """A test run of a program."""

    id: str
    assignment: str = Field(description="Id of the assignment; `Playground` for a run in the playground.")
    state: RunState
    queued_at: datetime
    before: int = Field(description="Number of test runs ahead in the queue.")
    said: dict[str, Any] | None = Field(
        description="Result of a finished test run: `happened`, `whose`, `seconds`, `lines` as [time, text], "
        "`faults`; or `refused`, the reason for rejecting the program. Null until then."
    )
    error: str = Field(description="Reason for a failure of the system; empty if there is none.")

    model_config = build_example_config(
        id="7xk2v9q4m0ab",
        assignment="shape-recognition",
        state="done",
        queued_at="2026-11-02T09:00:00Z",
        before=0,
        said={"happened": "The program ended by itself.", "seconds": 2.5, "lines": [[0.1, "begun"]], "faults": []},
        error="",
    )


@router.post(PREFIX, status_code=201, openapi_extra=SENT_BODY)
@takes_upload(MAX_SUBMISSION_BYTES, Role.STUDENT)
def ask(
    access: SubmitAccess,
    context: Context,
    uploaded_files: SentFiles,
    assignment: Annotated[str, Query(min_length=1, max_length=100, examples=["shape-recognition"])],
) -> TestRunShape:
    """Start a test run at the first pose of the first visible scenario.

    A test run has no marks and does not count as an attempt.
    """
    test_run_id = start_test_run(context, access.actor, access.course_id, assignment, uploaded_files)
    return _to_test_run_shape(test_runs.show(context.service, access.actor, access.course_id, test_run_id))


@router.post("/courses/{course_id}/playground", status_code=201, openapi_extra=SENT_BODY)
@takes_upload(MAX_SUBMISSION_BYTES, Role.STUDENT, Role.INSTRUCTOR)
def run_in_playground(
    access: MemberSubmitAccess,
    context: Context,
    uploaded_files: SentFiles,
    floor: Annotated[str, Query(max_length=100, examples=["Simple_Shapes"])] = DEFAULT_WORLD.floor,
    x: Annotated[
        float | None, Query(ge=0, le=RANGES["x"], description="Start in mm, by default that of the floor.")
    ] = None,
    y: Annotated[float | None, Query(ge=0, le=RANGES["y"], description="Start in mm.")] = None,
    heading: Annotated[float | None, Query(ge=0, le=RANGES["heading"], description="Degrees, anticlockwise.")] = None,
    light_noise: Annotated[
        float, Query(ge=0, le=RANGES["light_noise"], description="Noise of the light sensors.")
    ] = 0.0,
    motor_noise: Annotated[float, Query(ge=0, le=RANGES["motor_noise"], description="Noise of the motors.")] = 0.0,
) -> TestRunShape:
    """Run a program on any floor, without an assignment. It is a test run, within the same limits."""
    world = playground.place_on_floor(floor).change((x, y, heading), light_noise, motor_noise)
    request = PlaygroundRequest(world, uploaded_files)
    test_run_id = start_playground_run(context, access.actor, access.course_id, request)
    return _to_test_run_shape(test_runs.show(context.service, access.actor, access.course_id, test_run_id))


@router.get(PREFIX + "/{tryout_id}")
def one_test_run(access: ReadAccess, context: Context, tryout_id: RowName) -> TestRunShape:
    """Return the state and the result of a test run. Test runs are deleted after a day."""
    return _to_test_run_shape(test_runs.show(context.service, access.actor, access.course_id, tryout_id))


@router.get(PREFIX + "/{tryout_id}/replay", responses=REPLAY_RESPONSES, response_class=Response)
def replay(request: Request, access: ReadAccess, context: Context, tryout_id: RowName) -> Response:
    """Return the data of a replay of the test run; 404 until it is available."""
    compressed = test_runs.show_replay(context.service, access.actor, access.course_id, tryout_id)
    return respond_with_etag(request, zlib.decompress(compressed), "application/json")


def _to_test_run_shape(line: StudentTestRun) -> TestRunShape:
    return TestRunShape(
        id=line.id,
        assignment=line.assignment,
        state=line.state,
        queued_at=line.queued_at,
        before=line.before,
        said=line.words or None,
        error="" if line.waits else line.error,
    )
