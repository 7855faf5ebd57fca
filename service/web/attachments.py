"""Downloads: responses that browsers save, with file names that are safe in headers and on all file systems."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from pathlib import PurePosixPath
from typing import BinaryIO
from urllib.parse import quote

from fastapi.responses import Response, StreamingResponse
from starlette.types import Receive, Scope, Send

from service.file_names import make_portable_name

#: Maximum length of a file name. A character takes up to twelve bytes, and proxies limit headers to a few kilobytes.
_MAX_NAME_LENGTH = 150
#: Longer downloads are sent from a temporary file, so that slow readers keep none of them in memory.
_MAX_BYTES_IN_MEMORY = 1 << 18
_CHUNK_BYTES = 1 << 16


class _FileResponse(StreamingResponse):
    """A response that sends a temporary file in chunks. The file is removed at the end, also if the reader leaves."""

    def __init__(self, data: bytes, media_type: str, headers: dict[str, str]) -> None:
        self._file: BinaryIO = tempfile.TemporaryFile()  # noqa: SIM115 - __call__ closes it
        try:
            self._file.write(data)
            self._file.seek(0)
        except BaseException:
            self._file.close()
            raise
        headers = {**headers, "content-length": str(len(data))}
        super().__init__(_read_chunks(self._file), media_type=media_type, headers=headers)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the file and remove it."""
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._file.close()


def respond_with_attachment(data: bytes, name: str, media_type: str = "application/octet-stream") -> Response:
    """Return a response that the browser saves as a file. Any ``name`` is allowed; long names are shortened."""
    headers = {"content-disposition": _build_disposition(name)}
    if len(data) > _MAX_BYTES_IN_MEMORY:
        return _FileResponse(data, media_type, headers)
    return Response(data, media_type=media_type, headers=headers)


def _build_disposition(name: str) -> str:
    suffix = PurePosixPath(name).suffix[:20]
    name = name if len(name) <= _MAX_NAME_LENGTH else name[: _MAX_NAME_LENGTH - len(suffix)] + suffix
    name = make_portable_name(name)
    ascii_name = re.sub(r"[^\w.-]+", "_", name, flags=re.ASCII).lstrip(".") or "file"
    ascii_name = make_portable_name(ascii_name).replace("~", "_")
    quoted_name = quote(name.encode("utf-8", "replace"), safe="")
    return f"attachment; filename=\"{ascii_name}\"; filename*=UTF-8''{quoted_name}"


def _read_chunks(file: BinaryIO) -> Iterator[bytes]:
    while chunk := file.read(_CHUNK_BYTES):
        yield chunk
