"""Lookup of the objects that operations act on, with a check of the actor's role in the course.

A missing object and a missing role give the same error, so that no answer reveals which objects exist.
"""

from __future__ import annotations

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.operations.errors import Forbidden, NotFound
from service.store.courses.hidden_names import NAMED, HiddenNames, hidden_names_of
from service.store.models import Batch, Course, Enrolment, Job, SubmissionRow
from service.store.states import Role


def check_operator(actor: Actor) -> None:
    """Raise NotFound unless the actor is an operator."""
    if not actor.operator:
        raise _nothing()


def check_machine(actor: Actor) -> None:
    """Raise Forbidden unless the actor is a command on the machine."""
    if not actor.is_machine:
        raise Forbidden("this is possible only with a command on the server")


def course_for(session: Session, actor: Actor, course_id: int, *roles: Role) -> Course:
    """Return a course in which the actor has one of these roles; commands on the machine have every role.

    Raises:
        NotFound: The course does not exist, or the actor has none of the roles in it.
    """
    found = session.get(Course, course_id)
    if found is None or not (actor.is_machine or actor.roles.get(course_id) in roles):
        raise _nothing()
    return found


def course_named(session: Session, actor: Actor, name: str) -> Course:
    """Return the course with this name, for operators; never creates one.

    Raises:
        NotFound: The course does not exist, or the actor is not an operator.
    """
    check_operator(actor)
    found = session.scalars(select(Course).where(Course.name == name)).one_or_none()
    if found is None:
        raise NotFound("there is no course called %(name)s", name=repr(name))
    return found


def batch_in(session: Session, course_id: int, batch_id: str) -> Batch:
    """Return a batch of the course. Raises NotFound."""
    row = session.get(Batch, batch_id)
    if row is None or row.course_id != course_id:
        raise _nothing()
    return row


def existing_batch(session: Session, batch_id: str) -> Batch:
    """Return a batch of any course, for operators. Raises NotFound."""
    row = session.get(Batch, batch_id)
    if row is None:
        raise _nothing()
    return row


def job_in(session: Session, course_id: int, job_id: str) -> Job:
    """Return a job of the course. Raises NotFound."""
    row = session.get(Job, job_id)
    if row is None or session.get_one(Enrolment, row.enrolment_id).course_id != course_id:
        raise _nothing()
    return row


def submission_in(session: Session, course_id: int, submission_id: int) -> SubmissionRow:
    """Return a submission in the course. Raises NotFound."""
    row = session.get(SubmissionRow, submission_id)
    if row is None or session.get_one(Enrolment, row.enrolment_id).course_id != course_id:
        raise _nothing()
    return row


def own_submission(session: Session, actor: Actor, course_id: int, submission_id: int) -> SubmissionRow:
    """Return a submission of the actor in the course. Raises NotFound."""
    row = submission_in(session, course_id, submission_id)
    if session.get_one(Enrolment, row.enrolment_id).person_id != actor.person_id:
        raise _nothing()
    return row


def student_in(session: Session, actor: Actor, course_id: int, enrolment_id: int) -> Enrolment:
    """Return a student of a course that the actor instructs. Raises NotFound."""
    course_for(session, actor, course_id, Role.INSTRUCTOR)
    row = session.get(Enrolment, enrolment_id)
    if row is None or row.course_id != course_id:
        raise _nothing()
    if row.role is not Role.STUDENT:
        raise NotFound("%(id)s is not a student of this course", id=row.student)
    return row


def own_enrolment(session: Session, actor: Actor, course_id: int, *roles: Role) -> Enrolment:
    """Return the actor's enrolment in a course, in which they have one of these roles. Raises NotFound."""
    mine = (Enrolment.course_id == course_id, Enrolment.person_id == actor.person_id)
    row = session.scalars(select(Enrolment).where(*mine)).one_or_none()
    if row is None or actor.roles.get(course_id) not in roles:
        raise _nothing()
    return row


def names_for(service: Service, actor: Actor, course_id: int) -> HiddenNames:
    """Return the labels that the actor sees in place of students' names; commands on the machine see every name."""
    return NAMED if actor.is_machine else hidden_names_of(service.store, course_id)


def _nothing() -> NotFound:
    return NotFound("There is no such page or item, or you have no access to it.")
