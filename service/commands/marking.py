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
        stored_grade = batches.find_grade(service, actor, grade)
        request = grades.MarksRequest(criterion, marks, reason, seen)
        _print_marks(grades.set_marks(service, actor, stored_grade.course_id, stored_grade.id, request))


def excuse(grade: GradeId, criterion: CriterionId, reason: Reason, seen: SeenOverride = None) -> None:
    """Exclude a criterion: neither its marks nor its maximum count."""
    from service.operations import batches, grades

    with open_installation() as (service, actor):
        stored_grade = batches.find_grade(service, actor, grade)
        request = grades.MarksRequest(criterion, None, reason, seen)
        _print_marks(grades.set_marks(service, actor, stored_grade.course_id, stored_grade.id, request))


def withdraw(grade: GradeId, criterion: CriterionId, seen: SeenOverride = None) -> None:
    """Remove an override, so that the grader's marks of a criterion count again."""
    from service.operations import batches, grades

    with open_installation() as (service, actor):
        stored_grade = batches.find_grade(service, actor, grade)
        _print_marks(grades.withdraw_override(service, actor, stored_grade.course_id, stored_grade.id, criterion, seen))


def comment(
    grade: GradeId,
    text: Annotated[str, typer.Argument(help="The text for the student.")],
    criterion: Annotated[str, typer.Option(help="The criterion to comment on. Default: the whole submission.")] = "",
) -> None:
    """Write a comment for the student."""
    from service.operations import batches, grades

    with open_installation() as (service, actor):
        stored_grade = batches.find_grade(service, actor, grade)
        request = grades.CommentRequest(text, criterion)
        _print_marks(grades.add_comment(service, actor, stored_grade.course_id, stored_grade.id, request))


def uncomment(
    grade: GradeId,
    number: Annotated[int, typer.Argument(help="The id of the comment, as shown by robomark mark history.")],
) -> None:
    """Remove a comment."""
    from service.operations import batches, grades

    with open_installation() as (service, actor):
        stored_grade = batches.find_grade(service, actor, grade)
        _print_marks(grades.withdraw_comment(service, actor, stored_grade.course_id, stored_grade.id, number))


def history(grade: GradeId) -> None:
    """Show the criteria of a grade as graded and as they count, the comments, and who did what."""
    from service.operations import batches, grades

    with open_installation() as (service, actor):
        stored_grade = batches.find_grade(service, actor, grade)
        marking = grades.show_marking(service, actor, stored_grade.course_id, stored_grade.id)
    criteria, comments, steps = marking.criteria, marking.comments, marking.history
    print_json(grade=stored_grade.id, criteria=criteria, comments=comments, history=steps)
    criteria_table = create_table("criterion", "title", "as graded", "counts", "reason", right=("as graded", "counts"))
    for line in criteria:
        graded_marks = "not judged" if line.graded is None else format_marks(line.graded, line.worth)
        counts = "" if line.override is None else format_marks(line.marks, line.max_marks)
        is_excused = line.override is not None and line.override.marks is None
        reason = "" if line.override is None else line.override.reason
        criteria_table.add_row(line.criterion, line.title, graded_marks, "excused" if is_excused else counts, reason)
    print_renderables(criteria_table)
    for stored_comment in comments:
        print_line(
            f"comment {stored_comment.id} of "
            f"{stored_comment.actor}{f' on {stored_comment.criterion}' if stored_comment.criterion else ''}: "
            f"{stored_comment.text}"
        )
    if steps:
        history_table = create_table("when", "who", "did", "criterion", "before", "after", "reason or text")
        for step in steps:
            timestamp = step.at.astimezone().strftime("%Y-%m-%d %H:%M")
            history_table.add_row(
                timestamp, step.actor, step.action, step.criterion, step.before, step.after, step.text
            )
        print_renderables(history_table)


def _print_marks(marking: Marking) -> None:
    """Print the marks of the grade after a change."""
    line = marking.line
    print_json(job=line)
    print_line(f"{line.student}, {line.assignment}: {format_marks(line.marks, line.max_marks)}")
