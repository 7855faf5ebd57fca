"""Write the marks of a batch as one document, or as one file for each submission.

``service.reports`` defines the formats.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

from service.commands.batch.batch_summary import describe_unjudged
from service.commands.installation import open_installation
from service.commands.output import print_json, print_line, print_note
from service.home import user_permissions
from service.operations import batches
from service.operations.exports import Export, ExportRequest, export
from service.reports.formats import FORMATS, Format
from sim.errors import UsageError

#: Maximum number of rows that a sentence names.
_MOST_NAMED = 10


def export_batch(batch: str, form: str, output: Path | None, worksheet: Path | None, *, published: bool) -> None:
    """Write a batch in the given format.

    Args:
        batch: Batch id, or the beginning of it.
        form: Name of the format.
        output: File or folder to write. None means standard output.
        worksheet: Moodle's grading worksheet to fill in.
        published: Export only published grades.

    Raises:
        UsageError: The options do not fit the format.
    """
    chosen = FORMATS[form]
    if output is None and (chosen.archive is not None or (chosen.table is None and chosen.document is not None)):
        what = "a folder" if chosen.document is not None else "a file"
        raise UsageError(f"{form} cannot be printed to a terminal; name {what} with --output")
    if (chosen.worksheet is None) != (worksheet is None):
        raise UsageError("--worksheet and --format moodle-worksheet need each other; expected both or neither")
    one_each = output is not None and _needs_separate_files(chosen, output)
    asked = ExportRequest(form, published, None if worksheet is None else _read_worksheet(worksheet), one_each)
    with open_installation() as (service, actor):
        found = batches.find(service, actor, batch)
        if chosen.archive is not None and output is not None:
            with user_permissions(), _open_file(output) as sink:
                made = export(service, actor, found.course_id, found.id, asked, sink)
        else:
            made = export(service, actor, found.course_id, found.id, asked)
    _warn_about_export(made)
    if chosen.archive is not None:
        _warn_about_omitted(made.left_over, "left out, because Moodle cannot match the student")
    elif one_each and output is not None:
        _write_files(made, output)
    else:
        if worksheet is not None:
            _warn_about_omitted(made.left_over, f"not in {worksheet.name}")
        if output is None:
            sys.stdout.write(made.text)
        else:
            _write_file(output, made.text)


def _warn_about_export(made: Export) -> None:
    for line in made.for_staff:
        _warn(f"{line.student} is for staff only: {line.staff_only}; robomark show {line.id}")
    if made.waiting_regrades:
        _warn(f"{made.waiting_regrades} regrades are not published: these are the current grades")
    if unjudged := describe_unjudged(made.unjudged):
        _warn(unjudged)


def _read_worksheet(worksheet: Path) -> str:
    try:
        return worksheet.read_bytes().decode("utf-8")
    except OSError as error:
        raise UsageError(f"{worksheet} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise UsageError(f"{worksheet} is not UTF-8; expected the file as downloaded from Moodle") from None


def _needs_separate_files(chosen: Format, output: Path) -> bool:
    """Return whether to write one file for each submission into the folder ``output``.

    The format must have a document for one grade. If it also has a table, ``output`` must be a folder, or must neither
    exist
    nor have a suffix.
    """
    if chosen.document is None:
        return False
    return chosen.table is None or output.is_dir() or (not output.suffix and not output.exists())


def _write_files(made: Export, folder: Path) -> None:
    try:
        with user_permissions():
            folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder} cannot be made: {error.strerror}") from None
    for name, text in made.files:
        _write_file(folder / name, text)
    print_json(output=folder, files=len(made.files))
    print_line(f"{len(made.files)} files in {folder}")


def _open_file(path: Path) -> BinaryIO:
    try:
        return path.open("wb")
    except OSError as error:
        raise UsageError(f"{path} cannot be written: {error.strerror}") from None


def _write_file(path: Path, text: str) -> None:
    try:
        with user_permissions():
            path.write_text(text, encoding="utf-8", newline="")
    except OSError as error:
        raise UsageError(f"{path} cannot be written: {error.strerror}") from None


def _warn_about_omitted(left_over: Sequence[str], why: str) -> None:
    if left_over:
        told = ", ".join(left_over[:_MOST_NAMED]) + (" ..." if len(left_over) > _MOST_NAMED else "")
        _warn(f"{why}: {told}")


def _warn(sentence: str) -> None:
    print_note(f"robomark: {sentence}")
