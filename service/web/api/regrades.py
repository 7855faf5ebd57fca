"""API of regrades: grade a batch again, compare, publish and export the grades."""

from __future__ import annotations

from decimal import Decimal
from typing import Annotated, Any, Literal

from fastapi import Depends, Query, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException

from service.grading.class_statistics import PASS_SHARE
from service.operations import regrades as operations
from service.operations.exports import ExportRequest, download
from service.operations.moderation import download_sheet
from service.operations.types import ChangeStage, JobState, Role, Standing
from service.reports.formats import FORMATS
from service.web.access import RowName
from service.web.api.shapes import Shape, build_example_config
from service.web.api_access import CallerInCourse, require_role
from service.web.api_routes import NO_KEY, After, Limit, Listed, api_router, build_list_page, decode_cursor
from service.web.api_uploads import MAX_TABLE_BYTES
from service.web.attachments import respond_with_attachment
from service.web.context import EXPORT_IN_PROGRESS, Context, WebContext, hold_slot
from service.web.request_bodies import takes_upload

router = api_router("batches")
ReadAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "read"))]
MarkAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "mark"))]
_FILE_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {"description": "The file.", "content": {"*/*": {"schema": {"type": "string", "format": "binary"}}}}
}
_CSV_BODY = {"requestBody": {"required": True, "content": {"text/csv": {"schema": {"type": "string"}}}}, **NO_KEY}
FormatName = Annotated[
    str, Query(alias="format", max_length=40, description=f"One of {', '.join(sorted(FORMATS))}.", examples=["csv"])
]
PassMark = Annotated[int, Query(alias="pass", ge=0, le=100, description="Pass mark, in per cent of all marks.")]
DEFAULT_PASS_MARK = int(PASS_SHARE * 100)
PublishedOnly = Annotated[bool, Query(description="Export only published grades.")]


class RegradeBody(BaseModel):
    """Options for grading a batch again."""

    assignment: str = Field(
        "",
        max_length=100,
        description="Use the current version of this assignment; if empty, use the version of each earlier grade.",
        examples=["shape-recognition"],
    )


class RegradedShape(Shape):
    """A batch of regrades, with the numbers of omitted submissions: other assignment, or not graded yet."""

    batch_id: str
    jobs: int
    other_assignment: int
    unfinished: int

    model_config = build_example_config(batch_id="4pd83mzs7k1h", jobs=20, other_assignment=0, unfinished=0)


class RegradedOneShape(Shape):
    """The job that grades a submission again."""

    job: str

    model_config = build_example_config(job="4pd83mzs7k1h")


class CriterionChangeShape(Shape):
    """A criterion whose marks differ, as [marks, maximum]. Null if that version of the assignment does not have it."""

    title: str
    before: tuple[float, float] | None
    after: tuple[float, float] | None
    by_hand: bool = Field(description="Whether staff adjustments replace the new marks.")
    stages: list[ChangeStage] = Field(
        description="What changed the marks. With several stages, the stored data does not tell them apart."
    )
    crosses: bool = Field(description="Whether full marks are gained or lost, or another band is reached.")


class ChangeShape(Shape):
    """A regrade, compared with the grade that it would replace."""

    student: str
    job_id: str
    before_id: str
    state: JobState
    standing: Standing
    before: float | None
    after: float | None
    before_max: float | None
    after_max: float | None
    differs: bool
    criteria: list[CriterionChangeShape]
    reason: str
    stages: list[ChangeStage] = Field(description="The stages of all criteria.")
    changed_parts: list[str] = Field(
        description="Parts of the assignment that differ, such as `world` or `scenarios`, if they changed marks."
    )
    crosses: Literal["up", "down"] | None = Field(
        description="Whether the marks are now at or above the pass mark (`up`), or below it (`down`)."
    )

    model_config = build_example_config(
        student="ada",
        job_id="7xk2v9q4m0ab",
        before_id="9c0e2b7h5rtw",
        state="done",
        standing="proposed",
        before=10,
        after=12,
        before_max=12,
        after_max=12,
        differs=True,
        criteria=[
            {
                "title": "Names the shapes",
                "before": [4, 6],
                "after": [6, 6],
                "by_hand": False,
                "stages": ["criteria"],
                "crosses": True,
            }
        ],
        reason="criteria changed",
        stages=["criteria"],
        changed_parts=[],
        crosses=None,
    )


