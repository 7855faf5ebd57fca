"""Image reader that checks dimensions and number of scans before it decodes pixels."""

from __future__ import annotations

import io

from PIL import Image

from sim.readers.reader_errors import UnreadableDataError

#: Each scan of a progressive JPEG draws the whole image; encoders use about ten.
_MAX_SCANS = 64
_SCAN = b"\xff\xda"


def read_image(data: bytes, width: int, height: int) -> Image.Image:
    """Decode a PNG or JPEG image of exactly this size and return it as RGBA.

    Raises:
        UnreadableDataError: The bytes are not such an image, or the size differs. The message contains the size.
    """
    try:
        with Image.open(io.BytesIO(data), formats=("PNG", "JPEG")) as image:
            if image.size != (width, height):
                raise UnreadableDataError("it is %(width)s x %(height)s pixels", width=image.width, height=image.height)
            if image.format == "JPEG" and data.count(_SCAN) > _MAX_SCANS:
                raise UnreadableDataError("it has more than %(most)s scans", most=_MAX_SCANS)
            return image.convert("RGBA")
    except UnreadableDataError:
        raise
    except (OSError, SyntaxError, ValueError, MemoryError, Image.DecompressionBombError):
        raise UnreadableDataError("it cannot be read as PNG or JPEG") from None
