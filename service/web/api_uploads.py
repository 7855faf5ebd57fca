"""Uploads of the API: dependencies that read files only after the sender's permission is checked.

The modules that use the files validate their contents.
"""

from __future__ import annotations

import tempfile
from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from typing import Annotated, Any

from fastapi import Depends, Request
from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException

from submissions.raw_files import MAX_FILES, MAX_TOTAL_BYTES, MEGABYTE, UploadedFile

#: Maximum size of each kind of upload. The readers of the files limit their contents.
MAX_BATCH_BYTES = 200 * MEGABYTE
MAX_ASSIGNMENT_BYTES = 130 * MEGABYTE
MAX_SUBMISSION_BYTES = MAX_TOTAL_BYTES + 2 * MEGABYTE
MAX_TABLE_BYTES = 11 * MEGABYTE
_ZIP = "application/zip"
_ZIP_TYPES = (_ZIP, "application/x-zip-compressed", "application/octet-stream")
#: OpenAPI description of a body that is a zip.
ZIP_BODY: dict[str, Any] = {
    "requestBody": {"required": True, "content": {_ZIP: {"schema": {"type": "string", "format": "binary"}}}}
}


async def _receive_zip(request: Request) -> AsyncIterator[Path]:
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind not in _ZIP_TYPES:
        raise HTTPException(415, f"Expected a zip, sent as {_ZIP}; this is {kind[:100] or 'of no type'}.")
    with tempfile.TemporaryDirectory(prefix="robomark-upload-") as folder:
        path = Path(folder) / "upload.zip"
        with path.open("xb") as sink:
            async for chunk in request.stream():
                sink.write(chunk)
        yield path


#: An uploaded zip. Put it after the permission dependency, so that only permitted uploads are read.
UploadedZip = Annotated[Path, Depends(_receive_zip)]

_FORM = "multipart/form-data"
SENT_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {
            _FORM: {
                "schema": {
                    "type": "object",
                    "required": ["files"],
                    "properties": {
                        "files": {"type": "array", "minItems": 1, "items": {"type": "string", "format": "binary"}}
                    },
                }
            }
        },
    }
}


async def _receive_files(request: Request) -> AsyncIterator[Sequence[UploadedFile]]:
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != _FORM:
        raise HTTPException(415, f"Expected files as {_FORM}; this is {kind[:100] or 'of no type'}.")
    async with request.form(max_files=MAX_FILES, max_fields=10) as form:
        uploads = [each for each in form.getlist("files") if isinstance(each, UploadFile)]
        yield [UploadedFile(each.filename or "", each.file) for each in uploads]


#: The files of an uploaded form. The same order applies.
SentFiles = Annotated[Sequence[UploadedFile], Depends(_receive_files)]