class ChangesSummaryShape(Shape):
    """Numbers of regrades: by change of marks, by stage, and by boundary that they cross.

    A regrade with several stages counts for each of them.
    """

    regrades: int
    higher: int
    lower: int
    same: int
    first_grades: int = Field(description="Submissions that could not be graded before.")
    ungraded: int = Field(description="Regrades without a grade: not finished, failed or cancelled.")
    stages: dict[ChangeStage, int]
    crossing_up: int = Field(description="Regrades with marks that are now at or above the pass mark.")
    crossing_down: int = Field(description="Regrades with marks that are now below the pass mark.")
    crossing_criteria: int = Field(
        description="Regrades with a criterion that gains or loses full marks, or reaches another band."
    )

    model_config = build_example_config(
        regrades=20,
        higher=6,
        lower=1,
        same=13,
        first_grades=0,
        ungraded=0,
        stages={"criteria": 7},
        crossing_up=1,
        crossing_down=0,
        crossing_criteria=7,
    )


class PublishBody(BaseModel):
    """Options for publishing grades."""

    anyway: bool = Field(
        False,
        description="Also publish provisional grades, and grades with a criterion that could not be judged.",
    )


class PublishedShape(Shape):
    """Numbers of newly published grades, of replaced grades, and of omitted grades by reason."""

    published: int
    replaced: int
    unfinished: int
    dead: int
    staff_only: int
    unjudged: int
    provisional: int

    model_config = build_example_config(
        published=19, replaced=0, unfinished=0, dead=1, staff_only=0, unjudged=0, provisional=0
    )


@router.post("/courses/{course_id}/batches/{batch_id}/regrades", status_code=201)
def regrade(access: MarkAccess, context: Context, batch_id: RowName, body: RegradeBody | None = None) -> RegradedShape:
    """Grade a batch again. The old grades apply until you publish the new ones."""
    name = "" if body is None else body.assignment
    regrade_batch = operations.regrade_batch(context.service, access.actor, access.course_id, batch_id, name)
    return RegradedShape.model_validate(regrade_batch)


@router.get("/courses/{course_id}/batches/{batch_id}/changes")
def changes(
    access: ReadAccess,
    context: Context,
    batch_id: RowName,
    limit: Limit = 50,
    after: After = "",
    pass_mark: PassMark = DEFAULT_PASS_MARK,
) -> Listed[ChangeShape]:
    """List the changes of a batch of regrades, by student; empty for other batches."""
    sort_key = decode_cursor(after, str)
    pass_share = Decimal(pass_mark) / 100
    all_changes = operations.list_changes(context.service, access.actor, access.course_id, batch_id, pass_share)
    job_ids = [each.job_id for each in all_changes]
    start = 0 if sort_key is None else job_ids.index(sort_key[0]) + 1 if sort_key[0] in job_ids else len(job_ids)
    page = build_list_page(all_changes[start : start + limit + 1], limit, lambda each: [each.job_id])
    return Listed(items=[ChangeShape.model_validate(each) for each in page.items], next=page.next)


@router.get("/courses/{course_id}/batches/{batch_id}/changes/summary")
def summarise_changes(
    access: ReadAccess, context: Context, batch_id: RowName, pass_mark: PassMark = DEFAULT_PASS_MARK
) -> ChangesSummaryShape:
    """Return the numbers of changes of a batch of regrades; zeros for other batches."""
    pass_share = Decimal(pass_mark) / 100
    summary = operations.show_changes_summary(context.service, access.actor, access.course_id, batch_id, pass_share)
    return ChangesSummaryShape.model_validate(summary)


