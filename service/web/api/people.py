"""API of a course's people, policies and extensions. ``sign_in_links.py`` contains their sign-in links."""

from __future__ import annotations

from dataclasses import asdict
from datetime import datetime
from typing import Annotated

from fastapi import Depends, Path, Query
from fastapi.responses import Response
from pydantic import AfterValidator, AwareDatetime, BaseModel, Field

from service.operations import people, people_views, policies
from service.operations.policies import ExtensionRequest, PolicyLimits
from service.operations.types import CompletionRule, CountedAttempt, JobState, ReleaseRule, Role
from service.web.access import RowNumber
from service.web.api.shapes import Shape, build_example_config
from service.web.api_access import CallerInCourse, require_role
from service.web.api_routes import After, Limit, Listed, api_router, build_list_page, decode_cursor
from service.web.context import Context
from submissions.student_identity import MAX_PEOPLE, Student

router = api_router("people")
ReadAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "read"))]
ManageAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "manage"))]


def _check_year(moment: datetime) -> datetime:
    if not 2000 <= moment.year < 2200:
        raise ValueError("expected a moment of these centuries")
    return moment


Moment = Annotated[AwareDatetime, AfterValidator(_check_year)]


class MemberShape(Shape):
    """A member of a course."""

    enrolment: int = Field(validation_alias="enrolment_id", description="ID for use in paths.")
    id: str = Field(description="ID in the course.")
    name: str
    email: str
    role: Role

    model_config = build_example_config(
        enrolment=7, id="ada", name="Ada Lovelace", email="ada@example.org", role="student"
    )


class GradingShape(Shape):
    """The current grade of a submission."""

    job_id: str
    assignment: str
    attempt: int
    state: JobState
    marks: float | None
    max_marks: float | None
    queued_at: datetime
    published_at: datetime | None


class ExtensionShape(Shape):
    """An extension of the policy for one student."""

    assignment: str = Field(description="Empty for all assignments.")
    due_at: datetime | None
    more_attempts: int

    model_config = build_example_config(assignment="shape-recognition", due_at="2026-12-07T17:00:00Z", more_attempts=1)


class StudentShape(MemberShape):
    """A student with their newest submissions."""

    gradings: list[GradingShape] = Field(description="Newest first.")
    some_hidden: bool = Field(description="Whether the course has assignments with hidden names.")
    extensions: list[ExtensionShape]

    model_config = build_example_config(
        enrolment=7,
        id="ada",
        name="Ada Lovelace",
        email="ada@example.org",
        role="student",
        gradings=[],
        some_hidden=False,
        extensions=[],
    )


class StudentBody(BaseModel):
    """A student to enrol, or an enrolled student whose name or e-mail address is to be updated."""

    id: str = Field(min_length=1, max_length=200, examples=["ada"])
    name: str = Field("", max_length=200, examples=["Ada Lovelace"])
    email: str = Field("", max_length=200, examples=["ada@example.org"])


class EnrolBody(BaseModel):
    """Students to enrol. If one of them is invalid, none is enrolled."""

    students: list[StudentBody] = Field(min_length=1, max_length=MAX_PEOPLE)


class EnrolledShape(Shape):
    """Number of students in the request."""

    students: int

    model_config = build_example_config(students=1)


class PolicyShape(Shape):
    """The policy of an assignment, or, with an empty assignment, the default policy of the course."""

    assignment: str = ""
    due_at: Moment | None = Field(None, description="Deadline; later submissions are late. Null for no deadline.")
    late_days: int = Field(0, ge=0, le=365, description="Number of days for which late submissions are accepted.")
    attempts: int | None = Field(
        None, ge=1, le=1000, description="Maximum number of different submissions; null for no limit."
    )
    cool_down_seconds: float = Field(0.0, ge=0, le=600_000, description="Minimum time between submissions, in seconds.")
    release: ReleaseRule = Field(
        ReleaseRule.OWN_AT_ONCE,
        description="When students see grades: `at-once`; `published`; or `own-at-once`, their own submissions at once "
        "and uploads of staff when published.",
    )
    released_at: Moment | None = Field(None, description="Students see all grades from this moment on. Null for none.")

    model_config = build_example_config(
        assignment="",
        due_at="2026-11-30T17:00:00Z",
        late_days=2,
        attempts=5,
        cool_down_seconds=600,
        release="published",
        released_at="2026-12-14T09:00:00Z",
    )


