"""Images, bounded by their size and by the passes over them, before a pixel is decoded."""

from __future__ import annotations

import io

from PIL import Image

from sim.readers.unreadable import Unreadable

#: A progressive JPEG draws the whole image once a scan; encoders use about ten.
_MOST_SCANS = 64
_SCAN = b"\xff\xda"


def read_image(data: bytes, width: int, height: int) -> Image.Image:
    """Return the decoded PNG or JPEG image of exactly this size, as RGBA.

    Raises Unreadable for other bytes, and for an image of another size, which it names.
    """
    try:
        with Image.open(io.BytesIO(data), formats=("PNG", "JPEG")) as image:
            if image.size != (width, height):
                raise Unreadable("it is %(width)s x %(height)s pixels", width=image.width, height=image.height)
            if image.format == "JPEG" and data.count(_SCAN) > _MOST_SCANS:
                raise Unreadable("it has more than %(most)s scans", most=_MOST_SCANS)
            return image.convert("RGBA")
    except Unreadable:
        raise
    except (OSError, SyntaxError, ValueError, MemoryError, Image.DecompressionBombError):
        raise Unreadable("it cannot be read as PNG or JPEG") from None
