"""API of a batch's overview: a check before submitting, the results, and a preview of publishing."""

from __future__ import annotations

from dataclasses import asdict
from decimal import Decimal
from typing import Annotated, Literal

from fastapi import Depends, Query
from pydantic import Field

from service.grading.class_statistics import PASS_SHARE
from service.operations import batch_views, regrades
from service.operations.batches import preview_submissions
from service.operations.types import Role
from service.web.access import RowName
from service.web.api.batches import StatisticsShape
from service.web.api.regrades import PublishedShape
from service.web.api.shapes import BATCH_EXAMPLE, RefusalShape, Shape, build_example_config, find_example
from service.web.api_access import CallerInCourse, require_role
from service.web.api_routes import NO_KEY, api_router
from service.web.api_uploads import MAX_BATCH_BYTES, ZIP_BODY, UploadedZip
from service.web.batch_uploads import read_upload
from service.web.context import Context
from service.web.request_bodies import takes_upload

router = api_router("batches")
ReadAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "read"))]
SubmitAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "submit"))]


class ExpectedShape(Shape):
    """A submission that would be accepted."""

    student: str
    name: str
    source: str = Field(description="Name of the submitted file or folder.")
    assignment: str
    enrolled: bool = Field(description="Whether the student is already enrolled.")
    known: bool = Field(description="Whether it was submitted before and would stay unchanged.")
    copied: bool = Field(description="Whether an identical submission is graded; it would get the same grade.")


class PreflightShape(Shape):
    """The submissions of a zip that would be accepted or rejected, with reasons."""

    submissions: list[ExpectedShape]
    refusals: list[RefusalShape]

    model_config = build_example_config(
        submissions=[
            {
                "student": "ada",
                "name": "Ada Lovelace",
                "source": "ada",
                "assignment": "shape-recognition",
                "enrolled": True,
                "known": False,
                "copied": False,
            }
        ],
        refusals=BATCH_EXAMPLE["refusals"],
    )


class BinShape(Shape):
    """Number of students with marks from `low` to below `high`. The last bin includes full marks."""

    low: float
    high: float
    count: int


class OutlierShape(Shape):
    """A grade that needs review, with the reason."""

    id: str
    why: Literal["low", "slow", "close"]


class MissingShape(Shape):
    """A student of the course without a submission for the assignment."""

    id: str
    name: str


class CriterionQualityShape(Shape):
    """Figures of a criterion, with bootstrap intervals of 95 % from low to high."""

    id: str
    title: str
    facility: float = Field(description="Mean fraction of the criterion's marks, from 0 to 1.")
    facility_interval: tuple[float, float]
    discrimination: float | None = Field(description="Correlation with the total of the other criteria.")
    discrimination_interval: tuple[float, float] | None
    intended_weight: float = Field(description="The criterion's fraction of all marks.")
    effective_weight: float | None = Field(
        description="Its fraction of the spread of the total, as in Moodle's quiz statistics."
    )
    effective_weight_interval: tuple[float, float] | None


class QualityFindingShape(Shape):
    """A reason to look at the assignment again, with the ids of the affected criteria."""

    kind: Literal["all-full", "all-lost", "discrimination", "agreement", "weight", "overfit"]
    criteria: list[str]
    sentence: str


class HiddenSharesShape(Shape):
    """Mean fractions of the marks, and the submissions that have all visible and less than half of the hidden marks."""

    visible: float
    hidden: float = Field(description="In criteria with hidden trials.")
    overfitted: int


class QualityShape(Shape):
    """How well the assignment measures. With fewer than 10 submissions, there is only a note."""

    n: int
    criteria: list[CriterionQualityShape]
    findings: list[QualityFindingShape]
    hidden_shares: HiddenSharesShape | None
    note: str


class ClassShape(Shape):
    """The results of a batch for one assignment."""

    statistics: StatisticsShape
    quality: QualityShape
    distribution: list[BinShape]
    passed: int = Field(description="Number of students who reach the pass mark.")
    outliers: list[OutlierShape]
    identical: list[list[str]] = Field(description="Groups of students with identical submissions.")
    missing: list[MissingShape]


class OverviewShape(Shape):
    """The results of a batch, by assignment; empty until the first grade."""

    classes: list[ClassShape]

    model_config = build_example_config(classes=[])


class PublicationShape(Shape):
    """The effect of publishing a batch now, with the number of students whose grades would be released."""

    counts: PublishedShape
    students: int
    completion_seconds: float = Field(description="Estimated CPU time after which provisional grades are exact.")

    model_config = build_example_config(counts=find_example(PublishedShape), students=19, completion_seconds=0.0)


@router.post("/courses/{course_id}/batches/preflight", openapi_extra=ZIP_BODY | dict(NO_KEY))
@takes_upload(MAX_BATCH_BYTES, Role.INSTRUCTOR)
def look_first(
    access: SubmitAccess,
    context: Context,
    upload: UploadedZip,
    assignment: Annotated[
        str,
        Query(
            max_length=100,
            description="An assignment of the course or catalogue; if empty, each submission names its assignment.",
        ),
    ] = "",
) -> PreflightShape:
    """Check a zip with a submission for each student, without submitting it."""
    contents = read_upload(context, access.actor, access.course_id, upload, assignment)
    return PreflightShape(
        submissions=[
            ExpectedShape(
                student=each.request.submission.student,
                name=each.request.student.name,
                source=each.request.source,
                assignment=each.request.assignment.id,
                **asdict(each.intake_preview),
            )
            for each in preview_submissions(context.service, access.actor, access.course_id, contents)
        ],
        refusals=[RefusalShape.model_validate(refusal) for refusal in contents.refusals],
    )


@router.get("/courses/{course_id}/batches/{batch_id}/overview")
def show_overview(
    access: ReadAccess,
    context: Context,
    batch_id: RowName,
    at_least: Annotated[
        int, Query(alias="pass", ge=0, le=100, description="Pass mark, in per cent of all marks.")
    ] = int(PASS_SHARE * 100),
) -> OverviewShape:
    """Return statistics of a batch: marks, criteria, causes of lost marks, outliers and missing submissions."""
    overview = batch_views.show_overview(
        context.service, access.actor, access.course_id, batch_id, Decimal(at_least) / 100
    )
    return OverviewShape(
        classes=[
            ClassShape(
                statistics=StatisticsShape.model_validate(each.statistics),
                quality=QualityShape.model_validate(each.quality),
                distribution=[BinShape.model_validate(bin_) for bin_ in each.distribution],
                passed=each.passed,
                outliers=[OutlierShape.model_validate(outlier) for outlier in each.outliers],
                identical=[[line.student for line in same] for same in each.identical],
                missing=[MissingShape.model_validate(student) for student in each.missing],
            )
            for each in overview.classes
        ]
    )


@router.get("/courses/{course_id}/batches/{batch_id}/publish")
def would_publish(access: ReadAccess, context: Context, batch_id: RowName) -> PublicationShape:
    """Return the effect of publishing the batch now, without publishing it."""
    publication_counts = regrades.preview_publication(context.service, access.actor, access.course_id, batch_id)
    return PublicationShape.model_validate(publication_counts)