class CountedAttemptShape(Shape):
    """The rule of a course for the attempt that counts, among a student's graded attempts within the limits."""

    counted_attempt: CountedAttempt = Field(
        description="`latest`, or `best`: the highest share of the maximum marks, and the latest of several."
    )

    model_config = build_example_config(counted_attempt="best")


class CountedAttemptBody(CountedAttemptShape):
    """The new rule for the attempt that counts."""


class CompletionRuleShape(Shape):
    """The rule of a course for provisional marks that were published before all trials were run."""

    completion_rule: CompletionRule = Field(
        description="`higher`: only higher exact marks replace them. `exact`: the exact marks replace them in any case."
    )

    model_config = build_example_config(completion_rule="exact")


class CompletionRuleBody(CompletionRuleShape):
    """The new rule for published provisional marks."""


class PolicyBody(PolicyShape):
    """The new policy."""

    assignment: str = Field("", max_length=100)


class ExtensionBody(BaseModel):
    """An extension for one student, which replaces an earlier one."""

    assignment: str = Field("", max_length=100, description="Empty for all assignments.")
    due_at: Moment | None = Field(None, examples=["2026-12-07T17:00:00Z"])
    more_attempts: int = Field(0, ge=0, le=1000)


class LimitsShape(Shape):
    """The limits that apply to one student now."""

    due_at: datetime | None
    closed_at: datetime | None = Field(description="Submissions after this time are over the limit; null for no limit.")
    late_days: int
    attempts: int | None
    cool_down_seconds: float

    model_config = build_example_config(
        due_at="2026-12-07T17:00:00Z", closed_at="2026-12-09T17:00:00Z", late_days=2, attempts=6, cool_down_seconds=600
    )


@router.get("/courses/{course_id}/people")
def list_people(access: ReadAccess, context: Context, limit: Limit = 50, after: After = "") -> Listed[MemberShape]:
    """List the members of the course, in the order of enrolment."""
    sort_key = decode_cursor(after, int)
    actor, start = access.actor, 0 if sort_key is None else sort_key[0]
    members = people_views.list_members_after(context.service, actor, access.course_id, start, limit + 1)
    return build_list_page([MemberShape.model_validate(each) for each in members], limit, lambda each: [each.enrolment])


@router.post("/courses/{course_id}/people", status_code=201)
def enrol(access: ManageAccess, context: Context, body: EnrolBody) -> EnrolledShape:
    """Enrol students. The names and e-mail addresses of enrolled students are updated."""
    students = [Student(each.id, each.name, each.email) for each in body.students]
    people.enrol(context.service, access.actor, access.course_id, students)
    return EnrolledShape(students=len(body.students))


@router.get("/courses/{course_id}/people/{enrolment_id}")
def one_student(access: ReadAccess, context: Context, enrolment_id: RowNumber) -> StudentShape:
    """Return a student with extensions and submissions. Submissions to assignments with hidden names are omitted."""
    view = people_views.show_student(context.service, access.actor, access.course_id, enrolment_id)
    return StudentShape.model_validate(
        asdict(view.member)
        | {"gradings": view.gradings, "some_hidden": view.some_hidden, "extensions": view.extensions}
    )


@router.get("/courses/{course_id}/people/{enrolment_id}/limits/{assignment}")
def limits(
    access: ReadAccess,
    context: Context,
    enrolment_id: RowNumber,
    assignment: Annotated[str, Path(min_length=1, max_length=100)],
) -> LimitsShape:
    """Return the limits of one student for an assignment: the policy with the student's extension."""
    policy_limits = policies.show_limits(context.service, access.actor, access.course_id, enrolment_id, assignment)
    return LimitsShape.model_validate(policy_limits)


