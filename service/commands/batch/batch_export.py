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
_MAX_NAMED = 10


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
    export_format = FORMATS[form]
    if output is None and (
        export_format.archive is not None or (export_format.table is None and export_format.document is not None)
    ):
        target_kind = "a folder" if export_format.document is not None else "a file"
        raise UsageError(f"{form} cannot be printed to a terminal; name {target_kind} with --output")
    if (export_format.worksheet is None) != (worksheet is None):
        raise UsageError("--worksheet and --format moodle-worksheet need each other; expected both or neither")
    has_separate_files = output is not None and _needs_separate_files(export_format, output)
    request = ExportRequest(
        form, published, None if worksheet is None else _read_worksheet(worksheet), has_separate_files
    )
    with open_installation() as (service, actor):
        stored_batch = batches.find(service, actor, batch)
        if export_format.archive is not None and output is not None:
            with user_permissions(), _open_file(output) as sink:
                result = export(service, actor, stored_batch.course_id, stored_batch.id, request, sink)
        else:
            result = export(service, actor, stored_batch.course_id, stored_batch.id, request)
    _warn_about_export(result)
    if export_format.archive is not None:
        _warn_about_omitted(result.left_over, "left out, because Moodle cannot match the student")
    elif has_separate_files and output is not None:
        _write_files(result, output)
    else:
        if worksheet is not None:
            _warn_about_omitted(result.left_over, f"not in {worksheet.name}")
        if output is None:
            sys.stdout.write(result.text)
        else:
            _write_file(output, result.text)


def _warn_about_export(result: Export) -> None:
    for line in result.for_staff:
        _warn(f"{line.student} is for staff only: {line.staff_only}; robomark show {line.id}")
    if result.waiting_regrades:
        _warn(f"{result.waiting_regrades} regrades are not published: these are the current grades")
    if unjudged := describe_unjudged(result.unjudged):
        _warn(unjudged)


def _read_worksheet(worksheet: Path) -> str:
    try:
        return worksheet.read_bytes().decode("utf-8")
    except OSError as error:
        raise UsageError(f"{worksheet} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise UsageError(f"{worksheet} is not UTF-8; expected the file as downloaded from Moodle") from None


def _needs_separate_files(export_format: Format, output: Path) -> bool:
    """Return whether to write one file for each submission into the folder ``output``.

    The format must have a document for one grade. If it also has a table, ``output`` must be a folder, or must neither
    exist
    nor have a suffix.
    """
    if export_format.document is None:
        return False
    return export_format.table is None or output.is_dir() or (not output.suffix and not output.exists())


def _write_files(result: Export, folder: Path) -> None:
    try:
        with user_permissions():
            folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder} cannot be made: {error.strerror}") from None
    for name, text in result.files:
        _write_file(folder / name, text)
    print_json(output=folder, files=len(result.files))
    print_line(f"{len(result.files)} files in {folder}")


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


def _warn_about_omitted(left_over: Sequence[str], reason: str) -> None:
    if left_over:
        names = ", ".join(left_over[:_MAX_NAMED]) + (" ..." if len(left_over) > _MAX_NAMED else "")
        _warn(f"{reason}: {names}")


def _warn(sentence: str) -> None:
    print_note(f"robomark: {sentence}")
