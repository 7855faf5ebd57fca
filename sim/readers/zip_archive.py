"""Zip archives, bounded by their entries before ``zipfile`` builds an object for each.

What an entry may be called and how many bytes may come out of it is the caller's to say; it reads them in chunks.
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

from sim.readers.unreadable import TooMany, Unreadable

__all__ = ["CHUNK", "PLAIN_COMPRESSION", "ZipFile", "ZipInfo", "entry_chunks", "is_zip", "open_zip"]

CHUNK = 64 * 1024
#: Others can ask for gigabytes before they give a byte.
PLAIN_COMPRESSION = frozenset({zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED})
_ENTRY = b"PK\x01\x02"
#: What ``zipfile`` and its decompressors raise on archives that were made to break them.
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
def open_zip(source: BinaryIO, most_entries: int) -> Iterator[ZipFile]:
    """Open an archive for as long as the block lasts.

    Raises Unreadable if it is none or has more than ``most_entries``, those of stored archives in it included.
    """
    if _entries(source) > most_entries:
        raise TooMany("it has more than %(most)s files", most=most_entries)
    try:
        archive = ZipFile(source)
    except (*_BROKEN, OSError):
        raise Unreadable("it is not a zip archive that can be read") from None
    with archive:
        yield archive


def is_zip(source: BinaryIO) -> bool:
    """Return whether there is an archive in the source, however it begins."""
    return _entries(source) > 0 and zipfile.is_zipfile(source)


def entry_chunks(archive: ZipFile, info: ZipInfo) -> Iterator[bytes]:
    """Yield what is in an entry, a chunk at a time. Raises Unreadable where it is damaged or unusually compressed."""
    if info.compress_type not in PLAIN_COMPRESSION:
        raise Unreadable("it is compressed in an unusual way")
    try:
        with archive.open(info) as stream:
            while chunk := stream.read(CHUNK):
                yield chunk
    except (*_BROKEN, OSError):
        raise Unreadable("it is damaged in the archive") from None


def _entries(source: BinaryIO) -> int:
    """How many entries the archive can have at most: how often their signature occurs."""
    source.seek(0)
    count, before = 0, b""
    while chunk := source.read(1 << 20):
        count += (before + chunk).count(_ENTRY)
        before = chunk[-3:]
    source.seek(0)
    return count
