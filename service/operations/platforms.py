"""Learning platforms: operators register them; instructors fetch members and send marks."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.operations.errors import Invalid
from service.operations.lookup import check_operator, require_course
from service.store import audit
from service.store.courses import open_assignments
from service.store.courses.open_assignments import CourseAssignment
from service.store.people import lti
from service.store.people.lti import MAX_REGISTERED_LENGTH as MAX_REGISTERED_LENGTH
from service.store.people.lti import CourseLink, Platform
from service.store.people.lti import Registration as Registration
from service.store.states import Role
from sim.errors import UsageError


@dataclass(frozen=True, slots=True)
class CoursePlatform:
    """The platform that launches a course, if any, and the course's assignments."""

    link: CourseLink | None
    assignments: tuple[CourseAssignment, ...]


@dataclass(frozen=True, slots=True)
class EnrolledMembers:
    """The number of a platform's members in the course, and the reasons why others were rejected."""

    members: int
    refused: tuple[str, ...]


def list_platforms(service: Service, actor: Actor) -> list[Platform]:
    """Return all registered platforms, ordered by name. Raises NotFound."""
    check_operator(actor)
    with service.store.reading() as session:
        return lti.list_platforms(session)


def register(service: Service, actor: Actor, request: Registration) -> list[Platform]:
    """Register a platform, or update the one with the same issuer and client. Returns all registered platforms.

    Raises:
        NotFound: The actor is not an operator.
        Invalid: The name or the deployment is missing.
        UsageError: An address or id is not usable.
    """
    check_operator(actor)
    if not request.name.strip():
        raise Invalid("the platform name must contain visible characters")
    if not request.deployments:
        raise Invalid("enter at least one deployment ID of the platform")
    with service.store.transaction() as session:
        platform_id = lti.register_platform(session, request)
        audit.record_action(session, actor.name, "register", "lti_platform", str(platform_id), issuer=request.issuer)
        return lti.list_platforms(session)


def show_course_platform(service: Service, actor: Actor, course_id: int) -> CoursePlatform:
    """Return the platform of a course. Raises NotFound."""
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        assignments = open_assignments.list_assignments(session, course_id)
        return CoursePlatform(lti.find_course_link(session, course_id), tuple(assignments))


def enrol_members(service: Service, actor: Actor, course_id: int) -> EnrolledMembers:
    """Enrol all members of the course on the platform.

    Raises NotFound, UsageError without a platform, PlatformError if it returns no list.
    """
    from service.lti import services

    with service.store.reading() as session:
        link = _require_platform_link(session, actor, course_id)
    platform_members = services.fetch_members(service.store, link)
    refusals = []
    with service.store.transaction() as session:
        for member in platform_members:
            try:
                with session.begin_nested():
                    lti.enrol_subject(session, link.platform, course_id, member.subject, member.student, member.role)
            except UsageError as error:
                refusals.append(str(error))
        enrolled_members = EnrolledMembers(len(platform_members) - len(refusals), tuple(refusals))
        audit.record_action(session, actor.name, "enrol", "course", str(course_id), members=enrolled_members.members)
    return enrolled_members


def pass_back(service: Service, actor: Actor, course_id: int, assignment: str) -> int:
    """Send the published marks of an assignment to the platform's gradebook. Returns their number.

    Raises NotFound, UsageError without a platform, Invalid if names are hidden for the assignment, PlatformError if the
    platform does not accept them.
    """
    from service.lti.passback import send_marks

    with service.store.reading() as session:
        link = _require_platform_link(session, actor, course_id)
        hidden = open_assignments.load_anonymous_assignments(session, course_id)
    # Instructors read the gradebook, also if an operator sends the marks.
    if assignment in hidden:
        raise Invalid(
            "a learning platform shows marks with names, but names are hidden for %(assignment)s; show the names first",
            assignment=assignment,
        )
    sent_count = send_marks(service.store, link, course_id, assignment)
    with service.store.transaction() as session:
        audit.record_action(
            session, actor.name, "pass_back", "course", str(course_id), assignment=assignment, sent=sent_count
        )
    return sent_count


def _require_platform_link(session: Session, actor: Actor, course_id: int) -> CourseLink:
    require_course(session, actor, course_id, Role.INSTRUCTOR)
    link = lti.find_course_link(session, course_id)
    if link is None:
        raise Invalid("this course is not linked to a learning platform")
    return link
