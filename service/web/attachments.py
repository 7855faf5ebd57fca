"""Downloads: responses that browsers save, with file names that are safe in headers and on all file systems."""

from __future__ import annotations

import re
from pathlib import PurePosixPath
from urllib.parse import quote

from fastapi.responses import Response

#: Maximum length of a file name. A character takes up to twelve bytes, and proxies limit headers to a few kilobytes.
_MAX_NAME_LENGTH = 150


def respond_with_attachment(data: bytes, name: str, media_type: str = "application/octet-stream") -> Response:
    """Return a response that the browser saves as a file. Any ``name`` is allowed; long names are shortened."""
    suffix = PurePosixPath(name).suffix[:20]
    name = name if len(name) <= _MAX_NAME_LENGTH else name[: _MAX_NAME_LENGTH - len(suffix)] + suffix
    ascii_name = re.sub(r"[^\w.-]+", "_", name, flags=re.ASCII).lstrip(".") or "file"
    quoted_name = quote(name.encode("utf-8", "replace"), safe="")
    disposition = f"attachment; filename=\"{ascii_name}\"; filename*=UTF-8''{quoted_name}"
    return Response(data, media_type=media_type, headers={"content-disposition": disposition})
