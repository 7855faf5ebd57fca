"""``robomark mark``: adjust the marks of a stored grade, excuse criteria, and comment for the student."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from service.commands.batch.batch_summary import out_of
from service.commands.operating import operating
from service.commands.shown import document, show, table, tell

if TYPE_CHECKING:
    from service.operations.grades import Marking

GradeId = Annotated[str, typer.Argument(help="The grade's id, or its first characters.")]
CriterionId = Annotated[str, typer.Argument(help="The criterion's id, as shown by robomark mark history.")]
Reason = Annotated[str, typer.Option(help="The reason, which the student can read.")]


Seen = Annotated[
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
    seen: Seen = None,
) -> None:
    """Set the marks of a criterion for this submission and all its grades. They replace the grader's marks."""
    from service.operations import batches, grades

    with operating() as (service, actor):
        found = batches.find_grade(service, actor, grade)
        asked = grades.MarksRequest(criterion, marks, reason, seen)
        _tell(grades.set_marks(service, actor, found.course_id, found.id, asked))


def excuse(grade: GradeId, criterion: CriterionId, reason: Reason, seen: Seen = None) -> None:
    """Exclude a criterion: neither its marks nor its maximum count."""
    from service.operations import batches, grades

    with operating() as (service, actor):
        found = batches.find_grade(service, actor, grade)
        asked = grades.MarksRequest(criterion, None, reason, seen)
        _tell(grades.set_marks(service, actor, found.course_id, found.id, asked))


def withdraw(grade: GradeId, criterion: CriterionId, seen: Seen = None) -> None:
    """Remove an override, so that the grader's marks of a criterion count again."""
    from service.operations import batches, grades

    with operating() as (service, actor):
        found = batches.find_grade(service, actor, grade)
        _tell(grades.withdraw(service, actor, found.course_id, found.id, criterion, seen))


def comment(
    grade: GradeId,
    text: Annotated[str, typer.Argument(help="The text for the student.")],
    criterion: Annotated[str, typer.Option(help="The criterion to comment on. Default: the whole submission.")] = "",
) -> None:
    """Write a comment for the student."""
    from service.operations import batches, grades

    with operating() as (service, actor):
        found = batches.find_grade(service, actor, grade)
        asked = grades.CommentRequest(text, criterion)
        _tell(grades.comment(service, actor, found.course_id, found.id, asked))


def uncomment(
    grade: GradeId,
    number: Annotated[int, typer.Argument(help="The id of the comment, as shown by robomark mark history.")],
) -> None:
    """Remove a comment."""
    from service.operations import batches, grades

    with operating() as (service, actor):
        found = batches.find_grade(service, actor, grade)
        _tell(grades.withdraw_comment(service, actor, found.course_id, found.id, number))


def history(grade: GradeId) -> None:
    """Show the criteria of a grade as graded and as they count, the comments, and who did what."""
    from service.operations import batches, grades

    with operating() as (service, actor):
        found = batches.find_grade(service, actor, grade)
        marking = grades.show_marking(service, actor, found.course_id, found.id)
    criteria, written, done = marking.criteria, marking.comments, marking.history
    document(grade=found.id, criteria=criteria, comments=written, history=done)
    listed = table("criterion", "title", "as graded", "counts", "reason", right=("as graded", "counts"))
    for line in criteria:
        graded = "not judged" if line.graded is None else out_of(line.graded, line.worth)
        counts = "" if line.override is None else out_of(line.marks, line.max_marks)
        excused = line.override is not None and line.override.marks is None
        reason = "" if line.override is None else line.override.reason
        listed.add_row(line.criterion, line.title, graded, "excused" if excused else counts, reason)
    show(listed)
    for each in written:
        tell(f"comment {each.id} of {each.actor}{f' on {each.criterion}' if each.criterion else ''}: {each.text}")
    if done:
        told = table("when", "who", "did", "criterion", "before", "after", "reason or text")
        for step in done:
            when = step.at.astimezone().strftime("%Y-%m-%d %H:%M")
            told.add_row(when, step.actor, step.action, step.criterion, step.before, step.after, step.text)
        show(told)


def _tell(changed: Marking) -> None:
    """Print the marks of the grade after a change."""
    line = changed.line
    document(job=line)
    tell(f"{line.student}, {line.assignment}: {out_of(line.marks, line.max_marks)}")