@router.post("/courses/{course_id}/batches/{batch_id}/publish")
def publish(access: MarkAccess, context: Context, batch_id: RowName, body: PublishBody | None = None) -> PublishedShape:
    """Publish the newest grades of a batch. They become the current grades, and students can see them."""
    includes_held_back = body is not None and body.anyway
    publication_counts = operations.publish(
        context.service, access.actor, access.course_id, batch_id, includes_held_back=includes_held_back
    )
    return PublishedShape.model_validate(publication_counts)


@router.post("/courses/{course_id}/grades/{job_id}/publish")
def publish_one(
    access: MarkAccess, context: Context, job_id: RowName, body: PublishBody | None = None
) -> PublishedShape:
    """Publish the newest grade of a submission. It becomes the current grade, and the student can see it."""
    includes_held_back = body is not None and body.anyway
    publication_counts = operations.publish_one(
        context.service, access.actor, access.course_id, job_id, includes_held_back=includes_held_back
    )
    return PublishedShape.model_validate(publication_counts)


@router.post("/courses/{course_id}/grades/{job_id}/regrades", status_code=201)
def regrade_one(
    access: MarkAccess, context: Context, job_id: RowName, body: RegradeBody | None = None
) -> RegradedOneShape:
    """Grade a submission again. The old grade applies until you publish the new one."""
    name = "" if body is None else body.assignment
    return RegradedOneShape(job=operations.regrade_one(context.service, access.actor, access.course_id, job_id, name))


@router.post("/courses/{course_id}/grades/{job_id}/over-limit", status_code=204)
def grade_over_limit(access: MarkAccess, context: Context, job_id: RowName) -> None:
    """Grade a submission that was not graded because it exceeds a limit."""
    operations.grade_over_limit(context.service, access.actor, access.course_id, job_id)


@router.get("/courses/{course_id}/batches/{batch_id}/export", responses=_FILE_RESPONSES, response_class=Response)
def export(
    access: ReadAccess, context: Context, batch_id: RowName, form: FormatName = "csv", published: PublishedOnly = False
) -> Response:
    """Export the grades of a batch in a format of `robomark batch export`.

    Formats that are not tables return a zip with one file for each grade.
    """
    return _respond_with_export(context, access, batch_id, ExportRequest(form, published))


@router.post(
    "/courses/{course_id}/batches/{batch_id}/worksheet",
    responses=_FILE_RESPONSES,
    response_class=Response,
    openapi_extra=_CSV_BODY,
)
@takes_upload(MAX_TABLE_BYTES, Role.INSTRUCTOR)
async def worksheet(
    request: Request, access: ReadAccess, context: Context, batch_id: RowName, published: PublishedOnly = False
) -> Response:
    """Return the uploaded Moodle grading worksheet with the grades filled in. Stored data does not change."""
    content = await request.body()
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError:
        raise HTTPException(422, "The worksheet is not in UTF-8; upload the original file from Moodle.") from None
    export_request = ExportRequest("moodle-worksheet", published, text)
    return await run_in_threadpool(_respond_with_export, context, access, batch_id, export_request)


@router.get("/courses/{course_id}/batches/{batch_id}/moderation", responses=_FILE_RESPONSES, response_class=Response)
def moderation(
    access: ReadAccess,
    context: Context,
    batch_id: RowName,
    assignment: Annotated[
        str, Query(max_length=100, description="An assignment of the batch; needed if it has several.")
    ] = "",
) -> Response:
    """Return the moderation sheet of an assignment in the batch as an HTML page, for external examiners.

    It contains the task, statistics, marks, adjusted marks, appeals and versions. Hidden names stay hidden.
    """
    with hold_slot(context.batch_exports.get_slot(access.actor.person_id), EXPORT_IN_PROGRESS):
        sheet = download_sheet(context.service, access.actor, access.course_id, batch_id, assignment)
    return respond_with_attachment(sheet.data, sheet.name, sheet.media_type)


def _respond_with_export(
    context: WebContext, access: CallerInCourse, batch_id: str, export_request: ExportRequest
) -> Response:
    with hold_slot(context.batch_exports.get_slot(access.actor.person_id), EXPORT_IN_PROGRESS):
        exported = download(context.service, access.actor, access.course_id, batch_id, export_request)
    return respond_with_attachment(exported.data, exported.name, exported.media_type)
