"""API of a course's batches: submit, follow, pause and resume them, and list their submissions and grades."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from fastapi import Depends, Query
from pydantic import Field

from service.operations import batch_views as views
from service.operations import batches as operations
from service.operations.batches import AcceptedSubmission, KnownSubmission, SubmitRequest
from service.operations.types import Role
from service.web.access import RowName
from service.web.api.shapes import BATCH_EXAMPLE, BatchShape, JobShape, RefusalShape, Shape, build_example_config
from service.web.api_access import CallerInCourse, require_role
from service.web.api_routes import After, Limit, Listed, api_router, build_list_page, decode_cursor
from service.web.api_uploads import MAX_BATCH_BYTES, ZIP_BODY, UploadedZip
from service.web.batch_uploads import read_upload
from service.web.context import Context
from service.web.request_bodies import takes_upload

router = api_router("batches")
ReadAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "read"))]
SubmitAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "submit"))]


class ProgressShape(Shape):
    """Progress of a batch, in jobs."""

    jobs: int
    ended: int
    partial: float = Field(description="Sum of the progress of the running jobs; each counts from 0 to 1.")
    plots_due: int


class PaceShape(Shape):
    """Recent grading speed in jobs per minute, and estimated remaining seconds."""

    per_minute: float
    left_seconds: float


class CriterionStatisticsShape(Shape):
    """The results of a class for one criterion."""

    id: str
    title: str
    n: int
    mean_share: float = Field(description="Mean fraction of the criterion's marks, from 0 to 1.")


class CauseShape(Shape):
    """A cause of lost marks, with the affected students."""

    sentence: str
    students: list[str]


class StatisticsShape(Shape):
    """The results of a class for one assignment."""

    assignment: str
    n: int
    max_marks: float
    mean: float
    spread: float | None
    lowest: float
    median: float
    highest: float
    criteria: list[CriterionStatisticsShape]
    causes: list[CauseShape] = Field(description="Most common first.")


class WholeBatchShape(BatchShape):
    """A batch with its progress and statistics."""

    progress: ProgressShape
    pace: PaceShape | None
    statistics: list[StatisticsShape]
    unpublished_regrades: int

    model_config = build_example_config(
        **BATCH_EXAMPLE,
        progress={"jobs": 20, "ended": 18, "partial": 0.7, "plots_due": 3},
        pace={"per_minute": 60, "left_seconds": 2},
        statistics=[],
        unpublished_regrades=0,
    )


class KnownShape(Shape):
    """A submission that the student has already submitted unchanged. It is ignored."""

    job_id: str
    batch_id: str | None
    student: str


class ForStaffShape(Shape):
    """A submission that exceeds a limit. It is graded, but only staff can see it."""

    job_id: str
    student: str
    staff_only: str


class TakenShape(Shape):
    """The accepted and rejected submissions of an upload."""

    batch: str | None = Field(description="ID of the batch; null if no submission is new.")
    queued: int
    copied: int = Field(
        description="Number of submissions identical to a graded one. They get the same grade immediately."
    )
    known: list[KnownShape]
    for_staff: list[ForStaffShape]
    refusals: list[RefusalShape]

    model_config = build_example_config(
        batch="0c5w1r8zt3ye",
        queued=19,
        copied=1,
        known=[],
        for_staff=[],
        refusals=[],
    )


class ControlledShape(Shape):
    """Result of the action: whether the batch changed, and the numbers of waiting and running jobs."""

    changed: bool
    waiting: int
    running: int

    model_config = build_example_config(changed=True, waiting=12, running=2)


class RetriedShape(Shape):
    """Numbers of failed jobs that were queued again, and of those skipped because of a newer submission."""

    queued: int
    outdated: int

    model_config = build_example_config(queued=2, outdated=0)


@router.get("/courses/{course_id}/batches")
def list_batches(access: ReadAccess, context: Context, limit: Limit = 50, after: After = "") -> Listed[BatchShape]:
    """List the batches of the course, newest first."""
    sort_key = decode_cursor(after, datetime, str)
    cursor = (sort_key[0], sort_key[1]) if sort_key else None
    lines = views.list_batches(context.service, access.actor, access.course_id, limit + 1, cursor)
    shapes = [BatchShape.model_validate(line) for line in lines]
    return build_list_page(shapes, limit, lambda each: [each.created_at, each.id])


@router.post("/courses/{course_id}/batches", status_code=201, openapi_extra=ZIP_BODY)
@takes_upload(MAX_BATCH_BYTES, Role.INSTRUCTOR)
def submit_batch(
    access: SubmitAccess,
    context: Context,
    upload: UploadedZip,
    name: Annotated[str, Query(min_length=1, max_length=200, description="Name of the batch.")] = "upload",
    assignment: Annotated[
        str,
        Query(
            max_length=100,
            description="An assignment of the course or catalogue; if empty, each submission names its assignment.",
        ),
    ] = "",
    again: Annotated[bool, Query(description="Grade submissions again that were already submitted.")] = False,
) -> TakenShape:
    """Upload a zip with one submission for each student, in the layout of `robomark batch submit`."""
    contents = read_upload(context, access.actor, access.course_id, upload, assignment)
    submitted_batch = operations.submit(
        context.service, access.actor, access.course_id, SubmitRequest(name, contents, again)
    )
    over_limit = [job for job in submitted_batch.jobs if job.staff_only]
    return TakenShape(
        batch=None if submitted_batch.batch is None else submitted_batch.batch.id,
        queued=submitted_batch.queued,
        copied=submitted_batch.copied,
        known=[KnownShape.model_validate(each) for each in sorted(submitted_batch.known, key=_extract_student)],
        for_staff=[ForStaffShape.model_validate(job) for job in sorted(over_limit, key=_extract_student)],
        refusals=[RefusalShape.model_validate(refusal) for refusal in submitted_batch.refusals],
    )


@router.get("/courses/{course_id}/batches/{batch_id}")
def one_batch(access: ReadAccess, context: Context, batch_id: RowName) -> WholeBatchShape:
    """Return a batch with its progress and statistics."""
    graded_view = views.show_graded(context.service, access.actor, access.course_id, batch_id)
    pace = graded_view.view.pace
    return WholeBatchShape(
        **BatchShape.model_validate(graded_view.view.batch).model_dump(),
        progress=ProgressShape.model_validate(graded_view.view.progress),
        pace=None if pace is None else PaceShape(per_minute=pace.per_minute, left_seconds=pace.left.total_seconds()),
        statistics=[StatisticsShape.model_validate(each) for each in graded_view.statistics],
        unpublished_regrades=graded_view.waiting_regrades,
    )


@router.get("/courses/{course_id}/batches/{batch_id}/grades")
def batch_grades(
    access: ReadAccess, context: Context, batch_id: RowName, limit: Limit = 50, after: After = ""
) -> Listed[JobShape]:
    """List the submissions of a batch by student, each with its current grade or the reason for a missing grade.

    Submissions with hidden names come first, in an order that is independent of the names. For a batch of regrades,
    the grades are the new ones.
    """
    sort_key = decode_cursor(after, str)
    last_id = sort_key[0] if sort_key else None
    lines = views.list_grades(context.service, access.actor, access.course_id, batch_id, limit + 1, last_id)
    page = build_list_page(lines, limit, lambda each: [each.id])
    return Listed(items=[JobShape.model_validate(each) for each in page.items], next=page.next)


@router.post("/courses/{course_id}/batches/{batch_id}/pause")
def pause(access: SubmitAccess, context: Context, batch_id: RowName) -> ControlledShape:
    """Pause a batch: start no more jobs. Running jobs continue."""
    result = operations.pause(context.service, access.actor, access.course_id, batch_id)
    return ControlledShape.model_validate(result)


@router.post("/courses/{course_id}/batches/{batch_id}/resume")
def resume(access: SubmitAccess, context: Context, batch_id: RowName) -> ControlledShape:
    """Resume a paused batch."""
    result = operations.resume(context.service, access.actor, access.course_id, batch_id)
    return ControlledShape.model_validate(result)


@router.post("/courses/{course_id}/batches/{batch_id}/cancel")
def cancel(access: SubmitAccess, context: Context, batch_id: RowName) -> ControlledShape:
    """Cancel all unfinished jobs of a batch. Existing grades are kept."""
    result = operations.cancel(context.service, access.actor, access.course_id, batch_id)
    return ControlledShape.model_validate(result)


@router.post("/courses/{course_id}/batches/{batch_id}/retry")
def retry(access: SubmitAccess, context: Context, batch_id: RowName) -> RetriedShape:
    """Queue the failed jobs of a batch again."""
    return RetriedShape.model_validate(operations.retry(context.service, access.actor, access.course_id, batch_id))


def _extract_student(job: AcceptedSubmission | KnownSubmission) -> str:
    return job.student
