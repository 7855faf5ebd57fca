"""Batches of a course: handed over, watched, held and let go on, their submissions and what these got."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from fastapi import Depends, Query
from pydantic import Field

from service.grading.statistics import statistics_of
from service.store.batches import batches, publishing
from service.store.courses.hidden_names import hidden_names_of
from service.store.grades.marked import marked
from service.store.queue import batch_control, metrics
from service.store.states import Lane, Role
from service.web.access import RowName, batch_in
from service.web.api.shapes import BATCH_EXAMPLE, BatchShape, JobShape, RefusalShape, Shape, like
from service.web.api_access import CallerInCourse, in_course
from service.web.api_routes import After, Limit, Listed, api_router, page_of, place_after
from service.web.api_uploads import ZIP_BODY, Uploaded
from service.web.batch_uploads import upload_batch
from service.web.context import Context, WebContext

router = api_router("batches")
Reads = Annotated[CallerInCourse, Depends(in_course(Role.INSTRUCTOR, "read"))]
Submits = Annotated[CallerInCourse, Depends(in_course(Role.INSTRUCTOR, "submit"))]


class ProgressShape(Shape):
    """How far a batch is."""

    jobs: int
    ended: int
    partial: float = Field(description="What the running ones have done, in jobs.")
    plots_due: int


class PaceShape(Shape):
    """How fast it goes, by the last minutes."""

    per_minute: float
    left_seconds: float


class CriterionStatisticsShape(Shape):
    """What a class got of one criterion."""

    id: str
    title: str
    n: int
    mean_share: float = Field(description="The mean of what was got of its marks, from 0 to 1.")


class CauseShape(Shape):
    """What cost these students marks."""

    sentence: str
    students: list[str]


class StatisticsShape(Shape):
    """What a class got for one assignment."""

    assignment: str
    n: int
    max_marks: float
    mean: float
    spread: float | None
    lowest: float
    median: float
    highest: float
    criteria: list[CriterionStatisticsShape]
    causes: list[CauseShape] = Field(description="The commonest first.")


class WholeBatchShape(BatchShape):
    """A batch with how far it is, and what a class got."""

    progress: ProgressShape
    pace: PaceShape | None
    statistics: list[StatisticsShape]
    unpublished_regrades: int

    model_config = like(
        **BATCH_EXAMPLE,
        progress={"jobs": 20, "ended": 18, "partial": 0.7, "plots_due": 3},
        pace={"per_minute": 60, "left_seconds": 2},
        statistics=[],
        unpublished_regrades=0,
    )


class KnownShape(Shape):
    """A submission that changes nothing: its student has submitted the very same."""

    job_id: str
    batch_id: str | None
    student: str


class ForStaffShape(Shape):
    """A submission that is over a limit: it is marked, and shown to staff alone."""

    job_id: str
    student: str
    staff_only: str


class TakenShape(Shape):
    """What was taken in of an upload, and what was not."""

    batch: str | None = Field(description="None where nothing was new.")
    queued: int
    copied: int = Field(description="Identical to a graded one, and so graded already.")
    known: list[KnownShape]
    for_staff: list[ForStaffShape]
    refusals: list[RefusalShape]

    model_config = like(
        batch="0c5w1r8zt3ye",
        queued=19,
        copied=1,
        known=[],
        for_staff=[],
        refusals=[],
    )


class ControlledShape(Shape):
    """Whether the batch changed, and how many of its jobs waited and ran then."""

    changed: bool
    waiting: int
    running: int

    model_config = like(changed=True, waiting=12, running=2)


class RetriedShape(Shape):
    """How many dead jobs wait again, and how many stay dead because their student submitted anew."""

    queued: int
    outdated: int

    model_config = like(queued=2, outdated=0)


@router.get("/courses/{course_id}/batches")
def list_batches(here: Reads, context: Context, limit: Limit = 50, after: After = "") -> Listed[BatchShape]:
    """The batches of the course, the newest first."""
    place = place_after(after, datetime, str)
    with context.store.reading() as session:
        found = batches.batches_of(session, here.course_id, limit + 1, (place[0], place[1]) if place else None)
    shown = [BatchShape.model_validate(line) for line in found]
    return page_of(shown, limit, lambda each: [each.created_at, each.id])


@router.post("/courses/{course_id}/batches", status_code=201, openapi_extra=ZIP_BODY)
def submit_batch(
    here: Submits,
    context: Context,
    upload: Uploaded,
    name: Annotated[str, Query(min_length=1, max_length=200, description="What the batch is called.")] = "upload",
    assignment: Annotated[
        str, Query(max_length=100, description="An assignment of the course or catalogue; else each names its own.")
    ] = "",
    again: Annotated[bool, Query(description="Grade again what was submitted already.")] = False,
) -> TakenShape:
    """Hand over a zip with a submission for each student, as `robomark batch submit` takes it."""
    taken = upload_batch(context, here.course_id, upload, name, assignment, again=again)
    jobs = () if taken.accepted.batch is None else taken.accepted.batch.jobs
    return TakenShape(
        batch=None if taken.accepted.batch is None else taken.accepted.batch.id,
        queued=sum(job.copied_from is None for job in jobs),
        copied=sum(job.copied_from is not None for job in jobs),
        known=[KnownShape.model_validate(known) for known in taken.accepted.known],
        for_staff=[ForStaffShape.model_validate(job) for job in jobs if job.staff_only],
        refusals=[RefusalShape.model_validate(refusal) for refusal in taken.refusals],
    )


@router.get("/courses/{course_id}/batches/{batch_id}")
def one_batch(here: Reads, context: Context, batch_id: RowName) -> WholeBatchShape:
    """How far a batch is, and what a class got."""
    hidden = hidden_names_of(context.store, here.course_id)
    with context.store.reading() as session:
        batch_in(session, here.course_id, batch_id)
        line = batches.batch(session, batch_id)
        pace = metrics.pace(session, batch_id)
        lines = [each.hidden_by(hidden) for each in batches.job_lines(session, batch_id)]
        statistics = statistics_of(marked(session, lines))
        return WholeBatchShape(
            **BatchShape.model_validate(line).model_dump(),
            progress=ProgressShape.model_validate(batches.progress(session, batch_id)),
            pace=None
            if pace is None
            else PaceShape(per_minute=pace.per_minute, left_seconds=pace.left.total_seconds()),
            statistics=[StatisticsShape.model_validate(each) for each in statistics],
            unpublished_regrades=0 if line.regrade_of else publishing.unpublished_regrades(session, batch_id),
        )


@router.get("/courses/{course_id}/batches/{batch_id}/grades")
def batch_grades(
    here: Reads, context: Context, batch_id: RowName, limit: Limit = 50, after: After = ""
) -> Listed[JobShape]:
    """The submissions of a batch, each with the grade that stands or why it has none: by student, or in no order.

    Their order tells nothing where names are hidden.
    """
    place = place_after(after, str)
    hidden = hidden_names_of(context.store, here.course_id)
    with context.store.reading() as session:
        batch_in(session, here.course_id, batch_id)
        found = batches.some_job_lines(session, batch_id, hidden, limit + 1, place[0] if place else None)
    page = page_of(found, limit, lambda each: [each.id])
    return Listed(items=[JobShape.model_validate(each) for each in page.items], next=page.next)


@router.post("/courses/{course_id}/batches/{batch_id}/pause")
def pause(here: Submits, context: Context, batch_id: RowName) -> ControlledShape:
    """Begin no more of a batch; what runs goes on."""
    _look_for(context, here, batch_id)
    return ControlledShape.model_validate(batch_control.pause(context.store, batch_id, actor=here.actor))


@router.post("/courses/{course_id}/batches/{batch_id}/resume")
def resume(here: Submits, context: Context, batch_id: RowName) -> ControlledShape:
    """Let a paused batch go on."""
    _look_for(context, here, batch_id)
    return ControlledShape.model_validate(batch_control.resume(context.store, batch_id, actor=here.actor))


@router.post("/courses/{course_id}/batches/{batch_id}/cancel")
def cancel(here: Submits, context: Context, batch_id: RowName) -> ControlledShape:
    """End what of a batch is not graded yet; marks that are there stay."""
    _look_for(context, here, batch_id)
    return ControlledShape.model_validate(batch_control.cancel(context.store, batch_id, actor=here.actor))


@router.post("/courses/{course_id}/batches/{batch_id}/retry")
def retry(here: Submits, context: Context, batch_id: RowName) -> RetriedShape:
    """Queue again what of a batch could not be graded."""
    _look_for(context, here, batch_id)
    retried = batch_control.retry(context.store, batch_id, actor=here.actor)
    context.notifier.grade(Lane.BATCH, retried.queued)
    return RetriedShape.model_validate(retried)


def _look_for(context: WebContext, here: CallerInCourse, batch_id: str) -> None:
    with context.store.reading() as session:
        batch_in(session, here.course_id, batch_id)
