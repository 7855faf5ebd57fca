"""Extraction of untrusted archives, with limits on files and bytes, and only into the given folder.

Callers interpret the files.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path, PurePosixPath

from sim.errors import UsageError
from sim.readers.reader_errors import UnreadableDataError
from sim.readers.zip_archive import ZipFile, open_zip, read_entry_chunks
from submissions.raw_files import sanitise_name

#: Maximum number of folders above a file. Each folder costs time, and the time to create them grows with their depth.
_DEEPEST = 20


def unzip(path: Path, folder: Path, max_entries: int, max_bytes: int) -> None:
    """Extract a zip into a folder, as regular files and folders only.

    Raises:
        UsageError: The archive cannot be extracted.
    """
    try:
        # The limit also counts folder entries and entries of stored archives.
        with path.open("rb") as source, open_zip(source, 2 * max_entries) as archive:
            _extract_into(archive, folder, path.name, max_entries, max_bytes)
    except FileExistsError as error:
        double = sanitise_name(str(Path(error.filename).relative_to(folder)))
        raise UsageError(f"{path.name}: holds two files of the same name, {double}.") from None
    except UnreadableDataError as error:
        raise UsageError(f"{path.name}: cannot be unpacked: {error}.") from None
    except OSError as error:
        free_bytes = shutil.disk_usage(folder).free
        raise UsageError(f"{path.name}: cannot be unpacked: {error.strerror} ({free_bytes >> 20} MB free).") from None


def _extract_into(archive: ZipFile, folder: Path, name: str, max_entries: int, max_bytes: int) -> None:
    remaining_bytes = max_bytes
    infos = [info for info in archive.infolist() if not info.is_dir()]
    if len(infos) > max_entries:
        raise UsageError(f"{name}: holds {len(infos)} files, expected at most {max_entries}.")
    for info in infos:
        target = _resolve_target(folder, info.filename, name)
        target.parent.mkdir(parents=True, exist_ok=True)
        with target.open("xb") as sink:
            for chunk in read_entry_chunks(archive, info):
                remaining_bytes -= len(chunk)
                if remaining_bytes < 0:
                    raise UsageError(f"{name}: unpacks to more than {_format_amount(max_bytes)}.")
                sink.write(chunk)


def _resolve_target(folder: Path, name: str, archive: str) -> Path:
    parts = PurePosixPath(name.replace("\\", "/")).parts
    if not parts or parts[0] == "/" or ".." in parts or any(os.fsencode(part)[-1:] == b":" for part in parts):
        raise UsageError(f"{archive}: holds a file that would lie outside it: {sanitise_name(name)}.")
    if len(parts) - 1 > _DEEPEST:
        raise UsageError(f"{archive}: holds a file in more than {_DEEPEST} folders: {sanitise_name(name)}.")
    return folder.joinpath(*parts)


def _format_amount(count: int) -> str:
    return f"{count // 10**9} GB" if count >= 10**9 else f"{count // 10**6} MB"
