"""Unpacks archives that strangers made, with bounds: so many files, so many bytes, none outside the folder.

What is in the files is for others to look at.
"""

from __future__ import annotations

import os
import shutil
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from sim.errors import UsageError
from submissions.raw_files import shown

_CHUNK = 1 << 20


def unzip(path: Path, folder: Path, most_entries: int, most_bytes: int) -> None:
    """Lay what is in a zip into a folder, as files and folders alone. Raises UsageError where that cannot be."""
    left = most_bytes
    try:
        with zipfile.ZipFile(path) as archive:
            infos = [info for info in archive.infolist() if not info.is_dir()]
            if len(infos) > most_entries:
                raise UsageError(f"{path.name}: holds {len(infos)} files, expected at most {most_entries}.")
            for info in infos:
                target = _target(folder, info.filename, path.name)
                target.parent.mkdir(parents=True, exist_ok=True)
                with archive.open(info) as source, target.open("xb") as sink:
                    while chunk := source.read(_CHUNK):
                        left -= len(chunk)
                        if left < 0:
                            raise UsageError(f"{path.name}: unpacks to more than {_amount(most_bytes)}.")
                        sink.write(chunk)
    except FileExistsError as error:
        double = shown(str(Path(error.filename).relative_to(folder)))
        raise UsageError(f"{path.name}: holds two files of the same name, {double}.") from None
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, NotImplementedError, ValueError) as error:
        raise UsageError(f"{path.name}: cannot be unpacked: {error}.") from None
    except OSError as error:
        free = shutil.disk_usage(folder).free
        raise UsageError(f"{path.name}: cannot be unpacked: {error.strerror} ({free >> 20} MB free).") from None


def _target(folder: Path, name: str, archive: str) -> Path:
    parts = PurePosixPath(name.replace("\\", "/")).parts
    if not parts or parts[0] == "/" or ".." in parts or any(os.fsencode(part)[-1:] == b":" for part in parts):
        raise UsageError(f"{archive}: holds a file that would lie outside it: {shown(name)}.")
    return folder.joinpath(*parts)


def _amount(count: int) -> str:
    return f"{count // 10**9} GB" if count >= 10**9 else f"{count // 10**6} MB"
