"""API for operators: queues, workers, failed jobs and courses."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from fastapi import Depends
from pydantic import BaseModel, Field

from service.operations import batches, courses, system
from service.operations.courses import MemberRequest
from service.operations.types import JobQueue, JobState
from service.web.api.batches import RetriedShape
from service.web.api.shapes import Shape, build_example_config, find_example
from service.web.api.sign_in_links import LinkShape, to_link_shape
from service.web.api_access import Caller, require_operator
from service.web.api_routes import NO_KEY, After, Limit, Listed, api_router, build_list_page, decode_cursor
from service.web.context import Context

router = api_router("operator")
ReadAccess = Annotated[Caller, Depends(require_operator("read"))]
ManageAccess = Annotated[Caller, Depends(require_operator("manage"))]


class LaneShape(Shape):
    """Load of a job queue: numbers of queued and running jobs."""

    lane: JobQueue
    queued: int
    running: int
    oldest_seconds: float = Field(description="Waiting time of the oldest job that a worker can claim, in seconds.")


class TestRunQueueShape(Shape):
    """Load of the test run queue."""

    queued: int
    running: int
    oldest_seconds: float = Field(description="Waiting time of the oldest queued test run, in seconds.")


class FindingShape(Shape):
    """Result of one system check."""

    what: str
    well: bool
    sentence: str


class ServiceShape(Shape):
    """System status: version, queues, results of the system checks, and numbers of failures."""

    version: str
    ready: bool
    lanes: list[LaneShape]
    findings: list[FindingShape]
    tryouts: TestRunQueueShape
    dead: int = Field(description="Number of failed jobs.")
    host_faults: int = Field(description="Number of grading attempts that failed because of the system, for all jobs.")
    paused_batches: int

    model_config = build_example_config(
        version="0.3.0",
        ready=True,
        lanes=[{"lane": "batch", "queued": 12, "running": 2, "oldest_seconds": 3.5}],
        findings=[{"what": "database", "well": True, "sentence": "answers"}],
        tryouts={"queued": 0, "running": 1, "oldest_seconds": 0.0},
        dead=0,
        host_faults=0,
        paused_batches=0,
    )


class WorkerShape(Shape):
    """A worker, with its version, sandbox and problems."""

    name: str
    host: str
    concurrency: int
    grader_version: str
    sandbox: str
    started_at: datetime
    seen_at: datetime
    lately: bool = Field(description="Whether it reported recently.")
    quarantine: str | None = Field(
        description="The self-test failure that stopped it from grading; null if there is none."
    )
    problem: str = Field(description="Reason for a required restart; empty if there is no problem.")

    model_config = build_example_config(
        name="worker@host",
        host="host",
        concurrency=2,
        grader_version="0.3.0",
        sandbox="user namespace, Landlock, seccomp",
        started_at="2026-11-02T09:00:00Z",
        seen_at="2026-11-02T10:00:00Z",
        lately=True,
        quarantine=None,
        problem="",
    )


class DeadShape(Shape):
    """A failed job."""

    job_id: str
    course: str
    batch_id: str | None
    lane: JobQueue
    error: str
    attempts: int
    worker: str
    finished_at: datetime | None

    model_config = build_example_config(
        job_id="7xk2v9q4m0ab",
        course="TM129",
        batch_id="0c5w1r8zt3ye",
        lane="batch",
        error="Tried 3 times, the last time: the disk is full",
        attempts=3,
        worker="worker@host",
        finished_at="2026-11-02T09:10:00Z",
    )


class RetryBody(BaseModel):
    """Selection of failed jobs to queue again."""

    batch_id: str | None = Field(None, max_length=32, pattern="^[0-9a-z]+$", description="Null for all batches.")


class NamedCourseShape(Shape):
    """A course of the installation, with its numbers of instructors and students."""

    id: int
    name: str
    instructors: int
    students: int

    model_config = build_example_config(id=1, name="TM129", instructors=2, students=180)


class InstructorBody(BaseModel):
    """A new instructor of a course. A missing course is created."""

    course: str = Field(min_length=1, max_length=100, pattern=r"\S", examples=["TM129"])
    id: str = Field(min_length=1, max_length=100, pattern=r"\S", examples=["grace"])
    name: str = Field("", max_length=200, examples=["Grace Hopper"])


class SameIdShape(Shape):
    """An instructor of another course with the same id."""

    course: str
    enrolment: int
    name: str

    model_config = build_example_config(course="TM111", enrolment=4, name="Grace Hopper")


class NewInstructorShape(Shape):
    """An instructor, and their sign-in link, which is returned only once."""

    id: str
    course: int
    enrolment: int
    link: LinkShape
    elsewhere: list[SameIdShape] = Field(
        description="Other persons with the same ID, until an operator joins them with this person."
    )

    model_config = build_example_config(id="grace", course=1, enrolment=9, link=find_example(LinkShape), elsewhere=[])


@router.get("/operator")
def service(operator: ReadAccess, context: Context) -> ServiceShape:
    """Return the system status: queue lengths and the results of the system checks."""
    view = system.show(context.service, operator.actor)
    metrics = view.metrics
    return ServiceShape(
        version=view.version,
        ready=all(finding.well for finding in view.findings),
        lanes=[
            LaneShape(
                lane=lane,
                queued=metrics.queue.jobs.get((lane, JobState.QUEUED), 0),
                running=metrics.queue.jobs.get((lane, JobState.RUNNING), 0),
                oldest_seconds=metrics.queue.oldest_seconds.get(lane, 0.0),
            )
            for lane in JobQueue
        ],
        findings=[FindingShape.model_validate(finding) for finding in view.findings],
        tryouts=TestRunQueueShape.model_validate(view.test_runs),
        dead=view.failed_count,
        host_faults=metrics.host_faults,
        paused_batches=metrics.paused_batches,
    )


@router.get("/operator/workers")
def list_workers(operator: ReadAccess, context: Context, limit: Limit = 50, after: After = "") -> Listed[WorkerShape]:
    """List the workers, by name."""
    sort_key = decode_cursor(after, str)
    shapes = [
        WorkerShape(
            name=each.worker.name,
            host=each.worker.host,
            concurrency=each.worker.concurrency,
            grader_version=each.worker.grader_version,
            sandbox=each.worker.sandbox,
            started_at=each.started_at,
            seen_at=each.seen_at,
            lately=each.lately,
            quarantine=None if quarantine is None else quarantine.reason,
            problem=each.worker.problem,
        )
        for each, quarantine in system.list_workers(context.service, operator.actor)
        if sort_key is None or each.worker.name > sort_key[0]
    ]
    return build_list_page(shapes[: limit + 1], limit, lambda each: [each.name])


@router.get("/operator/courses")
def list_courses(operator: ReadAccess, context: Context) -> Listed[NamedCourseShape]:
    """List all courses, by name."""
    lines = courses.list_courses(context.service, operator.actor)
    return Listed(items=[NamedCourseShape.model_validate(each) for each in lines])


@router.post("/operator/courses", status_code=201, openapi_extra=dict(NO_KEY))
def add_instructor(operator: ManageAccess, context: Context, body: InstructorBody) -> NewInstructorShape:
    """Add an instructor to a course and return a single-use sign-in link. Creates the course if it does not exist."""
    request = MemberRequest(body.course, body.id, body.name)
    added_member = courses.add_member(context.service, operator.actor, request)
    return NewInstructorShape(
        id=added_member.member.id,
        course=added_member.member.course_id,
        enrolment=added_member.member.enrolment_id,
        link=to_link_shape(context, added_member.secret),
        elsewhere=[
            SameIdShape(course=name, enrolment=each.enrolment_id, name=each.name)
            for name, each in added_member.elsewhere
        ],
    )


@router.get("/operator/dead")
def list_dead(operator: ReadAccess, context: Context) -> Listed[DeadShape]:
    """List the newest failed jobs of all courses."""
    failed_jobs = system.list_failed(context.service, operator.actor)
    return Listed(items=[DeadShape.model_validate(each) for each in failed_jobs])


@router.post("/operator/retry")
def retry(operator: ManageAccess, context: Context, body: RetryBody | None = None) -> RetriedShape:
    """Queue the failed jobs of one batch or of all batches again."""
    batch_id = None if body is None else body.batch_id
    return RetriedShape.model_validate(batches.retry_dead(context.service, operator.actor, batch_id))
