"""Overrides by staff: marks that replace the grader's for one criterion, or an excused criterion, with a reason.

An override belongs to the submission, so it also applies to later grades. The grader's own result is never changed.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal

from sqlalchemy import ColumnElement, and_, exists, select, update
from sqlalchemy.orm import Session

from service.store import audit
from service.store.engine import now
from service.store.locks import lock_jobs
from service.store.states import JobState
from service.store.tables.grades import CriterionResultRow, Override
from service.store.tables.submissions import Job
from sim.errors import UsageError
from submissions.suggestions import suggest_name

MAX_REASON_LENGTH = 500
#: Maximum precision: four digits after the point.
_FINEST_MARKS = Decimal("0.0001")
_ZERO = Decimal(0)
#: Python's own reader also accepts 1_0, 1e1 and Infinity.
_WRITTEN_MARKS = re.compile(r"[+-]?(?:\d++[.,]?\d*+|[.,]\d++)")


class MarksChanged(UsageError):
    """The marks of a criterion changed after the caller read them."""


@dataclass(frozen=True, slots=True)
class OverrideLine:
    """An override of one criterion; marks of None excuse it."""

    id: int
    marks: Decimal | None
    reason: str
    actor: str
    made_at: datetime

    def compute_marks(self, worth: Decimal) -> tuple[Decimal, Decimal]:
        """Return the effective marks and maximum of a criterion, given its maximum ``worth``."""
        return compute_overridden_marks(self.marks, worth)


@dataclass(frozen=True, slots=True)
class CriterionMarks:
    """A criterion of a grade, as graded and as it counts."""

    criterion: str
    title: str
    message: str  # the grader's
    visibility: str
    graded: Decimal | None  # None if it could not be judged
    worth: Decimal  # the maximum that the assignment gives
    marks: Decimal
    max_marks: Decimal
    override: OverrideLine | None


def compute_overridden_marks(marks: Decimal | None, worth: Decimal) -> tuple[Decimal, Decimal]:
    """Return the effective marks and maximum of a criterion with overridden ``marks`` (None: excused) of ``worth``."""
    return (_ZERO, _ZERO) if marks is None else (min(marks, worth), worth)


def parse_marks(text: str) -> Decimal:
    """Parse marks with a decimal point or comma. Raises UsageError for anything else."""
    written_marks = text.strip()
    if not _WRITTEN_MARKS.fullmatch(written_marks):
        raise UsageError("marks are %(text)s, expected a number such as 2.5", text=repr(written_marks[:40]))
    return Decimal(written_marks.replace(",", "."))


def set_marks(
    session: Session,
    job_id: str,
    criterion: str,
    marks: Decimal,
    reason: str,
    actor: str,
    *,
    expected_override: int | None = None,
) -> None:
    """Override the marks of a criterion of this grade's submission.

    ``expected_override`` is the id of the override that the caller last read, 0 for none. None skips this check.

    Raises:
        UsageError: The grade or criterion is unknown, the marks are out of range, or the reason is missing.
        MarksChanged: The current override is not the one in ``expected_override``.
    """
    submission_id, line = _load_criterion(session, job_id, criterion, expected_override)
    if not marks.is_finite() or not _ZERO <= marks <= line.worth or marks != marks.quantize(_FINEST_MARKS):
        raise UsageError(
            "marks for %(title)s are %(marks)s, expected 0 to %(worth)s with at most four decimal places",
            title=line.title,
            marks=marks,
            worth=f"{line.worth:f}",
        )
    _replace_override(session, submission_id, line, _remove_padding(marks), reason, actor)


def _remove_padding(marks: Decimal) -> Decimal:
    """Return marks without sign, exponent and trailing zeros: written out, 0E-400000000 would take 400 MB."""
    return Decimal(f"{abs(marks.quantize(_FINEST_MARKS)).normalize():f}")


def excuse_criterion(
    session: Session, job_id: str, criterion: str, reason: str, actor: str, *, expected_override: int | None = None
) -> None:
    """Exclude the marks and the maximum of a criterion from the total. Raises UsageError like ``set_marks``."""
    submission_id, line = _load_criterion(session, job_id, criterion, expected_override)
    _replace_override(session, submission_id, line, None, reason, actor)


def withdraw_override(
    session: Session, job_id: str, criterion: str, actor: str, *, expected_override: int | None = None
) -> None:
    """Restore the grader's marks of a criterion.

    Raises UsageError without an override, MarksChanged if the override is not the one in ``expected_override``.
    """
    submission_id = _lock_submission(session, job_id)
    override = load_overrides(session, [job_id]).get(job_id, {}).get(criterion)
    if override is None:
        raise UsageError(
            "the marks of %(criterion)s in grade %(job)s are not adjusted", criterion=repr(criterion), job=job_id
        )
    _check_seen(override, expected_override, criterion)
    _end_override(session, override, now(session))
    detail = {
        "criterion": criterion,
        "before": _format_marks(override.marks),
        "after": "as graded",
        "override": override.id,
    }
    audit.record_action(session, actor, "withdraw", "submission", str(submission_id), **detail)
    _recount_all(session, submission_id)


def load_overrides(session: Session, job_ids: Collection[str]) -> Mapping[str, Mapping[str, OverrideLine]]:
    """Return the overrides for the submissions of these jobs, by job and criterion, without jobs that have none."""
    query = (
        select(Job.id, Override)
        .join(Override, Override.submission_id == Job.submission_id)
        .where(Job.id.in_(job_ids), Override.withdrawn_at.is_(None))
    )
    overrides_by_job: dict[str, dict[str, OverrideLine]] = {}
    for job_id, row in session.execute(query):
        line = OverrideLine(row.id, row.marks, row.reason, row.actor, row.made_at)
        overrides_by_job.setdefault(job_id, {})[row.criterion] = line
    return overrides_by_job


def load_criterion_marks(session: Session, job_id: str) -> list[CriterionMarks]:
    """Return the criteria of a grade in their order."""
    row = CriterionResultRow
    columns = (row.criterion, row.title, row.message, row.visibility, row.unjudged, row.marks, row.max_marks)
    overrides_by_criterion = load_overrides(session, [job_id]).get(job_id, {})
    lines = []
    for criterion, title, message, visibility, unjudged, marks, worth in session.execute(
        select(*columns).where(row.job_id == job_id).order_by(row.position)
    ):
        override = overrides_by_criterion.get(criterion)
        effective_marks = (marks, worth) if override is None else override.compute_marks(worth)
        graded_marks = None if unjudged else marks
        lines.append(
            CriterionMarks(criterion, title, message, visibility, graded_marks, worth, *effective_marks, override)
        )
    return lines


def recount_marks(session: Session, job_id: str) -> None:
    """Store the effective total of a job's criteria; no other function writes a job's marks."""
    lines = load_criterion_marks(session, job_id)
    marks, max_marks = (
        sum(each, _ZERO) for each in ([line.marks for line in lines], [line.max_marks for line in lines])
    )
    statement = update(Job).where(Job.id == job_id).values(marks=marks, max_marks=max_marks)
    session.execute(statement, execution_options={"synchronize_session": False})


def match_excused() -> ColumnElement[bool]:
    """Return the condition that a criterion row, joined with its job, is excused."""
    excusing_override = exists().where(
        Override.submission_id == Job.submission_id,
        Override.criterion == CriterionResultRow.criterion,
        Override.withdrawn_at.is_(None),
        Override.excused,
    )
    return excusing_override.correlate(Job, CriterionResultRow)


def match_unjudged() -> ColumnElement[bool]:
    """Return the condition that a criterion row, joined with its job, is unjudged and has no override."""
    active_override = (
        exists()
        .where(
            Override.submission_id == Job.submission_id,
            Override.criterion == CriterionResultRow.criterion,
            Override.withdrawn_at.is_(None),
        )
        .correlate(Job, CriterionResultRow)
    )
    return and_(CriterionResultRow.unjudged.is_not(None), ~active_override)


def _lock_submission(session: Session, job_id: str) -> int:
    """Return the id of a grade's submission and lock all its jobs, so that concurrent regrades are included."""
    job = session.get(Job, job_id)
    if job is None or job.state is not JobState.DONE:
        raise UsageError("%(job)s has no grade", job=job_id)
    lock_jobs(session, Job.submission_id == job.submission_id)
    return job.submission_id


