"""Sentences about a batch and its jobs. ``tables.py`` contains the tables."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal
from typing import TYPE_CHECKING

from service.operations.types import BatchState, JobState

if TYPE_CHECKING:
    from service.operations.batch_views import BatchLine, JobLine

#: Maximum number of students that a sentence names.
_MAX_NAMED = 10


def summarize_jobs(line: BatchLine) -> str:
    """Return the number of jobs in each state as text."""
    if line.web_assignment is not None:
        state_prefix = "open: " if line.takes_in else "closed: "
    else:
        state_prefix = "" if line.state is BatchState.OPEN else f"{line.state.value}: "
    parts = [f"{line.states[state]} {state.value}" for state in JobState if line.states.get(state)]
    return state_prefix + (", ".join(parts) or "empty")


def list_remarks(line: JobLine) -> list[str]:
    """Return the remarks about a grade, for example ``2 days late`` or ``published``."""
    from service.operations.batch_views import format_days

    remarks = {
        f"same as {line.copied_from}": line.copied_from is not None,
        f"{format_days(line.days_late)} late": line.days_late > 0 and line.staff_only is None,
        f"staff only: {line.staff_only}": line.staff_only is not None,
        f"no {line.missing}": bool(line.missing),
        f"{line.unjudged} criteria not judged": line.unjudged > 0,
        f"{line.set_by_hand} criteria adjusted by staff": line.set_by_hand > 0,
        f"{line.surprises} trials explained in the log": line.surprises > 0,
        "provisional": line.provisional,
        "suspect": line.suspect is not None,
        f"attempt {line.newer_attempt} is newer and does not count": line.newer_attempt is not None,
        "published": line.published_at is not None,
    }
    return [remark for remark, holds in remarks.items() if holds]


def describe_unjudged(lines: Sequence[JobLine]) -> str:
    """Return a sentence about grades with criteria that were not judged, or an empty string if there are none."""
    students = [line.student for line in lines if line.unjudged]
    if not students:
        return ""
    names = ", ".join(students[:_MAX_NAMED]) + (" ..." if len(students) > _MAX_NAMED else "")
    subject = f"{len(students)} submissions have" if len(students) > 1 else "1 submission has"
    return (
        f"{subject} criteria that could not be judged and give no marks: {names}; robomark show GRADE shows the reasons"
    )


def format_marks(marks: Decimal | None, maximum: Decimal | None) -> str:
    """Return the marks and the maximum, such as ``7 / 10``. Return an empty string without marks."""
    if marks is None:
        return ""
    return f"{marks.normalize():f}" if maximum is None else f"{marks.normalize():f} / {maximum.normalize():f}"
