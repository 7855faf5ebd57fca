"""The moderation sheet of a batch, for external examiners."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

from service.batch_rows import describe_missing_grade
from service.grading.class_statistics import PASS_SHARE
from service.language import ENGLISH, Language
from service.moderation_records import SheetAppeal, SheetOverride
from service.operations.context import Actor, Service
from service.operations.errors import Invalid, NotFound
from service.operations.exports import Download
from service.operations.lookup import require_batch, require_course
from service.reports.moderation import ModerationSheet, SheetMarks, render_moderation_sheet
from service.store.batches import batch_table, job_lines, moderation_records, stored_requests
from service.store.batches.class_overview import compute_overviews
from service.store.batches.job_lines import JobLine
from service.store.courses.hidden_names import load_hidden_names
from service.store.engine import now
from service.store.states import Role
from submissions.raw_files import sanitise_name

LabelledRecord = TypeVar("LabelledRecord", SheetAppeal, SheetOverride)


def download_sheet(
    service: Service, actor: Actor, course_id: int, batch_id: str, assignment: str = "", language: Language = ENGLISH
) -> Download:
    """Return the moderation sheet of an assignment in a batch as a page. An empty name selects the only assignment.

    The sheet is for people outside the course, so names that are hidden are also hidden from operators' commands.

    Raises:
        NotFound: The course has no such batch, the batch no such assignment, or the actor does not instruct it.
        Invalid: The batch has no submission, or several assignments and none is named.
    """
    sheet = _load_sheet(service, actor, course_id, batch_id, assignment)
    name = f"{sanitise_name(sheet.batch) or batch_id}-{sheet.assignment.id}-moderation.html"
    return Download(name, "text/html; charset=utf-8", render_moderation_sheet(sheet, language).encode())


def _load_sheet(service: Service, actor: Actor, course_id: int, batch_id: str, assignment: str) -> ModerationSheet:
    hidden_names = load_hidden_names(service.store, course_id)
    with service.store.reading() as session:
        course = require_course(session, actor, course_id, Role.INSTRUCTOR)
        batch = require_batch(session, course_id, batch_id)
        all_lines = job_lines.load_job_lines(session, batch_id, hidden_names)
        name = _choose_assignment(all_lines, assignment)
        lines = [line for line in all_lines if line.assignment == name]
        table_lines = batch_table.load_table_lines(session, batch_id, (), hidden_names)
        own_lines = [line for line in table_lines if line.assignment == name]
        overviews = compute_overviews(session, course_id, own_lines, PASS_SHARE, hidden_names)
        overview = overviews[0] if overviews else None
        conditions = moderation_records.match_sheet_jobs(session, batch_id, name)

        def label_student(record: LabelledRecord) -> LabelledRecord:
            return replace(record, student=hidden_names.label_student(name, record.student))

        return ModerationSheet(
            course=course.name,
            batch=batch.name,
            batch_id=batch.id,
            created_at=batch.created_at,
            written_at=now(session),
            assignment=stored_requests.load_assignment(session, max(lines, key=lambda line: line.queued_at).id),
            has_hidden_names=name in hidden_names.assignments,
            statistics=None if overview is None else overview.statistics,
            quality=None if overview is None else overview.quality,
            distribution=() if overview is None else overview.distribution,
            marks=tuple(map(_build_marks, lines)),
            overrides=tuple(map(label_student, moderation_records.load_overrides(session, conditions))),
            appeals=tuple(map(label_student, moderation_records.load_appeals(session, conditions))),
            versions=tuple(moderation_records.load_versions(session, conditions)),
            log_head=moderation_records.load_newest_head(session),
        )


def _choose_assignment(lines: Sequence[JobLine], assignment: str) -> str:
    assignments = sorted({line.assignment for line in lines})
    if not assignments:
        raise Invalid("the batch has no submissions, so it has no moderation sheet")
    if not assignment:
        if len(assignments) > 1:
            raise Invalid(
                "the batch has several assignments; name one of them: %(assignments)s",
                assignments=", ".join(assignments),
            )
        return assignments[0]
    if assignment not in assignments:
        raise NotFound("the batch has no submissions for %(assignment)s", assignment=assignment)
    return assignment


def _build_marks(line: JobLine) -> SheetMarks:
    return SheetMarks(
        student=line.student,
        attempt=line.attempt,
        marks=line.marks,
        max_marks=line.max_marks,
        verdict=line.verdict,
        published_at=line.published_at,
        is_provisional=line.provisional,
        adjusted=line.set_by_hand,
        unjudged=line.unjudged,
        note=line.staff_only or describe_missing_grade(line),
    )
