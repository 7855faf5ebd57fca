"""``robomark course``: deadlines and attempts, extensions, students and assignments of a course.

``service/store/courses/policies.py`` contains the submission rules.
"""

from __future__ import annotations

from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from service.commands.installation import open_installation
from service.commands.output import create_table, print_json, print_line, print_renderables
from service.operations import assignments, courses, policies
from service.operations import people as people_operations
from service.operations.assignments import CourseAssignment
from service.operations.courses import DEFAULT_COURSE
from service.operations.policies import ExtensionRequest, PolicyLimits
from service.operations.types import CompletionRule, CountedAttempt, ReleaseRule
from sim.errors import UsageError
from submissions.roster import parse_time
from submissions.student_identity import list_known_students, read_people

AssignmentOption = Annotated[
    str,
    typer.Option(
        "-a", "--assignment", help="Only for this assignment. Default: all assignments without their own setting."
    ),
]
AssignmentId = Annotated[str, typer.Argument(help="The assignment's id in the course.")]
CourseOption = Annotated[str, typer.Option("--course", help="The course.")]
DueOption = Annotated[str | None, typer.Option(help="A date (end of the day), or a date and time: 2026-11-30T17:00.")]


def policy(
    assignment: AssignmentOption = "",
    due: DueOption = None,
    late_days: Annotated[
        int, typer.Option(min=0, max=365, help="Late submissions accepted for this number of days.")
    ] = 0,
    attempts: Annotated[int | None, typer.Option(min=1, max=1000, help="Maximum number of attempts.")] = None,
    cool_down: Annotated[
        float, typer.Option(min=0, max=10_000, help="Minimum time between submissions, in minutes.")
    ] = 0.0,
    release: Annotated[
        ReleaseRule | None,
        typer.Option(help="When students see grades: at once, own submissions at once, or when published."),
    ] = None,
    release_from: Annotated[
        str | None, typer.Option(help="Students see all grades from this date, or date and time: 2026-12-14T09:00.")
    ] = None,
    drop: Annotated[
        bool, typer.Option("--drop", help="Remove the policy. The policy for all assignments applies.")
    ] = False,
    counted_attempt: Annotated[
        CountedAttempt | None,
        typer.Option(help="The attempt of each student that counts, for all assignments of the course."),
    ] = None,
    completion_rule: Annotated[
        CompletionRule | None,
        typer.Option(help="Exact marks that replace published provisional ones: only higher ones, or all."),
    ] = None,
    course: CourseOption = DEFAULT_COURSE,
) -> None:
    """Set deadline, attempts and release of grades, replacing the earlier policy. Without options, show the policy.

    The rules for grades are set separately: other options do not change them, and they do not replace a policy.
    """
    limits = PolicyLimits(
        _parse_due(due),
        late_days,
        attempts,
        cool_down * 60,
        release=release or ReleaseRule.OWN_AT_ONCE,
        released_at=_parse_date("--release-from", release_from, end_of_day=False),
    )
    is_given = release is not None or limits != PolicyLimits()
    if drop and is_given:
        raise UsageError("--drop removes all limits, expected no other limits with it")
    with open_installation() as (service, actor):
        course_id = courses.find(service, actor, course)
        if drop:
            policies.drop_policy(service, actor, course_id, assignment)
        elif is_given:
            policies.set_policy(service, actor, course_id, assignment, limits)
        if counted_attempt is not None:
            policies.set_counted_attempt(service, actor, course_id, counted_attempt)
        if completion_rule is not None:
            policies.set_completion_rule(service, actor, course_id, completion_rule)
        _show_policies(
            policies.list_policies(service, actor, course_id),
            policies.show_counted_attempt(service, actor, course_id),
            policies.show_completion_rule(service, actor, course_id),
        )


def extend(
    student: Annotated[str, typer.Argument(help="The student's name, as submitted.")],
    assignment: AssignmentOption = "",
    due: DueOption = None,
    more_attempts: Annotated[int, typer.Option(min=0, max=1000, help="Additional attempts.")] = 0,
    course: CourseOption = DEFAULT_COURSE,
) -> None:
    """Allow one student more time or attempts. Replaces an earlier extension.

    Students who have not submitted yet are enrolled first.
    """
    due_at = _parse_due(due)
    with open_installation() as (service, actor):
        course_id = courses.find(service, actor, course)
        member = people_operations.find(service, actor, course, student)
        request = ExtensionRequest(assignment, due_at, more_attempts)
        policies.extend(service, actor, course_id, member.enrolment_id, request)
    student = member.id
    due_text = "" if due_at is None else f" until {due_at:%Y-%m-%d %H:%M}"
    attempts_text = f", {more_attempts} more attempts" if more_attempts else ""
    print_json(student=student, assignment=assignment, due=due_at, more_attempts=more_attempts)
    print_line(f"{student}: {assignment or 'every assignment'} may be submitted{due_text}{attempts_text}")


def enrol(
    people: Annotated[
        Path, typer.Argument(help="A .csv file with id, name and email, such as Moodle's grading worksheet.")
    ],
    course: CourseOption = DEFAULT_COURSE,
) -> None:
    """Enrol students before they submit, or add names and addresses to enrolled ids."""
    students = list_known_students(read_people(people))
    with open_installation() as (service, actor):
        people_operations.enrol(service, actor, courses.find(service, actor, course), students)
    print_json(students=len(students))
    print_line(f"{len(students)} {'student is' if len(students) == 1 else 'students are'} in the course")


