"""Zip reader that limits the number of entries before ``zipfile`` creates an object for each.

Callers check the entries' names and limit the bytes they read.
"""

from __future__ import annotations

import lzma
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import BinaryIO
from zipfile import ZipFile, ZipInfo

from sim.readers.reader_errors import TooManyValuesError, UnreadableDataError

__all__ = ["CHUNK", "PLAIN_COMPRESSION", "ZipFile", "ZipInfo", "is_zip", "open_zip", "read_entry_chunks"]

CHUNK = 64 * 1024
#: Other compression methods can allocate gigabytes before they return a byte.
PLAIN_COMPRESSION = frozenset({zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED})
_ENTRY = b"PK\x01\x02"
#: Exceptions that ``zipfile`` and its decompressors raise for malicious archives.
_BROKEN = (
    zipfile.BadZipFile,
    zipfile.LargeZipFile,
    zlib.error,
    lzma.LZMAError,
    struct.error,
    EOFError,
    OverflowError,
    RuntimeError,
    NotImplementedError,
    UnicodeError,
    ValueError,
    IndexError,
    KeyError,
)


@contextmanager
def open_zip(source: BinaryIO, max_entries: int) -> Iterator[ZipFile]:
    """Open an archive as a context manager.

    Raises:
        UnreadableDataError: The data are not an archive or have more than ``max_entries`` entries. Entries of stored
            archives inside it count.
    """
    if _count_entries(source) > max_entries:
        raise TooManyValuesError("it has more than %(most)s files", most=max_entries)
    try:
        archive = ZipFile(source)
    except (*_BROKEN, OSError):
        raise UnreadableDataError("it is not a zip archive that can be read") from None
    with archive:
        yield archive


def is_zip(source: BinaryIO) -> bool:
    """Return whether the source contains an archive, regardless of its first bytes."""
    return _count_entries(source) > 0 and zipfile.is_zipfile(source)


def read_entry_chunks(archive: ZipFile, info: ZipInfo) -> Iterator[bytes]:
    """Yield the content of an entry in chunks.

    Raises:
        UnreadableDataError: The entry is damaged or uses an unusual compression method.
    """
    if info.compress_type not in PLAIN_COMPRESSION:
        raise UnreadableDataError("it is compressed in an unusual way")
    try:
        with archive.open(info) as stream:
            while chunk := stream.read(CHUNK):
                yield chunk
    except (*_BROKEN, OSError):
        raise UnreadableDataError("it is damaged in the archive") from None


def _count_entries(source: BinaryIO) -> int:
    """Return an upper bound for the number of entries: the number of entry signatures in the data."""
    source.seek(0)
    count, tail = 0, b""
    while chunk := source.read(1 << 20):
        count += (tail + chunk).count(_ENTRY)
        tail = chunk[-3:]
    source.seek(0)
    return count
