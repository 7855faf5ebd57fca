"""The grades of a batch as one file, for whoever downloads it. The command line writes several into a folder by itself.

What a format writes is ``service.reports``'.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from service.batch_rows import rows_of, why_not_shown
from service.grading.grade import Grade
from service.report_files import report_pages
from service.reports.formats import FORMATS, Format
from service.reports.rows import TableRow
from service.reports.written import file_stems
from service.store.batches import batches
from service.store.engine import Store
from sim.errors import UsageError
from submissions.raw_files import shown

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
class ExportedFile:
    """A file, and what it is."""

    name: str
    media_type: str
    data: bytes


def export_file(store: Store, batch_id: str, form: str, *, published: bool, given: str = "") -> ExportedFile:
    """The grades of a batch in this format; one that has no table becomes a zip with a file for each grade.

    ``given`` is what a format fills in. Raises UsageError for a format that there is not, or that does not go with it.
    """
    chosen = FORMATS.get(form)
    if chosen is None or (chosen.filled_in is not None) != bool(given):
        others = sorted(name for name, each in FORMATS.items() if each.filled_in is None)
        raise UsageError(f"expected a format of {', '.join(others)}, or a worksheet that is to be filled in")
    with store.reading() as session:
        lines = batches.job_lines(session, batch_id)
        batch = batches.batch(session, batch_id)
    refusals = batch.refusals
    suffix = chosen.suffix
    if chosen.packed is not None:
        sink = io.BytesIO()
        released = [line for line in lines if not why_not_shown(line, published=published)]
        chosen.packed(report_pages(store, released, refusals), sink)
        data = sink.getvalue()
    else:
        rows = rows_of(store, lines, refusals, published=published)
        if chosen.filled_in is not None:
            data = chosen.filled_in(rows, given).text.encode()
        elif chosen.table is not None:
            data = chosen.table(rows).encode()
        else:
            suffix, data = ".zip", _documents(chosen, rows)
    return ExportedFile(f"{shown(batch.name) or batch_id}-{form}{suffix}", _TYPES[suffix], data)


def _documents(chosen: Format, rows: Sequence[TableRow[Grade]]) -> bytes:
    """A file for each grade that there is."""
    graded = [(row, row.grade) for row in rows if row.grade is not None]
    stems = file_stems([(row.student.id, row.assignment) for row, _ in graded])
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED) as archive:
        for stem, (_, grade) in zip(stems, graded, strict=True):
            assert chosen.document is not None
            archive.writestr(f"{stem}{chosen.suffix}", chosen.document(grade))
    return sink.getvalue()