@router.post("/courses/{course_id}/people/{enrolment_id}/extensions", status_code=201)
def extend(access: ManageAccess, context: Context, enrolment_id: RowNumber, body: ExtensionBody) -> LimitsShape:
    """Allow one student more time or attempts."""
    request = ExtensionRequest(body.assignment, body.due_at, body.more_attempts)
    policy_limits = policies.extend(context.service, access.actor, access.course_id, enrolment_id, request)
    return LimitsShape.model_validate(policy_limits)


@router.get("/courses/{course_id}/policies")
def list_policies(access: ReadAccess, context: Context, limit: Limit = 50, after: After = "") -> Listed[PolicyShape]:
    """List the policies: deadline, attempts and release of grades, by assignment."""
    sort_key = decode_cursor(after, str)
    limits_by_assignment = policies.list_policies(context.service, access.actor, access.course_id)
    shapes = [
        _to_policy_shape(name, allowed)
        for name, allowed in sorted(limits_by_assignment.items())
        if sort_key is None or name > sort_key[0]
    ]
    return build_list_page(shapes[: limit + 1], limit, lambda each: [each.assignment])


@router.put("/courses/{course_id}/policies")
def set_policy(access: ManageAccess, context: Context, body: PolicyBody) -> PolicyShape:
    """Set the policy of an assignment. Without an assignment, set the course's default policy."""
    policy_limits = PolicyLimits(
        body.due_at,
        body.late_days,
        body.attempts,
        body.cool_down_seconds,
        release=body.release,
        released_at=body.released_at,
    )
    policies.set_policy(context.service, access.actor, access.course_id, body.assignment, policy_limits)
    return _to_policy_shape(body.assignment, policy_limits)


@router.get("/courses/{course_id}/policies/counted-attempt")
def show_counted_attempt(access: ReadAccess, context: Context) -> CountedAttemptShape:
    """Return which attempt of each student counts."""
    rule = policies.show_counted_attempt(context.service, access.actor, access.course_id)
    return CountedAttemptShape(counted_attempt=rule)


@router.put("/courses/{course_id}/policies/counted-attempt")
def set_counted_attempt(access: ManageAccess, context: Context, body: CountedAttemptBody) -> CountedAttemptShape:
    """Set which attempt of each student counts. The rule applies to all assignments and to existing submissions."""
    policies.set_counted_attempt(context.service, access.actor, access.course_id, body.counted_attempt)
    return CountedAttemptShape(counted_attempt=body.counted_attempt)


@router.get("/courses/{course_id}/policies/completion-rule")
def show_completion_rule(access: ReadAccess, context: Context) -> CompletionRuleShape:
    """Return whether exact marks replace published provisional marks that are higher."""
    rule = policies.show_completion_rule(context.service, access.actor, access.course_id)
    return CompletionRuleShape(completion_rule=rule)


@router.put("/courses/{course_id}/policies/completion-rule")
def set_completion_rule(access: ManageAccess, context: Context, body: CompletionRuleBody) -> CompletionRuleShape:
    """Set whether exact marks replace published provisional marks that are higher, for trials that end from now on."""
    policies.set_completion_rule(context.service, access.actor, access.course_id, body.completion_rule)
    return CompletionRuleShape(completion_rule=body.completion_rule)


@router.delete("/courses/{course_id}/policies", status_code=204, response_class=Response)
def drop_policy(
    access: ManageAccess, context: Context, assignment: Annotated[str, Query(min_length=1, max_length=100)]
) -> None:
    """Remove the policy of an assignment; the course's default policy applies."""
    policies.drop_policy(context.service, access.actor, access.course_id, assignment)


def _to_policy_shape(assignment: str, policy_limits: PolicyLimits) -> PolicyShape:
    return PolicyShape(
        assignment=assignment,
        due_at=policy_limits.due_at,
        late_days=policy_limits.late_days,
        attempts=policy_limits.attempts,
        cool_down_seconds=policy_limits.cool_down_seconds,
        release=policy_limits.release,
        released_at=policy_limits.released_at,
    )
