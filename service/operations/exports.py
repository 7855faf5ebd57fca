"""Exports of a batch's grades: a table, a file for each submission, or a package for another program."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import BinaryIO

from service.batch_rows import build_rows, describe_missing_grade
from service.grading.grade import Grade
from service.operations.context import Actor, Service
from service.operations.errors import Invalid
from service.operations.lookup import load_names_for_actor, require_batch, require_course
from service.report_files import render_report_pages
from service.reports.formats import FORMATS, Format
from service.reports.output_files import build_file_stems, build_refused_stems
from service.reports.rows import TableRow
from service.store.batches import batches, publishing
from service.store.batches.batches import JobLine as JobLine
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
    chosen = _require_format(request)
    hidden = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        require_batch(session, course_id, batch_id)
        lines = batches.load_job_lines(session, batch_id, hidden)
        refusals = batches.load_batch(session, batch_id).refusals
        waiting = publishing.count_unpublished_regrades(session, batch_id)
    nameless = sorted({line.assignment for line in lines} & hidden.assignments)
    if nameless and (chosen.archive is not None or chosen.worksheet is not None):
        raise Invalid(
            "%(form)s needs student names, but names are hidden for %(assignment)s; show the names first",
            form=request.form,
            assignment=nameless[0],
        )
    released = [line for line in lines if not describe_missing_grade(line, published=request.published)]
    text, files = "", list[tuple[str, str]]()
    left_over: Sequence[str] = ()
    if chosen.archive is not None:
        left_over = chosen.archive(render_report_pages(service.store, released, refusals), sink or io.BytesIO())
    else:
        rows = build_rows(service.store, lines, refusals, published=request.published)
        if chosen.worksheet is not None:
            filled = chosen.worksheet(rows, request.worksheet or "")
            text, left_over = filled.text, filled.left_over
        elif chosen.table is None or (request.one_each and chosen.document is not None):
            files = _render_files(chosen, rows)
        else:
            text = chosen.table(rows)
    return Export(
        text,
        tuple(files),
        tuple(left_over),
        tuple(each for each in lines if _is_for_staff(each)),
        tuple(each for each in released if each.unjudged),
        waiting,
    )


def download(service: Service, actor: Actor, course_id: int, batch_id: str, request: ExportRequest) -> Download:
    """Export as a single file; several files are zipped. Raises like ``export``."""
    chosen, sink = _require_format(request), io.BytesIO()
    found = export(service, actor, course_id, batch_id, request, sink)
    suffix, data = chosen.suffix, sink.getvalue() if chosen.archive is not None else found.text.encode()
    if chosen.archive is None and chosen.worksheet is None and chosen.table is None:
        suffix, data = ".zip", _zip_files(found.files)
    with service.store.reading() as session:
        name = batches.load_batch(session, batch_id).name
    return Download(f"{sanitise_name(name) or batch_id}-{request.form}{suffix}", _TYPES[suffix], data)


def _require_format(request: ExportRequest) -> Format:
    chosen = FORMATS.get(request.form)
    if chosen is None or (chosen.worksheet is not None) != (request.worksheet is not None):
        others = sorted(name for name, each in FORMATS.items() if each.worksheet is None)
        raise Invalid("expected one of the formats %(formats)s, or a worksheet to fill in", formats=", ".join(others))
    return chosen


def _is_for_staff(line: JobLine) -> bool:
    return current_grades.is_trusted(line) and not current_grades.is_for_students(line)


def _render_files(chosen: Format, rows: Sequence[TableRow[Grade]]) -> list[tuple[str, str]]:
    """Return a file for each grade, and for each rejection if the format supports them.

    Files are named after the student, and after the assignment if a student has several.
    """
    graded = [(row, row.grade) for row in rows if row.grade is not None]
    stems = build_file_stems([(row.student.id, row.assignment) for row, _ in graded])
    texts = [] if chosen.document is None else [chosen.document(grade) for _, grade in graded]
    if chosen.refusal is not None:
        refused = [row for row in rows if row.refused]
        texts += map(chosen.refusal, refused)
        stems += build_refused_stems([(row.source, row.student.id) for row in refused])
    return [(f"{stem}{chosen.suffix}", text) for stem, text in zip(stems, texts, strict=True)]


def _zip_files(files: Sequence[tuple[str, str]]) -> bytes:
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files:
            archive.writestr(name, text)
    return sink.getvalue()
