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
        with ZipFile(io.BytesIO(zlib.decompress(data))) as archive:
            metadata = json.loads(_read_array(archive, "words"))
            partner = texts_from_bytes(_read_array(archive, "partner")) if "partner.npy" in archive.namelist() else None
        ticks = Ticks(**_EMPTY_COLUMNS, **metadata.pop("ticks"))
        images = tuple(decode(Image, image) for image in metadata.pop("images"))
        return build_recording(metadata, ticks, images, partner)
    except (ValueError, KeyError, TypeError, zlib.error, OSError, BadZipFile) as error:
        raise RecordingError(f"not a recording: {error}") from error


def build_recording(
    metadata: dict[str, Any], ticks: Ticks, images: tuple[Image, ...], partner: Recording | None
) -> Recording:
    """Build a recording from its texts, as written by any release."""
    metadata = {_NEW_FIELD_NAMES.get(name, name): value for name, value in metadata.items()}
    for message in metadata.get("messages", ()):
        if message.get("note") == "lost":  # earlier releases have no other reason
            message.setdefault("lost", "chance")
    return Recording(**decode_arguments(Recording, metadata), ticks=ticks, images=images, partner=partner)


def _read_array(archive: ZipFile, name: str) -> bytes:
    """Return the bytes of an array, without its header."""
    array = archive.read(f"{name}.npy")
    return array[10 + int.from_bytes(array[8:10], "little") :]
