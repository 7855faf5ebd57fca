"""A file that is sent as the body of a request, laid into a folder of its own while it is answered."""

from __future__ import annotations

import tempfile
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Annotated, Any

from fastapi import Depends, Request
from starlette.exceptions import HTTPException

_ZIP = "application/zip"
_ZIPS = (_ZIP, "application/x-zip-compressed", "application/octet-stream")
#: How the description tells of such a body.
ZIP_BODY: dict[str, Any] = {
    "requestBody": {"required": True, "content": {_ZIP: {"schema": {"type": "string", "format": "binary"}}}}
}


async def _uploaded(request: Request) -> AsyncIterator[Path]:
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind not in _ZIPS:
        raise HTTPException(415, f"Expected a zip, sent as {_ZIP}; this is {kind[:100] or 'of no type'}.")
    with tempfile.TemporaryDirectory(prefix="robomark-upload-") as folder:
        path = Path(folder) / "upload.zip"
        with path.open("xb") as sink:
            async for chunk in request.stream():
                sink.write(chunk)
        yield path


#: A zip, for routes that take one; stands behind who may send it, so that nobody else's is read.
Uploaded = Annotated[Path, Depends(_uploaded)]
