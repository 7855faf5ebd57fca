"""Lossless, compact format for recordings, which is read without executing code.

The bytes are a zlib-compressed npz with arrays, images as raw bytes, and one JSON text; never a pickle.
"""

from __future__ import annotations

import io
import json
import zlib
from dataclasses import dataclass, fields, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from service.store.codec import decode, encode
from service.store.grades.recording_texts import RecordingError, build_recording
from sim.columns import Column
from sim.recording import COLUMNS, Image, Recording, Ticks

#: Maximum compressed size of one grade's recordings, so that excessive output does not fill the database.
GRADE_BYTES = 64_000_000
#: Minimum size limit of one recording, regardless of their number.
MIN_RECORDING_BYTES = 256_000
_TEXT_KEPT = 2000
_NO_FLOODS, _NO_TEXTS, _NO_TICKS = (
    f"The recording was too large to be kept whole: {omission}."
    for omission in (
        f"its images and the texts after the first {_TEXT_KEPT} of each kind are left out",
        "what was printed, said and sent is left out",
        "its ticks are left out",
    )
)

_Bytes = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class StoredRecording:
    """A recording as stored: whole, or without the parts that were too large."""

    recording: Recording
    data: bytes


def compute_size_limit(trials: int) -> int:
    """Return the maximum size in bytes of each recording of a grade."""
    return max(MIN_RECORDING_BYTES, GRADE_BYTES // max(1, trials))


def encode_within_limit(recording: Recording, size_limit: int) -> StoredRecording:
    """Encode a recording within ``size_limit`` bytes; parts that do not fit are left out, with a note.

    Removed first are images and all but the first texts of each kind, then all texts, then the ticks. The verdict,
    faults, poses and chain hash are always kept.
    """
    data = to_bytes(recording)
    for trim_recording in (_drop_floods, _drop_texts, _drop_ticks):
        if len(data) <= size_limit:
            break
        if recording.partner is not None:
            recording = replace(recording, partner=trim_recording(recording.partner))
        recording = trim_recording(recording)
        data = to_bytes(recording)
    return StoredRecording(recording, data)


def is_whole(recording: Recording) -> bool:
    """Return whether a stored recording has all its parts."""
    return {_NO_FLOODS, _NO_TEXTS, _NO_TICKS}.isdisjoint(recording.notes)


def to_bytes(recording: Recording) -> bytes:
    """Return the whole recording, compressed."""
    ticks = recording.ticks
    metadata: dict[str, Any] = {
        field.name: encode(getattr(recording, field.name))
        for field in fields(recording)
        if field.name not in ("ticks", "images", "partner", "places")
    }
    metadata["ticks"] = _encode_tick_totals(ticks)
    metadata["images"] = [encode(replace(image, left=b"", right=b"")) for image in recording.images]
    arrays: dict[str, NDArray[Any]] = {
        "words": _to_byte_array(json.dumps(metadata, separators=(",", ":")).encode("ascii")),
        "picture_sizes": np.array([[len(i.left), len(i.right)] for i in recording.images], np.int64),
        "pictures": _to_byte_array(b"".join(i.left + i.right for i in recording.images)),
    }
    for column in COLUMNS:
        values = np.asarray(getattr(ticks, column.name), column.dtype)
        arrays[column.name] = _shuffle_bytes(values.reshape(-1, column.width))
    if recording.partner is not None:
        arrays["partner"] = _to_byte_array(to_bytes(recording.partner))
    buffer = io.BytesIO()
    np.savez(buffer, **cast(dict[str, Any], arrays))
    return zlib.compress(buffer.getvalue(), 6)


def from_bytes(data: bytes) -> Recording:
    """Decode a recording. Raises RecordingError if the bytes are not one."""
    try:
        with np.load(io.BytesIO(zlib.decompress(data)), allow_pickle=False) as arrays:
            metadata = json.loads(bytes(arrays["words"]))
            pixels = bytes(arrays["pictures"])
            partner = from_bytes(bytes(arrays["partner"])) if "partner" in arrays else None
            sizes = arrays["picture_sizes"].reshape(-1, 2).tolist()
            # The recording may be older than a column.
            columns = {each.name: _decode_column(arrays[each.name], each) for each in COLUMNS if each.name in arrays}
        ticks = Ticks(**cast(dict[str, Any], columns), **metadata.pop("ticks"))
        images = _restore_pixels(metadata.pop("images"), sizes, pixels)
        return build_recording(metadata, ticks, images, partner)
    except (ValueError, KeyError, TypeError, zlib.error, OSError) as error:
        raise RecordingError(f"not a recording: {error}") from error


def _encode_tick_totals(ticks: Ticks) -> dict[str, int]:
    return {"left_pixels": ticks.left_pixels, "right_pixels": ticks.right_pixels, "length": ticks.length}


def _restore_pixels(images: list[Any], sizes: list[list[int]], pixels: bytes) -> tuple[Image, ...]:
    restored_images = []
    offset = 0
    for image_values, (left_size, right_size) in zip(images, sizes, strict=True):
        split_offset, end_offset = offset + left_size, offset + left_size + right_size
        image = decode(Image, image_values)
        restored_images.append(replace(image, left=pixels[offset:split_offset], right=pixels[split_offset:end_offset]))
        offset = end_offset
    return tuple(restored_images)


def _to_byte_array(data: bytes) -> _Bytes:
    return np.frombuffer(data, np.uint8)


def _shuffle_bytes(columns: NDArray[Any]) -> _Bytes:
    """Convert (n, c) 8-byte numbers to (c, 8, n) bytes: bit pattern differences, grouped by byte position.

    Halves the compressed size of a path. Lossless, because the differences wrap around.
    """
    rows, count = columns.shape
    patterns = np.ascontiguousarray(columns.T).view(np.uint64)
    steps = np.diff(patterns, axis=1, prepend=np.zeros((count, 1), np.uint64))
    return np.ascontiguousarray(steps.view(np.uint8).reshape(count, rows, 8).transpose(0, 2, 1))


def _unshuffle_bytes(data: _Bytes, kind: type[np.generic]) -> NDArray[Any]:
    count, _, rows = data.shape
    steps = np.ascontiguousarray(data.transpose(0, 2, 1)).reshape(count, rows * 8).view(np.uint64)
    return np.ascontiguousarray(np.cumsum(steps, axis=1, dtype=np.uint64).view(kind).T)


def _decode_column(data: _Bytes, column: Column) -> NDArray[Any]:
    values = _unshuffle_bytes(data, column.dtype)
    return (values if column.width > 1 else values[:, 0]).copy()


def _drop_floods(recording: Recording) -> Recording:
    return replace(
        recording,
        images=(),
        image_log=(),
        calls=recording.calls[:_TEXT_KEPT],
        printed=recording.printed[:_TEXT_KEPT],
        datalog=recording.datalog[:_TEXT_KEPT],
        messages=recording.messages[:_TEXT_KEPT],
        agent_messages=recording.agent_messages[:_TEXT_KEPT],
        notes=(*recording.notes, _NO_FLOODS),
    )


def _drop_texts(recording: Recording) -> Recording:
    outputs = (
        replace(each, printed=each.printed[:_TEXT_KEPT], log=each.log[:_TEXT_KEPT]) for each in recording.agent_outputs
    )
    return replace(
        recording,
        calls=(),
        printed=(),
        spoken=(),
        datalog=(),
        messages=(),
        pen=(),
        touches=(),
        notes=(_NO_TEXTS,),
        responder_output=recording.responder_output[:_TEXT_KEPT],
        responder_log=recording.responder_log[:_TEXT_KEPT],
        faults=recording.faults[:10],
        agent_messages=(),
        agent_outputs=tuple(outputs),
    )


def _drop_ticks(recording: Recording) -> Recording:
    ticks = Ticks(**cast(dict[str, Any], {"x": np.empty(0), **_encode_tick_totals(recording.ticks)}))
    return replace(recording, ticks=ticks, notes=(*recording.notes, _NO_TICKS))
