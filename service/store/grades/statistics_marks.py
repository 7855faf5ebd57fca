"""Marks of jobs for statistics, as they count: read from criterion rows, without recordings. Read-only."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal
from typing import Protocol

from sqlalchemy import or_, select
from sqlalchemy.orm import Session

from service.grading.class_statistics import MarkedCriterion, MarkedSubmission, scale_marks
from service.store.grades import current_grades, overrides
from service.store.tables.grades import CriterionResultRow

#: Number of jobs per query: databases limit the number of parameters.
_CHUNK_SIZE = 1000


class MarkedLine(Protocol):
    """Fields of a job that are read for statistics."""

    @property
    def id(self) -> str: ...  # noqa: D102
    @property
    def student(self) -> str: ...  # noqa: D102
    @property
    def assignment(self) -> str: ...  # noqa: D102
    @property
    def state(self) -> str: ...  # noqa: D102
    @property
    def verdict(self) -> str | None: ...  # noqa: D102
    @property
    def marks(self) -> Decimal | None: ...  # noqa: D102
    @property
    def max_marks(self) -> Decimal: ...  # noqa: D102
    @property
    def suspect(self) -> str | None: ...  # noqa: D102
    @property
    def staff_only(self) -> str | None: ...  # noqa: D102


def load_marked_submissions(session: Session, lines: Sequence[MarkedLine]) -> list[MarkedSubmission]:
    """Return the graded jobs that are neither staff-only nor excused completely."""
    graded_lines = [line for line in lines if current_grades.is_for_students(line)]
    criteria: dict[str, list[MarkedCriterion]] = {line.id: [] for line in graded_lines}
    max_marks_by_job = dict.fromkeys(criteria, Decimal(0))
    for start in range(0, len(graded_lines), _CHUNK_SIZE):
        job_ids = [line.id for line in graded_lines[start : start + _CHUNK_SIZE]]
        overrides_by_job = overrides.load_overrides(session, job_ids)
        rows = session.execute(
            select(
                CriterionResultRow.job_id,
                CriterionResultRow.criterion,
                CriterionResultRow.title,
                CriterionResultRow.marks,
                CriterionResultRow.max_marks,
                CriterionResultRow.unjudged,
                or_(CriterionResultRow.visibility != "visible", CriterionResultRow.shown.is_not(None)),
            )
            .where(CriterionResultRow.job_id.in_(job_ids))
            .order_by(CriterionResultRow.job_id, CriterionResultRow.position)
        )
        for job_id, criterion, title, marks, worth, unjudged, has_hidden_trials in rows:
            override = overrides_by_job.get(job_id, {}).get(criterion)
            max_marks_by_job[job_id] += worth
            if override is not None:
                marks, worth = override.compute_marks(worth)
            elif unjudged is not None:
                continue
            criteria[job_id].append(MarkedCriterion(criterion, title, marks, worth, bool(has_hidden_trials)))
    marked_submissions = []
    for line in graded_lines:
        worth, line_criteria = max_marks_by_job[line.id], tuple(criteria[line.id])
        scaled_marks = None if line.marks is None else scale_marks(line.marks, line.max_marks, worth)
        if scaled_marks is not None:
            marked_submissions.append(
                MarkedSubmission(line.student, line.assignment, scaled_marks, worth, line.verdict or "", line_criteria)
            )
    return marked_submissions
