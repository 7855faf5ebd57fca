"""Members of a course as its instructors see them: all, a page, and one student."""

from __future__ import annotations

from dataclasses import dataclass

from service.operations.context import Actor, Service
from service.operations.lookup import require_course, require_student
from service.page_rows import select_page
from service.store.courses import open_assignments, policies
from service.store.courses.open_assignments import CourseAssignment
from service.store.courses.policies import ExtensionLine
from service.store.grades import own_gradings
from service.store.grades.own_gradings import OwnGrading
from service.store.people import lti, membership
from service.store.people.lti import CourseLink
from service.store.people.membership import Member
from service.store.purge import has_submitted
from service.store.states import Role

_PAGE_SIZE = 100


@dataclass(frozen=True, slots=True)
class MemberPage:
    """A page of the members that match a search, with totals of the whole course."""

    members: tuple[Member, ...]
    found: int
    number: int
    pages: int
    students: int
    extended: frozenset[int]  # enrolments that have an extension
    platform: CourseLink | None


@dataclass(frozen=True, slots=True)
class StudentView:
    """A student with extensions and newest submissions, except to assignments with hidden names."""

    member: Member
    gradings: tuple[OwnGrading, ...]
    some_hidden: bool
    extensions: tuple[ExtensionLine, ...]
    has_submitted: bool
    assignments: tuple[CourseAssignment, ...]


def list_members(service: Service, actor: Actor, course_id: int) -> list[Member]:
    """Return all members of a course, ordered by id. Raises NotFound."""
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        return membership.list_members(session, course_id)


def list_members_after(service: Service, actor: Actor, course_id: int, enrolment_id: int, limit: int) -> list[Member]:
    """Return at most ``limit`` members of a course in order of enrolment, after this one. Raises NotFound."""
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        return membership.list_members_after(session, course_id, enrolment_id, limit)


def search_members(service: Service, actor: Actor, course_id: int, text: str = "", number: int = 1) -> MemberPage:
    """Return a page of the members whose id, name or e-mail address contains a text. Raises NotFound."""
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        members = membership.list_members(session, course_id)
        extended_ids = frozenset(each.enrolment_id for each in policies.list_extensions(session, course_id))
        platform = lti.find_course_link(session, course_id)
    matching_members = [each for each in members if each.matches(text)]
    shown = select_page(matching_members, number, _PAGE_SIZE)
    return MemberPage(
        shown.rows,
        len(matching_members),
        shown.page,
        shown.pages,
        sum(each.role is Role.STUDENT for each in members),
        extended_ids,
        platform,
    )


def show_student(service: Service, actor: Actor, course_id: int, enrolment_id: int) -> StudentView:
    """Return one student of a course. Raises NotFound."""
    with service.store.reading() as session:
        row = require_student(session, actor, course_id, enrolment_id)
        anonymous_assignments = open_assignments.load_anonymous_assignments(session, course_id)
        gradings = own_gradings.list_newest_gradings(session, enrolment_id)
        extensions = policies.list_extensions(session, course_id)
        return StudentView(
            membership.load_enrolled_member(session, row),
            tuple(each for each in gradings if each.assignment not in anonymous_assignments),
            bool(anonymous_assignments),
            tuple(each for each in extensions if each.enrolment_id == row.id),
            has_submitted(session, row.id, anonymous_assignments),
            tuple(open_assignments.list_assignments(session, course_id)),
        )
