"""Changes by staff to the marks of a submission: activity log entries with their reasons and texts. Read-only.

Purging a submission removes the reasons and texts; the log entries remain.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import InstrumentedAttribute, Session

from service.store import audit
from service.store.audit import AuditEntry
from service.store.tables.grades import Appeal, Comment, Override
from service.store.tables.submissions import SubmissionRow


@dataclass(frozen=True, slots=True)
class MarkingStep:
    """A change by staff; fields that do not apply are empty."""

    at: datetime
    actor: str
    action: str
    criterion: str
    before: str
    after: str
    text: str  # a reason, comment or answer


def load_history(session: Session, submission_id: int) -> list[MarkingStep]:
    """Return all changes to a submission by staff, oldest first."""
    texts = {
        "override": _load_texts(session, submission_id, Override, Override.reason),
        "comment": _load_texts(session, submission_id, Comment, Comment.text),
        "appeal": _load_texts(session, submission_id, Appeal, Appeal.answer),
    }
    # SQLite reuses the id of a deleted submission, whose log entries are older than the new submission.
    created_at = session.scalars(select(SubmissionRow.created_at).where(SubmissionRow.id == submission_id)).one()
    entries = audit.load_entries(session, "submission", str(submission_id))
    return [_build_step(entry, texts) for entry in entries if entry.at >= created_at]


def _build_step(entry: AuditEntry, texts: Mapping[str, Mapping[int, str]]) -> MarkingStep:
    criterion, before, after = (str(entry.detail.get(name, "")) for name in ("criterion", "before", "after"))
    text = next((found.get(entry.detail[kind], "") for kind, found in texts.items() if kind in entry.detail), "")
    return MarkingStep(entry.at, entry.actor, entry.action, criterion, before, after, text)


def _load_texts(
    session: Session,
    submission_id: int,
    table: type[Override | Comment | Appeal],
    text: InstrumentedAttribute[Any],
) -> dict[int, str]:
    rows = session.execute(select(table.id, text).where(table.submission_id == submission_id))
    return {number: written or "" for number, written in rows}
