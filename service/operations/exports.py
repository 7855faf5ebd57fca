"""Exports of a batch's grades: a table, a file for each submission, or a package for another program."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import BinaryIO

from service.batch_rows import build_rows, describe_missing_grade
from service.file_names import make_portable_name
from service.grading.grade import Grade
from service.operations.context import Actor, Service
from service.operations.errors import Invalid
from service.operations.lookup import load_names_for_actor, require_batch, require_course
from service.report_files import render_report_pages
from service.reports.formats import FORMATS, Format
from service.reports.output_files import build_file_stems, build_refused_stems
from service.reports.rows import TableRow
from service.store.batches import batches, job_lines, publishing
from service.store.batches.job_lines import JobLine as JobLine
from service.store.grades import current_grades
from service.store.states import Role
from submissions.raw_files import sanitise_name

_TYPES: Mapping[str, str] = MappingProxyType(
    {
        ".csv": "text/csv; charset=utf-8",
        ".json": "application/json",
        ".xml": "application/xml",
        ".txt": "text/plain; charset=utf-8",
        ".zip": "application/zip",
    }
)


@dataclass(frozen=True, slots=True)
class ExportRequest:
    """Options of an export: the format, and a limit to published grades.

    ``worksheet`` is the text that a format fills in. ``one_each`` requests a file for each submission if the format
    also has a table.
    """

    form: str
    published: bool = False
    worksheet: str | None = None
    one_each: bool = False


@dataclass(frozen=True, slots=True)
class Export:
    """The result of an export: one text, or one text for each submission by file name; none for a package.

    ``for_staff`` contains staff-only grades, ``unjudged`` exported grades with unjudged criteria, and ``left_over`` the
    rows that the other program would not recognise.
    """

    text: str
    files: tuple[tuple[str, str], ...]
    left_over: tuple[str, ...]
    for_staff: tuple[JobLine, ...]
    unjudged: tuple[JobLine, ...]
    waiting_regrades: int


@dataclass(frozen=True, slots=True)
class Download:
    """An export as a single file."""

    name: str
    media_type: str
    data: bytes


def export(
    service: Service,
    actor: Actor,
    course_id: int,
    batch_id: str,
    request: ExportRequest,
    sink: BinaryIO | None = None,
) -> Export:
    """Export the standing grades of a batch in a format. A package is written to ``sink``.

    Raises:
        NotFound: The course does not have the batch, or the actor does not instruct it.
        Invalid: The format is unknown, does not match the worksheet, or requires hidden names.
    """
    export_format = _require_format(request)
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        require_batch(session, course_id, batch_id)
        lines = job_lines.load_job_lines(session, batch_id, hidden_names)
        refusals = batches.load_batch(session, batch_id).refusals
        unpublished_count = publishing.count_unpublished_regrades(session, batch_id)
    hidden_assignments = sorted({line.assignment for line in lines} & hidden_names.assignments)
    if hidden_assignments and (export_format.archive is not None or export_format.worksheet is not None):
        raise Invalid(
            "%(form)s needs student names, but names are hidden for %(assignment)s; show the names first",
            form=request.form,
            assignment=hidden_assignments[0],
        )
    released_lines = [line for line in lines if not describe_missing_grade(line, published=request.published)]
    text, files = "", list[tuple[str, str]]()
    unmatched_names: Sequence[str] = ()
    if export_format.archive is not None:
        unmatched_names = export_format.archive(
            render_report_pages(service.store, released_lines, refusals), sink or io.BytesIO()
        )
    else:
        rows = build_rows(service.store, lines, refusals, published=request.published)
        if export_format.worksheet is not None:
            filled_worksheet = export_format.worksheet(rows, request.worksheet or "")
            text, unmatched_names = filled_worksheet.text, filled_worksheet.left_over
        elif export_format.table is None or (request.one_each and export_format.document is not None):
            files = _render_files(export_format, rows)
        else:
            text = export_format.table(rows)
    return Export(
        text,
        tuple(files),
        tuple(unmatched_names),
        tuple(each for each in lines if _is_for_staff(each)),
        tuple(each for each in released_lines if each.unjudged),
        unpublished_count,
    )


def download(service: Service, actor: Actor, course_id: int, batch_id: str, request: ExportRequest) -> Download:
    """Export as a single file; several files are zipped. Raises like ``export``."""
    export_format, sink = _require_format(request), io.BytesIO()
    exported = export(service, actor, course_id, batch_id, request, sink)
    suffix, data = (
        export_format.suffix,
        sink.getvalue() if export_format.archive is not None else exported.text.encode(),
    )
    if export_format.archive is None and export_format.worksheet is None and export_format.table is None:
        suffix, data = ".zip", _zip_files(exported.files)
    with service.store.reading() as session:
        name = batches.load_batch(session, batch_id).name
    return Download(f"{sanitise_name(name) or batch_id}-{request.form}{suffix}", _TYPES[suffix], data)


def _require_format(request: ExportRequest) -> Format:
    export_format = FORMATS.get(request.form)
    if export_format is None or (export_format.worksheet is not None) != (request.worksheet is not None):
        table_formats = sorted(name for name, each in FORMATS.items() if each.worksheet is None)
        raise Invalid(
            "expected one of the formats %(formats)s, or a worksheet to fill in", formats=", ".join(table_formats)
        )
    return export_format


def _is_for_staff(line: JobLine) -> bool:
    return current_grades.is_trusted(line) and not current_grades.is_for_students(line)


def _render_files(export_format: Format, rows: Sequence[TableRow[Grade]]) -> list[tuple[str, str]]:
    """Return a file for each grade, and for each rejection if the format supports them.

    Files are named after the student, and after the assignment if a student has several.
    """
    graded_rows = [(row, row.grade) for row in rows if row.grade is not None]
    stems = build_file_stems([(row.student.id, row.assignment) for row, _ in graded_rows])
    texts = [] if export_format.document is None else [export_format.document(grade) for _, grade in graded_rows]
    if export_format.refusal is not None:
        refused_rows = [row for row in rows if row.refused]
        texts += map(export_format.refusal, refused_rows)
        stems += build_refused_stems([(row.source, row.student.id) for row in refused_rows])
    return [
        (make_portable_name(f"{stem}{export_format.suffix}"), text) for stem, text in zip(stems, texts, strict=True)
    ]


def _zip_files(files: Sequence[tuple[str, str]]) -> bytes:
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files:
            archive.writestr(name, text)
    return sink.getvalue()