def _load_criterion(
    session: Session, job_id: str, criterion: str, expected_override: int | None
) -> tuple[int, CriterionMarks]:
    submission_id = _lock_submission(session, job_id)
    lines = {line.criterion: line for line in load_criterion_marks(session, job_id)}
    if criterion not in lines:
        raise UsageError(
            "grade %(job)s has no criterion %(criterion)s%(hint)s",
            job=job_id,
            criterion=repr(criterion[:80]),
            hint=suggest_name(criterion, lines),
        )
    line = lines[criterion]
    _check_seen(line.override, expected_override, line.title)
    return submission_id, line


def _check_seen(override: OverrideLine | None, expected_override: int | None, title: str) -> None:
    """Compare ``expected_override`` under the lock of the grade.

    The second of two concurrent changes is rejected.
    """
    if expected_override is not None and expected_override != (0 if override is None else override.id):
        raise MarksChanged(
            "Another person changed the marks of %(title)s. Check the marks, then repeat your change.", title=title
        )


def _replace_override(
    session: Session, submission_id: int, line: CriterionMarks, marks: Decimal | None, reason: str, actor: str
) -> None:
    reason = reason.strip()
    if not 0 < len(reason) <= MAX_REASON_LENGTH:
        raise UsageError(
            "the reason has %(count)s characters, expected 1 to %(most)s because students can read it",
            count=len(reason),
            most=MAX_REASON_LENGTH,
        )
    current_time = now(session)
    if line.override is not None:
        _end_override(session, line.override, current_time)
    row = Override(
        submission_id=submission_id,
        criterion=line.criterion,
        marks=marks,
        excused=marks is None,
        reason=reason,
        actor=actor,
        made_at=current_time,
    )
    session.add(row)
    session.flush()
    previous_value = line.graded if line.override is None else line.override.marks
    previous_marks = "not judged" if line.override is None and line.graded is None else _format_marks(previous_value)
    # Purging removes the reason with the submission, but not the log entry.
    detail = {"criterion": line.criterion, "before": previous_marks, "after": _format_marks(marks), "override": row.id}
    action = "excuse" if marks is None else "set marks"
    audit.record_action(session, actor, action, "submission", str(submission_id), **detail)
    _recount_all(session, submission_id)


def _end_override(session: Session, line: OverrideLine, current_time: datetime) -> None:
    session.get_one(Override, line.id).withdrawn_at = current_time
    session.flush()


def _recount_all(session: Session, submission_id: int) -> None:
    graded_jobs = select(Job.id).where(Job.submission_id == submission_id, Job.state == JobState.DONE)
    for job_id in session.scalars(graded_jobs).all():
        recount_marks(session, job_id)


def _format_marks(marks: Decimal | None) -> str:
    return "excused" if marks is None else f"{marks.normalize():f}"
