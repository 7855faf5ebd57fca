"""Lookup of the objects that operations act on, with a check of the actor's role in the course.

A missing object and a missing role give the same error, so that no answer reveals which objects exist.
"""

from __future__ import annotations

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.operations.errors import Forbidden, Invalid, NotFound
from service.store.courses.hidden_names import NO_HIDDEN_NAMES, HiddenNames, load_hidden_names
from service.store.courses.open_assignments import match_anonymous_assignments
from service.store.states import Role
from service.store.tables.courses import Course, OpenAssignment
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Batch, Job, SubmissionRow


def check_operator(actor: Actor) -> None:
    """Raise NotFound unless the actor is an operator."""
    if not actor.operator:
        raise _build_not_found()


def check_machine(actor: Actor) -> None:
    """Raise Forbidden unless the actor is a command on the machine."""
    if not actor.is_machine:
        raise Forbidden("this is possible only with a command on the server")


def require_course(session: Session, actor: Actor, course_id: int, *roles: Role) -> Course:
    """Return a course in which the actor has one of these roles; commands on the machine have every role.

    Raises:
        NotFound: The course does not exist, or the actor has none of the roles in it.
    """
    course = session.get(Course, course_id)
    if course is None or not (actor.is_machine or actor.roles.get(course_id) in roles):
        raise _build_not_found()
    return course


def require_named_course(session: Session, actor: Actor, name: str) -> Course:
    """Return the course with this name, for operators; never creates one.

    Raises:
        NotFound: The course does not exist, or the actor is not an operator.
    """
    check_operator(actor)
    course = session.scalars(select(Course).where(Course.name == name)).one_or_none()
    if course is None:
        raise NotFound("there is no course called %(name)s", name=repr(name))
    return course


def require_batch(session: Session, course_id: int, batch_id: str) -> Batch:
    """Return a batch of the course. Raises NotFound."""
    row = session.get(Batch, batch_id)
    if row is None or row.course_id != course_id:
        raise _build_not_found()
    return row


def require_any_batch(session: Session, batch_id: str) -> Batch:
    """Return a batch of any course, for operators. Raises NotFound."""
    row = session.get(Batch, batch_id)
    if row is None:
        raise _build_not_found()
    return row


def require_job(session: Session, course_id: int, job_id: str) -> Job:
    """Return a job of the course. Raises NotFound."""
    row = session.get(Job, job_id)
    if row is None or session.get_one(Enrolment, row.enrolment_id).course_id != course_id:
        raise _build_not_found()
    return row


def require_submission(session: Session, course_id: int, submission_id: int) -> SubmissionRow:
    """Return a submission in the course. Raises NotFound."""
    row = session.get(SubmissionRow, submission_id)
    if row is None or session.get_one(Enrolment, row.enrolment_id).course_id != course_id:
        raise _build_not_found()
    return row


def require_own_submission(session: Session, actor: Actor, course_id: int, submission_id: int) -> SubmissionRow:
    """Return a submission of the actor in the course. Raises NotFound."""
    row = require_submission(session, course_id, submission_id)
    if session.get_one(Enrolment, row.enrolment_id).person_id != actor.person_id:
        raise _build_not_found()
    return row


def require_student(session: Session, actor: Actor, course_id: int, enrolment_id: int) -> Enrolment:
    """Return a student of a course that the actor instructs. Raises NotFound."""
    require_course(session, actor, course_id, Role.INSTRUCTOR)
    row = session.get(Enrolment, enrolment_id)
    if row is None or row.course_id != course_id:
        raise _build_not_found()
    if row.role is not Role.STUDENT:
        raise NotFound("%(id)s is not a student of this course", id=row.student)
    return row


def require_own_enrolment(session: Session, actor: Actor, course_id: int, *roles: Role) -> Enrolment:
    """Return the actor's enrolment in a course, in which they have one of these roles. Raises NotFound."""
    conditions = (Enrolment.course_id == course_id, Enrolment.person_id == actor.person_id)
    row = session.scalars(select(Enrolment).where(*conditions)).one_or_none()
    if row is None or actor.roles.get(course_id) not in roles:
        raise _build_not_found()
    return row


def load_names_for_actor(service: Service, actor: Actor, course_id: int) -> HiddenNames:
    """Return the labels that the actor sees instead of students' names; commands on the machine see every name."""
    return NO_HIDDEN_NAMES if actor.is_machine else load_hidden_names(service.store, course_id)


def check_no_names_hidden(session: Session, actor: Actor, course_id: int) -> None:
    """Raise Invalid if the action could show an instructor who submitted to an assignment with hidden names.

    It depends only on the course, so that it shows nothing about a student. Operators can read every name.
    """
    if actor.operator:
        return
    hidden = select(OpenAssignment.assignment).where(*match_anonymous_assignments(course_id))
    submitted = (
        select(func.min(SubmissionRow.assignment))
        .join(Enrolment, SubmissionRow.enrolment_id == Enrolment.id)
        .where(Enrolment.course_id == course_id, SubmissionRow.assignment.in_(hidden))
    )
    assignment = session.scalar(submitted)
    if assignment is not None:
        raise Invalid(
            "names are hidden for %(assignment)s, and this could show who submitted to it; show the names first, or "
            "ask an operator",
            assignment=assignment,
        )


def _build_not_found() -> NotFound:
    return NotFound("There is no such page or item, or you have no access to it.")
