"""A course marked with names hidden, with an example of everything that instructors can see."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from decimal import Decimal

from sqlalchemy import select, update
from sqlalchemy.orm import Session

import acting
import report_builders
from builders import PROGRAM, echo, grading_request
from service.grading.grade import CriterionResult, Grade
from service.store.batches import intake
from service.store.courses import open_assignments, policies
from service.store.courses.assignment_versions import freeze_assignment
from service.store.courses.policies import PolicyLimits
from service.store.grades import appeals, comments, overrides, results
from service.store.people import webhooks
from service.store.people.membership import Member
from service.store.people.students import Students
from service.store.queue import jobs
from service.store.states import JobState, ReleaseRule
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Job, SubmissionRow
from submissions.grading_request import GradingRequest
from submissions.student_identity import RejectedSubmission, Student
from web import COURSE, Web

ASSIGNMENT = "echo-responder"
#: Long enough not to occur in a random id.
STUDENTS = ("ada-lovelace", "bea-arthur", "cyd-charisse", "dot-matrix")
#: A student who submits only where names are shown.
IDLE = "zoe-never-submits"
#: The same task, marked with names shown.
NAMED = "echo-with-names"


@dataclass(frozen=True, slots=True)
class NamelessCourse:
    """The path values of everything in the course, several of each kind, and its instructor."""

    grace: Member
    values: Mapping[str, tuple[str, ...]]


def make_nameless_course(web: Web) -> NamelessCourse:
    """Add a batch, a regrade, web attempts, adjusted marks, comments and appeals of students with hidden names.

    The batch enrols its students; one student is enrolled by submitting on the web.
    """
    grace = web.instructor("grace-hopper")
    with web.store.transaction() as session:
        Students(session, 1).enrol(_person(IDLE), datetime.now(UTC))
        for assignment in (echo(), replace(echo(), id=NAMED)):
            open_assignments.prepare_assignment(session, 1, freeze_assignment(assignment))
            open_assignments.open_for_students(session, 1, assignment.id)
        open_assignments.hide_names(session, 1, ASSIGNMENT, True)
        policies.set_policy(session, 1, ASSIGNMENT, PolicyLimits(None, 0, 2, 0.0, release=ReleaseRule.AT_ONCE))
        webhooks.create_webhook(session, 1, "https://hooks.example.org/", ["grade.finished", "appeal.opened"])
        web_batch = open_assignments.load_course_assignment(session, 1, ASSIGNMENT).batch_id
    *most, last = STUDENTS
    refusal = RejectedSubmission("zed.docx", "holds no robot program", Student("zed-refused"))
    requests = [_request(who) for who in most]
    batch = intake.accept_batch(web.store, "week one", requests, (refusal,), course=COURSE, max_attempts=3)
    _grade_all(web)
    for number, who in enumerate((last, most[0], last, last)):
        request = _request(who, f"{PROGRAM}# {number}\n")
        intake.accept_submission(web.store, request, max_attempts=3, batch_id=web_batch, max_bytes=10**6)
    requests = [
        replace(_request(who, f"{PROGRAM}# with names\n"), assignment=replace(echo(), id=NAMED))
        for who in (*STUDENTS, IDLE)
    ]
    intake.accept_batch(web.store, "with names", requests, (), course=COURSE, max_attempts=3)
    _grade_all(web)
    acting.regrade(web.store, batch.id, None, max_attempts=3, actor="grace")
    _grade_all(web, dead=1)
    graded = _graded(web, batch.id)
    with web.store.transaction() as session:
        _mark_by_hand(session, graded[0][0], graded[1][0])
        for _, submission_id in reversed(graded):
            appeal = appeals.open_appeal(session, submission_id, "Please look again.")
        appeals.answer_appeal(session, 1, appeal, "It is right.", "grace")
    acting.publish_one(web.store, graded[-1][0], actor="grace")
    return NamelessCourse(grace, _values(web, str(appeal)))


def rename_students(session: Session, names: Mapping[str, str]) -> None:
    """Give each student the id, name, address and file names of another student. Nothing else changes."""
    rows = {row.student: row for row in session.scalars(select(Enrolment).where(Enrolment.student.in_(names)))}
    for row in rows.values():
        row.student = f"moving {row.student}"
    session.flush()
    for old, new in names.items():
        row, who = rows[old], _person(new)
        row.student = row.written = new
        row.name, row.email = who.name, who.email
        source = update(SubmissionRow).where(SubmissionRow.enrolment_id == row.id)
        session.execute(source.values(source=f"{new}.zip"))


def names_of(who: str) -> tuple[str, ...]:
    """Return every name of a student: id, name, address."""
    person = _person(who)
    return person.id, person.name, person.email


def _person(who: str) -> Student:
    return Student(who, who.replace("-", " ").title(), f"{who}@example.org")


def _request(who: str, program: str = PROGRAM) -> GradingRequest:
    own = f"{program}# {(*STUDENTS, IDLE).index(who)}\n"
    return replace(grading_request(who, own), listed_student=_person(who))


def _graded(web: Web, batch_id: str) -> list[tuple[str, int]]:
    with web.store.reading() as session:
        done = (Job.batch_id == batch_id, Job.state == JobState.DONE)
        rows = session.execute(select(Job.id, Job.submission_id).where(*done).order_by(Job.id)).all()
    return [(job_id, submission_id) for job_id, submission_id in rows]


def _mark_by_hand(session: Session, one: str, other: str) -> None:
    (criterion,) = (each.id for each in _grade(1).criteria[:1])
    overrides.set_marks(session, one, criterion, Decimal(1), "It is right.", "grace")
    overrides.excuse_criterion(session, other, criterion, "The task was unclear.", "grace")
    comments.add_comment(session, one, "", "Well done.", "grace")


def _values(web: Web, appeal: str) -> dict[str, tuple[str, ...]]:
    with web.store.reading() as session:
        nameless = select(Job.id, Job.batch_id, SubmissionRow.id).join(
            SubmissionRow, Job.submission_id == SubmissionRow.id
        )
        rows = session.execute(nameless.where(SubmissionRow.assignment == ASSIGNMENT)).all()
        enrolments = session.scalars(select(Enrolment.id).where(Enrolment.student.in_((*STUDENTS, IDLE)))).all()
    return {
        "course_id": ("1",),
        "batch_id": tuple(sorted({batch for _, batch, _ in rows if batch})),
        "job_id": tuple(sorted(job for job, _, _ in rows)),
        "submission_id": tuple(sorted({str(number) for _, _, number in rows})),
        "assignment": (ASSIGNMENT,),
        "enrolment_id": tuple(str(each) for each in enrolments),
        "student_id": tuple(str(each) for each in enrolments),
        "criterion": (_grade(1).criteria[0].id,),
        "appeal_id": (appeal,),
    }


def _grade_all(web: Web, dead: int = 0) -> None:
    """Grade the waiting jobs in random order with different marks. The first ``dead`` jobs fail."""
    for number in itertools.count():
        claim = jobs.claim_job(web.store, "worker", 60)
        if claim is None:
            return
        if number < dead:
            jobs.give_up_job(web.store, claim, "the disk is full")
        else:
            jobs.finish_job(
                web.store, claim, results.prepare_grade(_grade(number)), datetime.now(UTC) + timedelta(0, number)
            )


def _grade(number: int) -> Grade:
    grade = report_builders.faulty_grade()
    echoes = replace(grade.criteria[0], marks=Decimal(number % 3))
    unjudged = "The check failed." if number == 2 else ""
    extra = CriterionResult("moves", "Moves", Decimal(number % 2), Decimal(2), "It moved.", unjudged=unjudged)
    return replace(grade, criteria=(echoes, extra))
