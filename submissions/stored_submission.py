"""Storage format of a submission: packing to bytes and unpacking. Submitted files are not read here."""

from __future__ import annotations

import dataclasses
import json
import zipfile
from io import BytesIO
from types import MappingProxyType

from responders.source_file import SourceFile
from sim.errors import UsageError
from sim.readers.reader_errors import UnreadableDataError
from sim.readers.zip_archive import open_zip, read_entry_chunks
from submissions.notebook import pack_notebook, read_notebook
from submissions.raw_files import MAX_FILES
from submissions.submission import META_FILE, PART_FILES, Part, Submission, get_meta_run, parse_meta

_STORED_NAME = "the stored submission"
_PACKED_NOTEBOOK = "notebook.ipynb"
_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest time in the zip format


def pack_submission(submission: Submission) -> bytes:
    """Return the submission as a zip archive, which is reproducible and can be submitted again.

    The parts are called robot.py and responder.py. submission.toml stores the student, the assignment, the notes and
    the original names of the parts.
    """
    meta = [f"student = {_format_toml_text(submission.student)}"]
    if submission.assignment is not None:
        meta.append(f"assignment = {_format_toml_text(submission.assignment)}")
    if submission.run is not None:
        meta.append(f"run = {_format_toml_text(submission.run)}")
    meta.append(f"notes = [{', '.join(map(_format_toml_text, submission.notes))}]")
    entries = dict(submission.files)
    for part, source in (("program", submission.program), ("responder", submission.responder)):
        if source is not None:
            meta.append(f"{part} = {_format_toml_text(source.name)}")
            entries[PART_FILES[part]] = source.text.encode("utf-8", "surrogatepass")  # type: ignore[index]
    if submission.notebook is not None:
        meta.append(f"notebook = {_format_toml_text(submission.notebook.name)}")
        entries[_PACKED_NOTEBOOK] = pack_notebook(submission.notebook)
    entries[META_FILE] = "\n".join([*meta, ""]).encode()
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        for name in sorted(entries):
            info = zipfile.ZipInfo(name, _EPOCH)
            info.external_attr = 0o100644 << 16
            info.create_system = 3
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, entries[name])
    return buffer.getvalue()


def unpack_submission(data: bytes) -> Submission:
    """Return the submission that ``pack_submission`` packed.

    Limits and name rules of intake do not apply here, so that every accepted submission can be read again.

    Raises:
        UsageError: The bytes are not a packed submission.
    """
    files = _read_entries(data)
    meta = parse_meta(files.pop(META_FILE, b""), _STORED_NAME)
    sources: dict[Part, SourceFile | None] = {}
    for part, canonical in PART_FILES.items():
        name = meta.get(part)
        text = files.pop(canonical, None) if isinstance(name, str) else None
        sources[part] = None if text is None else SourceFile(str(name), text.decode("utf-8", "surrogatepass"))
    notebook = None
    if isinstance(meta.get("notebook"), str) and _PACKED_NOTEBOOK in files:
        packed_notebook = read_notebook(files.pop(_PACKED_NOTEBOOK), _PACKED_NOTEBOOK).notebook
        notebook = dataclasses.replace(packed_notebook, name=str(meta["notebook"]))
    notes = meta.get("notes", [])
    assignment = meta.get("assignment")
    return Submission(
        student=str(meta.get("student", "unnamed")),
        program=sources["program"],
        responder=sources["responder"],
        files=MappingProxyType(dict(sorted(files.items()))),
        assignment=assignment if isinstance(assignment, str) else None,
        notes=tuple(map(str, notes)) if isinstance(notes, list) else (),
        notebook=notebook,
        run=get_meta_run(meta, _STORED_NAME),
    )


def _read_entries(data: bytes) -> dict[str, bytes]:
    try:
        # The archive contains at most the accepted files and a few entries added by packing.
        with open_zip(BytesIO(data), 2 * MAX_FILES) as archive:
            return {info.orig_filename: b"".join(read_entry_chunks(archive, info)) for info in archive.infolist()}
    except UnreadableDataError:
        raise UsageError("%(where)s: is not a zip archive that can be read.", where=_STORED_NAME) from None


def _format_toml_text(text: str) -> str:
    """Return a TOML basic string. JSON has the same escapes, except for DEL."""
    printable = text.encode("utf-8", "replace").decode("utf-8")
    return json.dumps(printable, ensure_ascii=False).replace("\x7f", "\\u007f")
