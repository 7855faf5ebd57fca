"""Files that a browser keeps and never shows, by names that are safe in a header and on every disk."""

from __future__ import annotations

import re
from pathlib import PurePosixPath
from urllib.parse import quote

from fastapi.responses import Response

#: Of a file's name; proxies refuse headers of a few kilobytes, and a character takes up to twelve bytes.
_LONGEST = 150


def attachment(data: bytes, name: str, media_type: str = "application/octet-stream") -> Response:
    """The answer that has a browser save a file; ``name`` may be anything, and is shortened if it is long."""
    suffix = PurePosixPath(name).suffix[:20]
    name = name if len(name) <= _LONGEST else name[: _LONGEST - len(suffix)] + suffix
    plain = re.sub(r"[^\w.-]+", "_", name, flags=re.ASCII).lstrip(".") or "file"
    whole = quote(name.encode("utf-8", "replace"), safe="")
    disposition = f"attachment; filename=\"{plain}\"; filename*=UTF-8''{whole}"
    return Response(data, media_type=media_type, headers={"content-disposition": disposition})
