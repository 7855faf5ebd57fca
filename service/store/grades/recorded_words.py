"""What was said and what went wrong in a recording that is kept, read without its ticks and pixels.

So it does without numpy, which takes longer to load than all else that telling it needs. How a recording is kept, and
the whole of it, is ``recordings.py``'s.
"""

from __future__ import annotations

import io
import json
import zlib
from typing import Any
from zipfile import BadZipFile, ZipFile

from service.store.codec import decode, decoded_arguments
from sim.recording import COLUMNS, Image, Recording, Ticks

#: What fields are called in recordings that earlier releases kept.
_FORMERLY = {"walls": "sandbox", "patches": "label_patches"}
_UNREAD: dict[str, Any] = dict.fromkeys((each.name for each in COLUMNS), ())


class RecordingError(ValueError):
    """Bytes that are no recording."""


def words_from_bytes(data: bytes) -> Recording:
    """The recording as if it had no ticks and its images no pixels. Raises RecordingError if the bytes are not one."""
    try:
        with ZipFile(io.BytesIO(zlib.decompress(data))) as kept:
            words = json.loads(_content(kept, "words"))
            partner = words_from_bytes(_content(kept, "partner")) if "partner.npy" in kept.namelist() else None
        ticks = Ticks(**_UNREAD, **words.pop("ticks"))
        images = tuple(decode(Image, image) for image in words.pop("images"))
        return with_words(words, ticks, images, partner)
    except (ValueError, KeyError, TypeError, zlib.error, OSError, BadZipFile) as error:
        raise RecordingError(f"not a recording: {error}") from error


def with_words(words: dict[str, Any], ticks: Ticks, images: tuple[Image, ...], partner: Recording | None) -> Recording:
    """The recording that has these words, as any release wrote them."""
    words = {_FORMERLY.get(name, name): value for name, value in words.items()}
    for message in words.get("messages", ()):
        if message.get("note") == "lost":  # earlier releases knew no other reason
            message.setdefault("lost", "chance")
    return Recording(**decoded_arguments(Recording, words), ticks=ticks, images=images, partner=partner)


def _content(kept: ZipFile, name: str) -> bytes:
    """The bytes of an array, after what says that they are bytes."""
    array = kept.read(f"{name}.npy")
    return array[10 + int.from_bytes(array[8:10], "little") :]
