"""Writes the marks of a batch as one document, or as a file for each submission.

What a document says is ``service.reports``'.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

from service.batch_rows import rows_of, why_not_shown
from service.commands.batch.words import unjudged_words
from service.commands.shown import document, note, tell
from service.grading.grade import Grade
from service.home import for_the_user
from service.report_files import report_pages
from service.reports.formats import FORMATS, Format
from service.reports.rows import TableRow
from service.reports.written import file_stems, refused_stems
from service.settings import load_settings
from service.store.batches import batches, publishing
from service.store.engine import open_store
from service.store.states import JobState
from sim.errors import UsageError

#: Rows that a sentence names.
_MOST_NAMED = 10


def export_batch(batch: str, form: str, output: Path | None, worksheet: Path | None, *, published: bool) -> None:
    """Write the batch whose id begins so in this format. Raises UsageError where the two do not go together."""
    chosen = FORMATS[form]
    if output is None and (chosen.packed is not None or (chosen.table is None and chosen.document is not None)):
        what = "a folder" if chosen.document is not None else "a file"
        raise UsageError(f"{form} is no text for a screen; name {what} with --output")
    if (chosen.filled_in is None) != (worksheet is None):
        raise UsageError("--worksheet names what --format moodle-worksheet fills in; expected both or neither")
    with open_store(load_settings()) as store:
        with store.reading() as session:
            batch_id = batches.find_batch(session, batch)
            lines = batches.job_lines(session, batch_id)
            refusals = batches.batch(session, batch_id).refusals
            waiting = publishing.unpublished_regrades(session, batch_id)
        for line in lines:
            if line.state is JobState.DONE and line.suspect is None and line.staff_only is not None:
                _warn(f"{line.student} is for staff only: {line.staff_only}; robomark show {line.id}")
        if waiting:
            _warn(f"{waiting} regrades are not published: these are the grades that stand")
        shown = [line for line in lines if not why_not_shown(line, published=published)]
        if unjudged := unjudged_words(shown):
            _warn(unjudged)
        if chosen.packed is not None and output is not None:
            with for_the_user(), _opened(output) as sink:
                left_over = chosen.packed(report_pages(store, shown, refusals), sink)
            _name_left_over(left_over, "left out, for Moodle would not know whose it is")
            return
        rows = rows_of(store, lines, refusals, published=published)
    if output is not None and _is_for_files(chosen, output):
        _write_each(chosen, rows, output)
        return
    text = _document(chosen, rows, worksheet)
    if output is None:
        sys.stdout.write(text)
    else:
        _write(output, text)


def _document(chosen: Format, rows: Sequence[TableRow[Grade]], worksheet: Path | None) -> str:
    if chosen.filled_in is not None and worksheet is not None:
        try:
            given = worksheet.read_bytes().decode("utf-8")
        except OSError as error:
            raise UsageError(f"{worksheet} cannot be read: {error.strerror}") from None
        except UnicodeDecodeError:
            raise UsageError(f"{worksheet} is not UTF-8; expected it as Moodle wrote it") from None
        filled = chosen.filled_in(rows, given)
        _name_left_over(filled.left_over, f"not in {worksheet.name}")
        return filled.text
    assert chosen.table is not None
    return chosen.table(rows)


def _is_for_files(chosen: Format, output: Path) -> bool:
    """Whether a file for each submission is meant: ``output`` is a folder, or nothing yet and has no suffix."""
    if chosen.document is None:
        return False
    return chosen.table is None or output.is_dir() or (not output.suffix and not output.exists())


def _write_each(chosen: Format, rows: Sequence[TableRow[Grade]], folder: Path) -> None:
    """A file a submission, named after its student, and after its assignment where one student has several."""
    try:
        with for_the_user():
            folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder} cannot be made: {error.strerror}") from None
    written, refusal = chosen.document, chosen.refusal
    graded = [row for row in rows if row.grade is not None]
    refused = [row for row in rows if row.refused]
    texts = [written(row.grade) for row in graded if row.grade is not None] if written is not None else []
    stems = file_stems([(row.student.id, row.assignment) for row in graded])
    if refusal is not None:
        texts += map(refusal, refused)
        stems += refused_stems([(row.source, row.student.id) for row in refused])
    for stem, text in zip(stems, texts, strict=True):
        _write(folder / f"{stem}{chosen.suffix}", text)
    document(output=folder, files=len(texts))
    tell(f"{len(texts)} files in {folder}")


def _opened(path: Path) -> BinaryIO:
    try:
        return path.open("wb")
    except OSError as error:
        raise UsageError(f"{path} cannot be written: {error.strerror}") from None


def _write(path: Path, text: str) -> None:
    try:
        with for_the_user():
            path.write_text(text, encoding="utf-8", newline="")
    except OSError as error:
        raise UsageError(f"{path} cannot be written: {error.strerror}") from None


def _name_left_over(left_over: Sequence[str], why: str) -> None:
    if left_over:
        told = ", ".join(left_over[:_MOST_NAMED]) + (" ..." if len(left_over) > _MOST_NAMED else "")
        _warn(f"{why}: {told}")


def _warn(sentence: str) -> None:
    note(f"robomark: {sentence}")
