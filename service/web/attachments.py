"""Files that a browser keeps and never shows, by names that are safe in a header and on every disk."""

from __future__ import annotations

import re
from urllib.parse import quote

from fastapi.responses import Response


def attachment(data: bytes, name: str, media_type: str = "application/octet-stream") -> Response:
    """The answer that has a browser save a file; ``name`` may be anything."""
    plain = re.sub(r"[^\w.-]+", "_", name, flags=re.ASCII).lstrip(".") or "file"
    whole = quote(name.encode("utf-8", "replace"), safe="")
    disposition = f"attachment; filename=\"{plain}\"; filename*=UTF-8''{whole}"
    return Response(data, media_type=media_type, headers={"content-disposition": disposition})
