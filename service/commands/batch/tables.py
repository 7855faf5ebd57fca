"""Tables of ``robomark batch``: marks, changes by a regrade, and the activity log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

from rich.console import Group
from rich.text import Text

from service.commands.batch.batch_summary import format_marks, list_remarks
from service.commands.output import create_table
from service.operations.types import JobState, Standing

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table

    from service.grading.ranks import RankTable
    from service.operations.batch_views import AuditEntry, JobLine
    from service.operations.regrades import Change, CriterionChange
    from submissions.student_identity import RejectedSubmission

_STYLES: Mapping[JobState, str] = MappingProxyType(
    {JobState.DONE: "green", JobState.DEAD: "red", JobState.RUNNING: "cyan", JobState.CANCELLED: "yellow"}
)


def build_marks_table(lines: Sequence[JobLine], refusals: Sequence[RejectedSubmission] = ()) -> Table:
    """Return a table with one row for each submission, including rejected ones.

    The columns are marks, accuracy, verdict and remarks.
    """
    named = any(line.name not in ("", line.student) for line in lines)
    headings = ("student", *(["name"] if named else []), "assignment", "marks", "accuracy", "verdict", "grade")
    made = create_table(*headings, right=("marks", "accuracy"))

    def who(student: str, name: str, assignment: str) -> list[str]:
        return [student, *([name] if named else []), assignment]

    for line in lines:
        accuracy = "" if line.accuracy is None else f"{line.accuracy:.2f}"
        outcome = line.verdict or (f"{line.state.value}: {line.error}" if line.error else line.state.value)
        made.add_row(
            *who(line.student, line.name, line.assignment),
            format_marks(line.marks, line.max_marks),
            accuracy,
            Text("; ".join([outcome, *list_remarks(line)]), style=_STYLES.get(line.state, "")),
            line.id,
        )
    for refusal in refusals:
        whose = who(refusal.student.id or refusal.source, refusal.student.name, refusal.assignment)
        made.add_row(*whose, "", "", Text(f"rejected: {refusal.sentence}", style="red"), "")
    return made


def build_refusals_table(refusals: Sequence[RejectedSubmission]) -> Table:
    """Return a table of rejected submissions with reasons."""
    made = create_table("rejected", "why")
    for refusal in refusals:
        made.add_row(refusal.source, refusal.reason)
    return made


def build_changes_table(changes: Sequence[Change]) -> RenderableType:
    """Return a table with a row for each submission that a regrade changes or that needs review.

    A line below the table counts the other submissions.
    """
    made = create_table(
        "student", "before", "after", "criteria that changed", "why", "grade", right=("before", "after")
    )
    shown = [change for change in changes if _needs_row(change)]
    for change in shown:
        made.add_row(
            change.student,
            format_marks(change.before, change.before_max),
            format_marks(change.after, change.after_max),
            "; ".join(_format_criterion_change(criterion) for criterion in change.criteria),
            Text(change.reason, style=_STYLES.get(change.state, "")),
            change.job_id,
        )
    same = len(changes) - len(shown)
    standing = sum(change.standing is Standing.STANDS for change in changes)
    told = f"{same} of {len(changes)} unchanged; {standing} new grades are current"
    return Group(made, told) if shown else told


def build_rank_table(ranks: RankTable) -> RenderableType:
    """Return a table with one row for each student, best first."""
    measure = ", ".join(filter(None, (ranks.measure, ranks.unit)))
    made = create_table("place", "student", measure, "95 % interval", "counted trials", right=("place", measure))
    for row in ranks.texts:
        made.add_row(*row)
    return Group(f"{ranks.assignment}: {ranks.title}", made)


def build_history_table(history: Sequence[AuditEntry]) -> Table:
    """Return a table of the activity log."""
    made = create_table("when", "who", "did", "outcome")
    for entry in history:
        detail = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in entry.detail.items())
        when = entry.at.astimezone().strftime("%Y-%m-%d %H:%M")
        made.add_row(when, entry.actor, entry.action, detail)
    return made


def _needs_row(change: Change) -> bool:
    return change.differs or bool(change.criteria) or change.state is not JobState.DONE or change.is_unexplained


def _format_criterion_change(change: CriterionChange) -> str:
    before, after = (format_marks(*worth) if worth is not None else "none" for worth in (change.before, change.after))
    return f"{change.title}: {before} to {after}{' (adjusted by staff)' if change.by_hand else ''}"
