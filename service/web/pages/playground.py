"""The playground: any program on any floor, without an assignment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from fastapi import APIRouter, Form, Query, Request
from fastapi.responses import Response

from service.operations import playground
from service.operations.playground import PlaygroundRequest, PlaygroundWorld
from service.operations.types import Role
from service.web.access import CourseMember, ReaderInCourse
from service.web.api_uploads import MAX_SUBMISSION_BYTES
from service.web.context import Context, WebContext
from service.web.pages.own_assignments import Files, Texts, collect_sent_files
from service.web.rendering import is_htmx_request, render_page
from service.web.request_bodies import takes_upload
from service.web.run_responses import Rejection, describe_run, find_rejection, render_progress, respond_to_start
from service.web.student_submissions import start_playground_run

router = APIRouter()

_FloorName = Annotated[str, Query(max_length=100)]


@router.get("/courses/{course_id}/playground")
def show_playground(
    request: Request,
    access: CourseMember,
    context: Context,
    floor: _FloorName = "",
    shown: _FloorName = "",
    x: float | None = None,
    y: float | None = None,
    heading: float | None = None,
    light_noise: float = 0.0,
    motor_noise: float = 0.0,
) -> Response:
    """Show the newest run, with its world and its program in the form for the next one.

    A ``floor`` replaces its world. If it is not the one that the page shows, the robot is at the usual start of it.
    Requests from htmx get only the form of the world, the progress or the result.
    """
    world = None
    if floor:
        start = (x, y, heading) if floor == shown or not shown else (None, None, None)
        world = playground.place_on_floor(floor).change(start, light_noise, motor_noise)
    if world is not None and is_htmx_request(request):
        if not playground.is_possible(world):
            return Response(status_code=204)  # the browser explains the range, and the picture stays
        return render_page(request, access.reader, "playground_world.html", status_code=200, **_describe_world(world))
    if is_htmx_request(request):
        line = playground.find_newest(context.service, access.actor, access.course_id)
        if line is None or line.waits:
            return render_progress(request, access, line)
    return _render_playground(request, access, context, world=world)


@router.post("/courses/{course_id}/playground")
@takes_upload(MAX_SUBMISSION_BYTES, Role.STUDENT, Role.INSTRUCTOR)
def run_in_playground(
    request: Request,
    access: CourseMember,
    context: Context,
    floor: Annotated[str, Form(max_length=100)] = playground.DEFAULT_WORLD.floor,
    x: Annotated[float, Form()] = playground.DEFAULT_WORLD.x,
    y: Annotated[float, Form()] = playground.DEFAULT_WORLD.y,
    heading: Annotated[float, Form()] = playground.DEFAULT_WORLD.heading,
    light_noise: Annotated[float, Form()] = 0.0,
    motor_noise: Annotated[float, Form()] = 0.0,
    files: Files = (),
    texts: Texts = (),
) -> Response:
    """Run the chosen files and typed texts in this world."""
    world = PlaygroundWorld(floor, x, y, heading, light_noise, motor_noise)
    rejection = find_rejection(
        request,
        lambda: start_playground_run(
            context,
            access.actor,
            access.course_id,
            PlaygroundRequest(world, collect_sent_files(playground.PLAYGROUND_FILES, files, texts)),
        ),
    )
    if rejection is not None and not is_htmx_request(request):
        typed_world = world if playground.is_possible(world) else None
        return _render_playground(request, access, context, world=typed_world, rejection=rejection, typed_texts=texts)
    line = playground.find_newest(context.service, access.actor, access.course_id)
    return respond_to_start(request, access, rejection, line)


def _render_playground(
    request: Request,
    access: ReaderInCourse,
    context: WebContext,
    *,
    world: PlaygroundWorld | None = None,
    rejection: Rejection | None = None,
    typed_texts: Sequence[str] = (),
) -> Response:
    view = playground.show_newest(context.service, access.actor, access.course_id)
    page = render_page(
        request,
        access.reader,
        "run_result.html" if is_htmx_request(request) else "playground.html",
        status_code=rejection.status if rejection else 200,
        access=access,
        seconds=view.seconds,
        rejection=rejection,
        texts=list(typed_texts) or view.texts,
        **_describe_world(world or view.world),
        **describe_run(request, view.line, view.replay, playground.PLAYGROUND_FILES, has_program=not typed_texts),
    )
    page.headers.update(rejection.headers if rejection else {})
    return page


def _describe_world(world: PlaygroundWorld) -> dict[str, object]:
    return {
        "world": world,
        "floors": playground.list_floors(),
        "ranges": playground.RANGES,
        "picture": playground.show_picture(world),
    }
