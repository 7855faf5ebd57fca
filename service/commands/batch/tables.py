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
    from service.operations.regrades import Change, ChangesSummary, CriterionChange
    from submissions.student_identity import RejectedSubmission

_STYLES: Mapping[JobState, str] = MappingProxyType(
    {JobState.DONE: "green", JobState.DEAD: "red", JobState.RUNNING: "cyan", JobState.CANCELLED: "yellow"}
)
#: Notes on marks that cross the pass mark.
_CROSSINGS: Mapping[str | None, str] = MappingProxyType({"up": " (now passed)", "down": " (no longer passed)"})


def build_marks_table(lines: Sequence[JobLine], refusals: Sequence[RejectedSubmission] = ()) -> Table:
    """Return a table with one row for each submission, including rejected ones.

    The columns are marks, accuracy, verdict (in the words of reports) and remarks.
    """
    from service.grading.verdict_labels import VERDICT_LABELS
    from sim.recording import Verdict

    has_names = any(line.name not in ("", line.student) for line in lines)
    headings = ("student", *(["name"] if has_names else []), "assignment", "marks", "accuracy", "verdict", "grade")
    table = create_table(*headings, right=("marks", "accuracy"))

    def format_student(student: str, name: str, assignment: str) -> list[str]:
        return [student, *([name] if has_names else []), assignment]

    for line in lines:
        accuracy = "" if line.accuracy is None else f"{line.accuracy:.2f}"
        state_text = f"{line.state.value}: {line.error}" if line.error else line.state.value
        outcome = VERDICT_LABELS[Verdict(line.verdict)] if line.verdict else state_text
        table.add_row(
            *format_student(line.student, line.name, line.assignment),
            format_marks(line.marks, line.max_marks),
            accuracy,
            Text("; ".join([outcome, *list_remarks(line)]), style=_STYLES.get(line.state, "")),
            line.id,
        )
    for refusal in refusals:
        student_cells = format_student(refusal.student.id or refusal.source, refusal.student.name, refusal.assignment)
        table.add_row(*student_cells, "", "", Text(f"rejected: {refusal.sentence}", style="red"), "")
    return table


def build_refusals_table(refusals: Sequence[RejectedSubmission]) -> Table:
    """Return a table of rejected submissions with reasons."""
    table = create_table("rejected", "why")
    for refusal in refusals:
        table.add_row(refusal.source, refusal.reason)
    return table


def build_changes_table(changes: Sequence[Change], summary: ChangesSummary) -> RenderableType:
    """Return the summary of a regrade, and a table with a row for each submission that it changes or needs review.

    A line below the table counts the other submissions.
    """
    table = create_table(
        "student", "before", "after", "criteria that changed", "why", "grade", right=("before", "after")
    )
    shown_changes = [change for change in changes if _needs_row(change)]
    for change in shown_changes:
        table.add_row(
            change.student,
            format_marks(change.before, change.before_max),
            format_marks(change.after, change.after_max) + _CROSSINGS.get(change.crosses, ""),
            "; ".join(_format_criterion_change(criterion) for criterion in change.criteria),
            Text(change.reason, style=_STYLES.get(change.state, "")),
            change.job_id,
        )
    unchanged_count = len(changes) - len(shown_changes)
    current_count = sum(change.standing is Standing.STANDS for change in changes)
    count_line = f"{unchanged_count} of {len(changes)} unchanged; {current_count} new grades are current"
    return Group(*_build_summary(summary), *([table] if shown_changes else []), count_line)


def _build_summary(summary: ChangesSummary) -> list[RenderableType]:
    """Return the numbers of a regrade: marks and boundaries in one line each, then a table of stages."""
    from service.operations.regrades import STAGE_LABELS, STAGE_MEANINGS

    share_line = f"share of marks: {summary.higher} higher, {summary.lower} lower, {summary.same} the same"
    share_line += "".join(
        f", {count} {label}"
        for count, label in ((summary.first_grades, "first graded"), (summary.ungraded, "not graded"))
        if count
    )
    boundary_line = (
        f"boundaries: {summary.crossing_up} now reach {100 * float(summary.pass_share):g} %, "
        f"{summary.crossing_down} no longer do; {summary.crossing_criteria} have a criterion that gains or loses full "
        "marks, or is in another band"
    )
    stages = create_table("cause", "meaning", "regrades", right=("regrades",))
    for stage, count in summary.stages.items():
        stages.add_row(STAGE_LABELS[stage], STAGE_MEANINGS[stage], str(count))
    return [share_line, boundary_line, *([stages] if summary.stages else [])]


def build_rank_table(ranks: RankTable) -> RenderableType:
    """Return a table with one row for each student, best first."""
    measure = ", ".join(filter(None, (ranks.measure, ranks.unit)))
    table = create_table("place", "student", measure, "95 % interval", "counted trials", right=("place", measure))
    for row in ranks.texts:
        table.add_row(*row)
    return Group(f"{ranks.assignment}: {ranks.title}", table)


def build_history_table(history: Sequence[AuditEntry]) -> Table:
    """Return a table of the activity log."""
    table = create_table("when", "who", "did", "outcome")
    for entry in history:
        detail = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in entry.detail.items())
        timestamp = entry.at.astimezone().strftime("%Y-%m-%d %H:%M")
        table.add_row(timestamp, entry.actor, entry.action, detail)
    return table


def _needs_row(change: Change) -> bool:
    return change.differs or bool(change.criteria) or change.state is not JobState.DONE or change.is_unexplained


def _format_criterion_change(change: CriterionChange) -> str:
    old_marks, new_marks = (
        format_marks(*worth) if worth is not None else "none" for worth in (change.before, change.after)
    )
    notes = [
        *(["adjusted by staff"] if change.by_hand else []),
        *(["crosses a boundary"] if change.crosses else []),
    ]
    return f"{change.title}: {old_marks} to {new_marks}" + (f" ({', '.join(notes)})" if notes else "")
