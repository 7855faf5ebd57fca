"""``robomark mark``: adjust the marks of a stored grade, excuse criteria, and comment for the student."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from service.commands.batch.batch_summary import format_marks
from service.commands.installation import open_installation
from service.commands.output import create_table, print_json, print_line, print_renderables

if TYPE_CHECKING:
    from service.operations.grades import Marking

GradeId = Annotated[str, typer.Argument(help="The grade's id, or its first characters.")]
CriterionId = Annotated[str, typer.Argument(help="The criterion's id, as shown by robomark mark history.")]
Reason = Annotated[str, typer.Option(help="The reason, which the student can read.")]


SeenOverride = Annotated[
    int | None,
    typer.Option(
        min=0,
        help="Reject the change if another person changed these marks. The id of the current override, as in "
        "robomark mark history --json, or 0 if there is none.",
    ),
]


def set_marks(
    grade: GradeId,
    criterion: CriterionId,
    marks: Annotated[str, typer.Argument(help="The new marks, from 0 to the criterion's maximum.")],
    reason: Reason,
    seen: SeenOverride = None,
) -> None:
    """Set the marks of a criterion for this submission and all its grades. They replace the grader's marks."""
    from service.operations import batches, grades

    with open_installation() as (service, actor):
        found = batches.find_grade(service, actor, grade)
        asked = grades.MarksRequest(criterion, marks, reason, seen)
        _print_marks(grades.set_marks(service, actor, found.course_id, found.id, asked))


def excuse(grade: GradeId, criterion: CriterionId, reason: Reason, seen: SeenOverride = None) -> None:
    """Exclude a criterion: neither its marks nor its maximum count."""
    from service.operations import batches, grades

    with open_installation() as (service, actor):
        found = batches.find_grade(service, actor, grade)
        asked = grades.MarksRequest(criterion, None, reason, seen)
        _print_marks(grades.set_marks(service, actor, found.course_id, found.id, asked))


def withdraw(grade: GradeId, criterion: CriterionId, seen: SeenOverride = None) -> None:
    """Remove an override, so that the grader's marks of a criterion count again."""
    from service.operations import batches, grades

    with open_installation() as (service, actor):
        found = batches.find_grade(service, actor, grade)
        _print_marks(grades.withdraw_override(service, actor, found.course_id, found.id, criterion, seen))


def comment(
    grade: GradeId,
    text: Annotated[str, typer.Argument(help="The text for the student.")],
    criterion: Annotated[str, typer.Option(help="The criterion to comment on. Default: the whole submission.")] = "",
) -> None:
    """Write a comment for the student."""
    from service.operations import batches, grades

    with open_installation() as (service, actor):
        found = batches.find_grade(service, actor, grade)
        asked = grades.CommentRequest(text, criterion)
        _print_marks(grades.add_comment(service, actor, found.course_id, found.id, asked))


def uncomment(
    grade: GradeId,
    number: Annotated[int, typer.Argument(help="The id of the comment, as shown by robomark mark history.")],
) -> None:
    """Remove a comment."""
    from service.operations import batches, grades

    with open_installation() as (service, actor):
        found = batches.find_grade(service, actor, grade)
        _print_marks(grades.withdraw_comment(service, actor, found.course_id, found.id, number))


def history(grade: GradeId) -> None:
    """Show the criteria of a grade as graded and as they count, the comments, and who did what."""
    from service.operations import batches, grades

    with open_installation() as (service, actor):
        found = batches.find_grade(service, actor, grade)
        marking = grades.show_marking(service, actor, found.course_id, found.id)
    criteria, written, done = marking.criteria, marking.comments, marking.history
    print_json(grade=found.id, criteria=criteria, comments=written, history=done)
    listed = create_table("criterion", "title", "as graded", "counts", "reason", right=("as graded", "counts"))
    for line in criteria:
        graded = "not judged" if line.graded is None else format_marks(line.graded, line.worth)
        counts = "" if line.override is None else format_marks(line.marks, line.max_marks)
        excused = line.override is not None and line.override.marks is None
        reason = "" if line.override is None else line.override.reason
        listed.add_row(line.criterion, line.title, graded, "excused" if excused else counts, reason)
    print_renderables(listed)
    for each in written:
        print_line(f"comment {each.id} of {each.actor}{f' on {each.criterion}' if each.criterion else ''}: {each.text}")
    if done:
        told = create_table("when", "who", "did", "criterion", "before", "after", "reason or text")
        for step in done:
            when = step.at.astimezone().strftime("%Y-%m-%d %H:%M")
            told.add_row(when, step.actor, step.action, step.criterion, step.before, step.after, step.text)
        print_renderables(told)


def _print_marks(changed: Marking) -> None:
    """Print the marks of the grade after a change."""
    line = changed.line
    print_json(job=line)
    print_line(f"{line.student}, {line.assignment}: {format_marks(line.marks, line.max_marks)}")