def prepare(
    assignment: Annotated[str, typer.Argument(help="An assignment's id in the catalogue, or a folder.")],
    course: CourseOption = DEFAULT_COURSE,
) -> None:
    """Add an assignment to a course without opening it. Repeat the command to use the current version."""
    # This import loads all kinds of criteria, which other commands do not need.
    from submissions.assignment.reader import find_assignment

    definition = find_assignment(assignment)
    with open_installation() as (service, actor):
        course_assignment = assignments.prepare(service, actor, courses.find(service, actor, course), definition)
    _print_state(course_assignment)


def open_assignment(assignment: AssignmentId, course: CourseOption = DEFAULT_COURSE) -> None:
    """Open a prepared assignment: students see it and can submit to it on the web."""
    with open_installation() as (service, actor):
        course_assignment = assignments.open_for_students(
            service, actor, courses.find(service, actor, course), assignment
        )
    _print_state(course_assignment)


def close_assignment(assignment: AssignmentId, course: CourseOption = DEFAULT_COURSE) -> None:
    """Stop web submissions to an assignment. Existing submissions stay."""
    with open_installation() as (service, actor):
        course_assignment = assignments.close(service, actor, courses.find(service, actor, course), assignment)
    _print_state(course_assignment)


def remove_assignment(assignment: AssignmentId, course: CourseOption = DEFAULT_COURSE) -> None:
    """Remove an assignment from a course if no student has seen it. Graded batches stay."""
    with open_installation() as (service, actor):
        assignments.remove(service, actor, courses.find(service, actor, course), assignment)
    print_json(assignment=assignment)
    print_line(f"{assignment} is removed from the course")


def hide_names(assignment: AssignmentId, course: CourseOption = DEFAULT_COURSE) -> None:
    """Hide the students' names from everyone who marks this assignment."""
    _set_names_hidden(assignment, course, hidden=True)


def show_names(assignment: AssignmentId, course: CourseOption = DEFAULT_COURSE) -> None:
    """Show the students' names to everyone who marks this assignment."""
    _set_names_hidden(assignment, course, hidden=False)


def list_courses() -> None:
    """List the courses of this installation."""
    with open_installation() as (service, actor):
        course_list = courses.list_courses(service, actor)
    print_json(courses=course_list)
    if not course_list:
        print_line("no courses yet")
        return
    table = create_table("name", "instructors", "students", right=("instructors", "students"))
    for course_line in course_list:
        table.add_row(course_line.name, str(course_line.instructors), str(course_line.students))
    print_renderables(table)


def _set_names_hidden(assignment: str, course: str, *, hidden: bool) -> None:
    with open_installation() as (service, actor):
        course_id = courses.find(service, actor, course)
        assignments.hide_names(service, actor, course_id, assignment, names_hidden=hidden)
    print_json(assignment=assignment, names_hidden=hidden)
    print_line(f"{assignment}: names are {'hidden' if hidden else 'shown'}")


def _print_state(line: CourseAssignment) -> None:
    print_json(
        assignment=line.assignment,
        title=line.title,
        open=line.open,
        opened_at=line.opened_at,
        closed_at=line.closed_at,
        version=line.version,
    )
    state = "is open" if line.open else "is closed" if line.closed_at else "is prepared, and not open yet"
    print_line(f"{line.assignment} {state}")


def _parse_due(text: str | None) -> datetime | None:
    return _parse_date("--due", text, end_of_day=True)


def _parse_date(option: str, text: str | None, *, end_of_day: bool) -> datetime | None:
    if text is None:
        return None
    try:
        return parse_time(text, end_of_day=end_of_day)
    except ValueError:
        raise UsageError(f"{option} is {text!r}, expected a date or a date and time, like 2026-11-30T17:00") from None


def _format_date(moment: datetime | None) -> str:
    return "" if moment is None else moment.astimezone().strftime("%Y-%m-%d %H:%M")


def _show_policies(
    limits_by_assignment: dict[str, PolicyLimits], counted_attempt: CountedAttempt, completion_rule: CompletionRule
) -> None:
    print_json(
        policies=[{"assignment": name, **asdict(allowed)} for name, allowed in limits_by_assignment.items()],
        counted_attempt=counted_attempt,
        completion_rule=completion_rule,
    )
    print_line(f"attempt that counts: {counted_attempt.value}")
    print_line(f"exact marks that replace published provisional ones: {completion_rule.value}")
    if not limits_by_assignment:
        print_line("no policy: all submissions are marked at any time")
        return
    table = create_table("assignment", "due", "late days", "attempts", "cool-down", "students see grades", "all from")
    for assignment, limits in limits_by_assignment.items():
        attempts = "" if limits.attempts is None else str(limits.attempts)
        cool_down = f"{limits.cool_down_seconds / 60:g} min" if limits.cool_down_seconds else ""
        table.add_row(
            assignment or "all others",
            _format_date(limits.due_at),
            str(limits.late_days),
            attempts,
            cool_down,
            limits.release.value,
            _format_date(limits.released_at),
        )
    print_renderables(table)
