"""Texts and faults of a stored recording, read without its ticks and pixels.

This avoids importing numpy, which takes longer than the rest of a report in words. ``recordings.py`` defines the format
and reads whole recordings.
"""

from __future__ import annotations

import io
import json
import zlib
from typing import Any
from zipfile import BadZipFile, ZipFile

from service.store.codec import decode, decode_arguments
from sim.recording import COLUMNS, Image, Recording, Ticks

#: New names of fields in recordings that earlier releases stored.
_NEW_FIELD_NAMES = {"walls": "sandbox", "patches": "label_patches"}
_EMPTY_COLUMNS: dict[str, Any] = dict.fromkeys((each.name for each in COLUMNS), ())


class RecordingError(ValueError):
    """Bytes that are not a recording."""


def texts_from_bytes(data: bytes) -> Recording:
    """Decode a recording without ticks and pixels. Raises RecordingError if the bytes are not one."""
    try:
        with ZipFile(io.BytesIO(zlib.decompress(data))) as kept:
            words = json.loads(_read_array(kept, "words"))
            partner = texts_from_bytes(_read_array(kept, "partner")) if "partner.npy" in kept.namelist() else None
        ticks = Ticks(**_EMPTY_COLUMNS, **words.pop("ticks"))
        images = tuple(decode(Image, image) for image in words.pop("images"))
        return build_recording(words, ticks, images, partner)
    except (ValueError, KeyError, TypeError, zlib.error, OSError, BadZipFile) as error:
        raise RecordingError(f"not a recording: {error}") from error


def build_recording(
    words: dict[str, Any], ticks: Ticks, images: tuple[Image, ...], partner: Recording | None
) -> Recording:
    """Build a recording from its texts, as written by any release."""
    words = {_NEW_FIELD_NAMES.get(name, name): value for name, value in words.items()}
    for message in words.get("messages", ()):
        if message.get("note") == "lost":  # earlier releases have no other reason
            message.setdefault("lost", "chance")
    return Recording(**decode_arguments(Recording, words), ticks=ticks, images=images, partner=partner)


def _read_array(kept: ZipFile, name: str) -> bytes:
    """Return the bytes of an array, without its header."""
    array = kept.read(f"{name}.npy")
    return array[10 + int.from_bytes(array[8:10], "little") :]
