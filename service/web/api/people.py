"""Who is in a course, and what students may do when; links that sign them in are told elsewhere."""

from __future__ import annotations

from dataclasses import asdict
from datetime import datetime
from typing import Annotated

from fastapi import Depends, Path, Query
from fastapi.responses import Response
from pydantic import AfterValidator, AwareDatetime, BaseModel, Field

from service.store import audit
from service.store.courses import open_assignments, policies
from service.store.courses.policies import PolicyLimits
from service.store.courses.versions import check_assignment
from service.store.engine import now
from service.store.grades import own_gradings
from service.store.models import Course
from service.store.people import people
from service.store.people.students import Students
from service.store.states import JobState, Role
from service.web.access import RowNumber, member_in
from service.web.api.shapes import Shape, like
from service.web.api_access import CallerInCourse, in_course
from service.web.api_routes import After, Limit, Listed, api_router, page_of, place_after
from service.web.context import Context
from submissions.people import Student

router = api_router("people")
Reads = Annotated[CallerInCourse, Depends(in_course(Role.INSTRUCTOR, "read"))]
Manages = Annotated[CallerInCourse, Depends(in_course(Role.INSTRUCTOR, "manage"))]


def _of_these_times(moment: datetime) -> datetime:
    if not 2000 <= moment.year < 2200:
        raise ValueError("expected a moment of these centuries")
    return moment


Moment = Annotated[AwareDatetime, AfterValidator(_of_these_times)]


class MemberShape(Shape):
    """Somebody in a course."""

    enrolment: int = Field(validation_alias="enrolment_id", description="What paths call them by.")
    id: str = Field(description="What the course knows them by.")
    name: str
    email: str
    role: Role

    model_config = like(enrolment=7, id="ada", name="Ada Lovelace", email="ada@example.org", role="student")


class GradingShape(Shape):
    """The grade that stands of a submission."""

    job_id: str
    assignment: str
    attempt: int
    state: JobState
    marks: float | None
    max_marks: float | None
    queued_at: datetime
    published_at: datetime | None


class ExtensionShape(Shape):
    """What a student is allowed beyond the policy."""

    assignment: str = Field(description="Empty: every one.")
    due_at: datetime | None
    more_attempts: int

    model_config = like(assignment="shape-recognition", due_at="2026-12-07T17:00:00Z", more_attempts=1)


class StudentShape(MemberShape):
    """A student with their newest submissions."""

    gradings: list[GradingShape] = Field(description="The newest first.")
    some_hidden: bool = Field(description="Whether there are assignments whose submissions are shown without names.")
    extensions: list[ExtensionShape]

    model_config = like(
        enrolment=7,
        id="ada",
        name="Ada Lovelace",
        email="ada@example.org",
        role="student",
        gradings=[],
        some_hidden=False,
        extensions=[],
    )


class StudentAsked(BaseModel):
    """A student to be enrolled, or told anew of."""

    id: str = Field(min_length=1, max_length=200, examples=["ada"])
    name: str = Field("", max_length=200, examples=["Ada Lovelace"])
    email: str = Field("", max_length=200, examples=["ada@example.org"])


class EnrolAsked(BaseModel):
    """Students to be enrolled: all of them, or none."""

    students: list[StudentAsked] = Field(min_length=1, max_length=5000)


class EnrolledShape(Shape):
    """How many were named."""

    students: int

    model_config = like(students=1)


class PolicyShape(Shape):
    """What holds for an assignment, or with an empty one for all that have none of their own."""

    assignment: str = ""
    due_at: Moment | None = Field(None, description="Later it is late.")
    late_days: int = Field(0, ge=0, le=365, description="So many days late is still marked.")
    attempts: int | None = Field(None, ge=1, le=1000, description="Different submissions that are marked.")
    cool_down_seconds: float = Field(0.0, ge=0, le=600_000, description="Between two submissions.")

    model_config = like(assignment="", due_at="2026-11-30T17:00:00Z", late_days=2, attempts=5, cool_down_seconds=600)


class PolicyAsked(PolicyShape):
    """The policy to hold from now on."""

    assignment: str = Field("", max_length=100)


class ExtensionAsked(BaseModel):
    """What one student is allowed beyond the policy, in place of what they were allowed before."""

    assignment: str = Field("", max_length=100, description="Empty: every one.")
    due_at: Moment | None = Field(None, examples=["2026-12-07T17:00:00Z"])
    more_attempts: int = Field(0, ge=0, le=1000)


class LimitsShape(Shape):
    """What one student may do now."""

    due_at: datetime | None
    closed_at: datetime | None = Field(description="After this moment a submission is over the limit.")
    late_days: int
    attempts: int | None
    cool_down_seconds: float

    model_config = like(
        due_at="2026-12-07T17:00:00Z", closed_at="2026-12-09T17:00:00Z", late_days=2, attempts=6, cool_down_seconds=600
    )


