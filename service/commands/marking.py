"""``robomark mark``: what instructors set by hand in a grade that is stored, and what they write to its student.

What it does stands in ``store/overrides.py`` and ``store/comments.py``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

import typer
from sqlalchemy.orm import Session

from service.commands.batch.words import out_of
from service.commands.shown import document, show, table, tell
from service.settings import load_settings
from service.store import audit
from service.store.batches import batches
from service.store.engine import open_store
from service.store.grades import comments, marking_history, overrides
from service.store.models import Job

GradeId = Annotated[str, typer.Argument(help="The grade's id, or the beginning of it.")]
CriterionId = Annotated[str, typer.Argument(help="The criterion's id; robomark mark history names them.")]
Reason = Annotated[str, typer.Option(help="Why; the student reads it.")]


def set_marks(
    grade: GradeId,
    criterion: CriterionId,
    marks: Annotated[str, typer.Argument(help="From 0 to the most that the criterion gives.")],
    reason: Reason,
) -> None:
    """Set the marks of a criterion in place of the grader's, for this submission and all its grades."""
    wanted = overrides.read_marks(marks)
    _change(grade, lambda session, job, actor: overrides.set_marks(session, job, criterion, wanted, reason, actor))


def excuse(grade: GradeId, criterion: CriterionId, reason: Reason) -> None:
    """Let neither the marks of a criterion count nor the most there are."""
    _change(grade, lambda session, job, actor: overrides.excuse(session, job, criterion, reason, actor))


def withdraw(grade: GradeId, criterion: CriterionId) -> None:
    """Let the grader's marks of a criterion count again."""
    _change(grade, lambda session, job, actor: overrides.withdraw(session, job, criterion, actor))


def comment(
    grade: GradeId,
    text: Annotated[str, typer.Argument(help="What the student reads.")],
    criterion: Annotated[str, typer.Option(help="The criterion that it is about; else all of the submission.")] = "",
) -> None:
    """Write a comment for the student."""
    _change(grade, lambda session, job, actor: comments.comment(session, job, criterion, text, actor))


def uncomment(
    grade: GradeId, number: Annotated[int, typer.Argument(help="The comment's, as robomark mark history says.")]
) -> None:
    """Withdraw a comment."""
    _change(grade, lambda session, job, actor: comments.withdraw(session, job, number, actor))


def history(grade: GradeId) -> None:
    """Show the criteria of a grade as graded and as they count, the comments, and who did what."""
    with open_store(load_settings()) as store, store.reading() as session:
        job_id = batches.find_job(session, grade)
        criteria = overrides.criterion_marks(session, job_id)
        written = comments.of_job(session, job_id)
        done = marking_history.history(session, session.get_one(Job, job_id).submission_id)
    document(grade=job_id, criteria=criteria, comments=written, history=done)
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
        told = table("when", "who", "did", "criterion", "before", "after", "why, or what")
        for step in done:
            when = step.at.astimezone().strftime("%Y-%m-%d %H:%M")
            told.add_row(when, step.actor, step.action, step.criterion, step.before, step.after, step.text)
        show(told)


def _change(grade: str, change: Callable[[Session, str, str], object]) -> None:
    """Make a change and tell what the grade comes to."""
    with open_store(load_settings()) as store:
        with store.transaction() as session:
            job_id = batches.find_job(session, grade)
            change(session, job_id, audit.this_user())
        with store.reading() as session:
            line = batches.job_line(session, job_id)
    document(job=line)
    tell(f"{line.student}, {line.assignment}: {out_of(line.marks, line.max_marks)}")
