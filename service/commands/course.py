"""``robomark course``: when and how often students may submit, and what single students are allowed beyond it.

What follows for a submission stands in ``store/policies.py``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer
from sqlalchemy.orm import Session

from service.commands.shown import document, show, table, tell
from service.settings import load_settings
from service.store import audit
from service.store.courses import open_assignments, policies
from service.store.courses.open_assignments import CourseAssignment
from service.store.courses.policies import PolicyLimits
from service.store.courses.versions import check_assignment
from service.store.engine import Store, now, open_store
from service.store.people import people
from service.store.people.students import DEFAULT_COURSE, Students, course_of
from sim.errors import UsageError
from submissions.names import shown_name
from submissions.people import read_people, students_of
from submissions.roster import moment

Assignment = Annotated[
    str,
    typer.Option("-a", "--assignment", help="For this one only; else for all that have none of their own."),
]
Own = Annotated[str, typer.Argument(help="The assignment's id in the course.")]
InCourse = Annotated[str, typer.Option("--course", help="The course.")]
Due = Annotated[str | None, typer.Option(help="A date (its end), or a date and time: 2026-11-30T17:00.")]


def policy(
    assignment: Assignment = "",
    due: Due = None,
    late_days: Annotated[int, typer.Option(min=0, max=365, help="So many days late is still marked.")] = 0,
    attempts: Annotated[
        int | None, typer.Option(min=1, max=1000, help="Different submissions that are marked.")
    ] = None,
    cool_down: Annotated[float, typer.Option(min=0, max=10_000, help="Minutes between two submissions.")] = 0.0,
    drop: Annotated[bool, typer.Option("--drop", help="Let it have nothing of its own: what holds for all.")] = False,
    course: InCourse = DEFAULT_COURSE,
) -> None:
    """Set what holds from now on, in place of what held; without options show what holds."""
    allowed = PolicyLimits(_due(due), late_days, attempts, cool_down * 60)
    if drop and allowed != PolicyLimits():
        raise UsageError("--drop takes away what was set, expected no other limits beside it")
    with open_store(load_settings()) as store:
        if drop:
            with store.transaction() as session:
                course_id = people.find_course(session, course)
                policies.drop_policy(session, course_id, assignment)
                told = {"assignment": assignment, "dropped": True}
                audit.note(session, audit.this_user(), "policy", "course", str(course_id), **told)
        elif allowed != PolicyLimits():
            with store.transaction() as session:
                course_id = course_of(session, course, now(session))
                check_assignment(session, assignment)
                policies.set_policy(session, course_id, assignment, allowed)
                audit.note(session, audit.this_user(), "policy", "course", str(course_id), **_told(assignment, allowed))
        _show(store, course)


def extend(
    student: Annotated[str, typer.Argument(help="The student's name, as submitted.")],
    assignment: Assignment = "",
    due: Due = None,
    more_attempts: Annotated[int, typer.Option(min=0, max=1000, help="Attempts beyond the policy's.")] = 0,
    course: InCourse = DEFAULT_COURSE,
) -> None:
    """Allow one student more time or attempts, in place of what they were allowed before.

    Who has not submitted anything yet is enrolled first.
    """
    if due is None and not more_attempts:
        raise UsageError("say what to allow: --due, --more-attempts, or both")
    due_at = _due(due)
    student = shown_name(student)
    with open_store(load_settings()) as store, store.transaction() as session:
        at = now(session)
        course_id = course_of(session, course, at)
        check_assignment(session, assignment)
        enrolment_id = Students(session, course_id).find(student)
        policies.extend(session, enrolment_id, assignment, due_at, more_attempts)
        detail = {"student": student, **_told(assignment, PolicyLimits(due_at, attempts=more_attempts))}
        audit.note(session, audit.this_user(), "extend", "course", str(course_id), **detail)
    until = "" if due_at is None else f" until {due_at:%Y-%m-%d %H:%M}"
    more = f", {more_attempts} times more" if more_attempts else ""
    document(student=student, assignment=assignment, due=due_at, more_attempts=more_attempts)
    tell(f"{student}: {assignment or 'every assignment'} may be submitted{until}{more}")


def enrol(
    people: Annotated[Path, typer.Argument(help="A .csv with id, name, email; Moodle's grading worksheet is one.")],
    course: InCourse = DEFAULT_COURSE,
) -> None:
    """Enrol students before they submit, or give those who have an id alone their names and addresses."""
    listed = students_of(read_people(people))
    with open_store(load_settings()) as store, store.transaction() as session:
        at = now(session)
        course_id = course_of(session, course, at)
        students = Students(session, course_id)
        for student in listed:
            students.enrol(student, at)
        audit.note(session, audit.this_user(), "enrol", "course", str(course_id), students=len(listed))
    document(students=len(listed))
    tell(f"{len(listed)} {'student is' if len(listed) == 1 else 'students are'} in the course")


def prepare(
    assignment: Annotated[str, typer.Argument(help="An id of the catalogue, or a folder.")],
    course: InCourse = DEFAULT_COURSE,
) -> None:
    """Put an assignment into a course, not yet open; again, to mark by what it says now."""
    # With all kinds of criteria, which whoever opens or closes need not wait for.
    from service.store.courses.versions import freeze
    from submissions.assignment.reader import find_assignment

    frozen = freeze(find_assignment(assignment))
    with open_store(load_settings()) as store, store.transaction() as session:
        course_id = course_of(session, course, now(session))
        made = open_assignments.prepare(session, course_id, frozen)
        detail = {"assignment": made.assignment, "version": made.version}
        audit.note(session, audit.this_user(), "prepare", "course", str(course_id), **detail)
    _tell_state(made)


def open_assignment(assignment: Own, course: InCourse = DEFAULT_COURSE) -> None:
    """Let students see a prepared assignment and submit to it on the web."""
    _tell_state(_changed(course, assignment, "open", open_assignments.open_for_students))


def close_assignment(assignment: Own, course: InCourse = DEFAULT_COURSE) -> None:
    """Let nobody submit to an assignment on the web any more; what was submitted stays."""
    _tell_state(_changed(course, assignment, "close", open_assignments.close))


def remove_assignment(assignment: Own, course: InCourse = DEFAULT_COURSE) -> None:
    """Let a course have an assignment no more that no student has been shown; graded batches stay."""
    with open_store(load_settings()) as store, store.transaction() as session:
        course_id = course_of(session, course, now(session))
        open_assignments.remove(session, course_id, assignment)
        audit.note(session, audit.this_user(), "remove", "course", str(course_id), assignment=assignment)
    document(assignment=assignment)
    tell(f"{assignment} is in the course no more")


def _changed(
    course: str, assignment: str, action: str, change: Callable[[Session, int, str], None]
) -> CourseAssignment:
    with open_store(load_settings()) as store, store.transaction() as session:
        course_id = course_of(session, course, now(session))
        change(session, course_id, assignment)
        audit.note(session, audit.this_user(), action, "course", str(course_id), assignment=assignment)
        return open_assignments.find(session, course_id, assignment)


def _tell_state(line: CourseAssignment) -> None:
    document(
        assignment=line.assignment,
        title=line.title,
        open=line.open,
        opened_at=line.opened_at,
        closed_at=line.closed_at,
        version=line.version,
    )
    state = "is open" if line.open else "is closed" if line.closed_at else "is prepared, and not open yet"
    tell(f"{line.assignment} {state}")


def _due(text: str | None) -> datetime | None:
    if text is None:
        return None
    try:
        return moment(text, end_of_day=True)
    except ValueError:
        raise UsageError(f"--due is {text!r}, expected a date or a date and time, like 2026-11-30T17:00") from None


def _told(assignment: str, allowed: PolicyLimits) -> dict[str, object]:
    due_at = None if allowed.due_at is None else allowed.due_at.isoformat()
    return {"assignment": assignment, "due": due_at, "late_days": allowed.late_days, "attempts": allowed.attempts}


def _show(store: Store, course: str) -> None:
    with store.transaction() as session:
        found = policies.policies(session, course_of(session, course, now(session)))
    document(policies=[{"assignment": name, **asdict(allowed)} for name, allowed in found.items()])
    if not found:
        tell("no policy: everything that is submitted is marked, whenever it comes")
        return
    listed = table("assignment", "due", "late days", "attempts", "cool-down")
    for assignment, allowed in found.items():
        due = "" if allowed.due_at is None else allowed.due_at.astimezone().strftime("%Y-%m-%d %H:%M")
        attempts = "" if allowed.attempts is None else str(allowed.attempts)
        cool_down = f"{allowed.cool_down_seconds / 60:g} min" if allowed.cool_down_seconds else ""
        listed.add_row(assignment or "all others", due, str(allowed.late_days), attempts, cool_down)
    show(listed)