@router.get("/courses/{course_id}/people")
def list_people(here: Reads, context: Context, limit: Limit = 50, after: After = "") -> Listed[MemberShape]:
    """Everybody in the course, in the order in which they came in."""
    place = place_after(after, int)
    with context.store.reading() as session:
        found = people.members_after(session, here.course_id, 0 if place is None else place[0], limit + 1)
    return page_of([MemberShape.model_validate(each) for each in found], limit, lambda each: [each.enrolment])


@router.post("/courses/{course_id}/people", status_code=201)
def enrol(here: Manages, context: Context, asked: EnrolAsked) -> EnrolledShape:
    """Enrol students before they submit, or give those who have an id alone their names and addresses."""
    with context.store.transaction() as session:
        at = now(session)
        students = Students(session, session.get_one(Course, here.course_id, with_for_update=True).id)
        for each in asked.students:
            students.enrol(Student(each.id, each.name, each.email), at)
        audit.note(session, here.actor, "enrol", "course", str(here.course_id), students=len(asked.students))
    return EnrolledShape(students=len(asked.students))


@router.get("/courses/{course_id}/people/{enrolment_id}")
def one_student(here: Reads, context: Context, enrolment_id: RowNumber) -> StudentShape:
    """A student, what they submitted as far as names are not hidden, and what they are allowed beyond the policy."""
    with context.store.reading() as session:
        row = member_in(session, here.course_id, enrolment_id, Role.STUDENT)
        hidden = open_assignments.with_names_hidden(session, here.course_id)
        gradings = own_gradings.newest(session, enrolment_id)
        allowed = policies.extensions(session, here.course_id)
        told = {
            "gradings": [each for each in gradings if each.assignment not in hidden],
            "some_hidden": bool(hidden),
            "extensions": [each for each in allowed if each.enrolment_id == row.id],
        }
        return StudentShape.model_validate(asdict(people.member_of(session, row)) | told)


@router.get("/courses/{course_id}/people/{enrolment_id}/limits/{assignment}")
def limits(
    here: Reads,
    context: Context,
    enrolment_id: RowNumber,
    assignment: Annotated[str, Path(min_length=1, max_length=100)],
) -> LimitsShape:
    """What one student may do for an assignment: the policy, and what they are allowed beyond it."""
    with context.store.reading() as session:
        member_in(session, here.course_id, enrolment_id, Role.STUDENT)
        return LimitsShape.model_validate(policies.limits(session, enrolment_id, assignment))


@router.post("/courses/{course_id}/people/{enrolment_id}/extensions", status_code=201)
def extend(here: Manages, context: Context, enrolment_id: RowNumber, asked: ExtensionAsked) -> LimitsShape:
    """Allow one student more time or attempts."""
    with context.store.transaction() as session:
        row = member_in(session, here.course_id, enrolment_id, Role.STUDENT)
        check_assignment(session, asked.assignment)
        policies.extend(session, enrolment_id, asked.assignment, asked.due_at, asked.more_attempts)
        detail = {"student": row.student, **asked.model_dump(mode="json")}
        audit.note(session, here.actor, "extend", "course", str(here.course_id), **detail)
        return LimitsShape.model_validate(policies.limits(session, enrolment_id, asked.assignment))


@router.get("/courses/{course_id}/policies")
def list_policies(here: Reads, context: Context, limit: Limit = 50, after: After = "") -> Listed[PolicyShape]:
    """When and how often students may submit, by assignment."""
    place = place_after(after, str)
    with context.store.reading() as session:
        found = policies.policies(session, here.course_id)
    left = [_policy(name, allowed) for name, allowed in sorted(found.items()) if place is None or name > place[0]]
    return page_of(left[: limit + 1], limit, lambda each: [each.assignment])


@router.put("/courses/{course_id}/policies")
def set_policy(here: Manages, context: Context, asked: PolicyAsked) -> PolicyShape:
    """Set what holds from now on for an assignment, or for all that have no policy of their own."""
    allowed = PolicyLimits(asked.due_at, asked.late_days, asked.attempts, asked.cool_down_seconds)
    with context.store.transaction() as session:
        check_assignment(session, asked.assignment)
        policies.set_policy(session, here.course_id, asked.assignment, allowed)
        detail = asked.model_dump(mode="json")
        audit.note(session, here.actor, "policy", "course", str(here.course_id), **detail)
    return _policy(asked.assignment, allowed)


@router.delete("/courses/{course_id}/policies", status_code=204, response_class=Response)
def drop_policy(
    here: Manages, context: Context, assignment: Annotated[str, Query(min_length=1, max_length=100)]
) -> None:
    """Let an assignment have what holds for all, in place of a policy of its own."""
    with context.store.transaction() as session:
        policies.drop_policy(session, here.course_id, assignment)
        detail = {"assignment": assignment, "dropped": True}
        audit.note(session, here.actor, "policy", "course", str(here.course_id), **detail)


def _policy(assignment: str, allowed: PolicyLimits) -> PolicyShape:
    return PolicyShape(
        assignment=assignment,
        due_at=allowed.due_at,
        late_days=allowed.late_days,
        attempts=allowed.attempts,
        cool_down_seconds=allowed.cool_down_seconds,
    )
