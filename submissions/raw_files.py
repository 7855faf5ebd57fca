"""Files of a submission from a folder or zip archive, by flat name, with limits and without trust in the content.

``bundle.py`` interprets the files. Nothing is unpacked to disk, followed or executed here.
"""

from __future__ import annotations

import contextlib
import os
import stat
import unicodedata
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from sim.errors import UsageError
from sim.readers.reader_errors import TooManyValuesError, UnreadableDataError
from sim.readers.zip_archive import CHUNK, PLAIN_COMPRESSION, ZipFile, ZipInfo, open_zip, read_entry_chunks
from sim.sentences import Sentence

MEGABYTE = 1024 * 1024
MAX_TOTAL_BYTES = 32 * MEGABYTE
MAX_FILE_BYTES = 16 * MEGABYTE
MAX_FILES = 256
_MAX_NAME_BYTES = 200

#: Files that tools and systems create. They are ignored in every folder.
_IGNORED_NAMES = {"__MACOSX", "__pycache__", "Thumbs.db", "desktop.ini", "Icon\r"}
_EXPECTED_FLAT = Sentence("expected robot.py, responder.py and the files they use side by side")


@dataclass(frozen=True, slots=True)
class RawFiles:
    """Flat names and bytes, and notes on files that were omitted or folders that were entered."""

    files: dict[str, bytes]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class UploadedFile:
    """A file as submitted; its name is arbitrary."""

    name: str
    stream: BinaryIO

    @property
    def flat_name(self) -> str:
        """The name without folders."""
        return self.name.replace("\\", "/").rpartition("/")[2]


@dataclass(slots=True)
class _Budget:
    """Size and number of the files read so far, compared with the limits."""

    where: str
    total: int = 0
    count: int = 0

    def count_file(self) -> None:
        self.count += 1
        if self.count > MAX_FILES:
            raise UsageError(
                "%(where)s: has too many files, expected at most %(most)s.", where=self.where, most=MAX_FILES
            )

    def read(self, name: str, stream: BinaryIO) -> bytes:
        """Read all of ``stream``. Bytes are counted while reading, because its claimed size is not trusted."""
        return self.join(name, iter(lambda: stream.read(CHUNK), b""))

    def join(self, name: str, incoming: Iterator[bytes]) -> bytes:
        """Join the chunks of a file and count them while reading."""
        chunks = []
        size = 0
        for chunk in incoming:
            size += len(chunk)
            self.total += len(chunk)
            if size > MAX_FILE_BYTES:
                raise UsageError(self._describe_too_large(name))
            if self.total > MAX_TOTAL_BYTES:
                raise UsageError(
                    "%(where)s: is too large, expected at most %(most)s MB in all.",
                    where=self.where,
                    most=MAX_TOTAL_BYTES // MEGABYTE,
                )
            chunks.append(chunk)
        return b"".join(chunks)

    def _describe_too_large(self, name: str) -> Sentence:
        notebook = name.lower().endswith(".ipynb")
        values = {
            "what": _format_location(self.where, sanitise_name(name)),
            "most": MAX_FILE_BYTES // MEGABYTE,
            "advice": Sentence("; clear its outputs before you save it") if notebook else "",
        }
        return Sentence("%(what)s is too large, expected at most %(most)s MB a file%(advice)s.", **values)


def _format_location(source_name: str, name: str) -> str:
    """Return the file with its container, or only the file if both names are the same."""
    return f"{source_name}:" if source_name == name else f"{source_name}: {name}"


def _build_duplicate_error(source_name: str, name: str) -> UsageError:
    if source_name == name:
        return UsageError("%(where)s: is included twice, expected every file once.", where=source_name)
    return UsageError("%(where)s: has %(name)s twice, expected every file once.", where=source_name, name=name)


def sanitise_name(name: str) -> str:
    """Return a student's file name in a safe and short form for messages."""
    clean = "".join("?" if unicodedata.category(c)[0] in "CZ" and c != " " else c for c in name)
    return clean if len(clean) <= 80 else clean[:77] + "..."


def read_single_file(path: Path) -> bytes:
    """Return the bytes of one regular file.

    Raises:
        UsageError: It is not a regular file, or it is too large.
    """
    budget = _Budget(sanitise_name(path.name))
    with _open_regular_file(path.name, os.fspath(path), None) as stream:
        return budget.read(path.name, stream)


def read_folder(path: Path) -> RawFiles:
    """Read the files in a folder, or in the only folder inside it. Links and devices are never opened.

    Raises:
        UsageError: There are nested folders, or the submission exceeds a limit on number or size of files.
    """
    source_name = sanitise_name(path.name)
    notes: list[str] = []
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError as error:
        raise UsageError(
            "%(where)s: cannot be opened (%(reason)s), expected a readable folder.",
            where=source_name,
            reason=error.strerror,
        ) from None
    try:
        names, folders = _list_folder(descriptor, source_name, notes)
        if not names and len(folders) == 1:
            inner_descriptor = os.open(folders[0], os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW, dir_fd=descriptor)
            os.close(descriptor)
            descriptor = inner_descriptor
            notes.append(f"The files were read from the folder {sanitise_name(folders[0])} in it.")
            names, folders = _list_folder(descriptor, source_name, notes)
        if folders:
            raise UsageError(
                "%(where)s: has the folder %(name)s in it, %(expected)s.",
                where=source_name,
                name=sanitise_name(folders[0]),
                expected=_EXPECTED_FLAT,
            )
        budget = _Budget(source_name)
        files = {}
        for name in names:
            _check_name(source_name, name)
            budget.count_file()
            with _open_regular_file(f"{source_name}/{name}", name, descriptor) as stream:
                files[name] = budget.read(name, stream)
        return _expand_single_archive(RawFiles(files, tuple(notes)))
    except OSError as error:
        raise UsageError(
            "%(where)s: cannot be read (%(reason)s), expected a readable folder.",
            where=source_name,
            reason=error.strerror,
        ) from None
    finally:
        os.close(descriptor)


def read_paths(paths: Mapping[str, Path], source_name: str) -> RawFiles:
    """Read the files at ``paths`` under the given names.

    Raises:
        UsageError: As for ``read_folder``.
    """
    budget = _Budget(source_name)
    files = {}
    for name, path in paths.items():
        _check_name(source_name, name)
        budget.count_file()
        with _open_regular_file(f"{source_name}/{name}", os.fspath(path), None) as stream:
            files[name] = budget.read(name, stream)
    return _expand_single_archive(RawFiles(files))


def read_uploaded(uploads: Iterable[UploadedFile], source_name: str) -> RawFiles:
    """Read submitted files by their flat names.

    Raises:
        UsageError: As for ``read_folder``.
    """
    budget = _Budget(source_name)
    files: dict[str, bytes] = {}
    for upload in uploads:
        name = upload.flat_name
        if _is_ignored([name]):
            continue
        _check_name(source_name, name)
        if name in files:
            raise _build_duplicate_error(source_name, sanitise_name(name))
        budget.count_file()
        files[name] = budget.read(name, upload.stream)
    return _expand_single_archive(RawFiles(files))


def _expand_single_archive(raw: RawFiles) -> RawFiles:
    """Replace a single archive by its files, unless there is code beside it."""
    archives = [name for name in raw.files if name.lower().endswith(".zip")]
    if len(archives) != 1 or any(name.lower().endswith((".py", ".ipynb")) for name in raw.files):
        return raw
    archive_files = read_zip_bytes(raw.files[archives[0]], sanitise_name(archives[0]))
    other_files = {name: data for name, data in raw.files.items() if name != archives[0]}
    note = f"The files were read from the archive {sanitise_name(archives[0])} in it."
    return RawFiles({**other_files, **archive_files.files}, (*raw.notes, note, *archive_files.notes))


def read_zip(path: Path) -> RawFiles:
    """Read the files in a zip archive, in its only top folder, or in the only archive inside it.

    Raises:
        UsageError: The archive is not a plain archive of flat files. Examples are paths outside it, links, encrypted or
            nested entries, repeated names, and files that exceed the limits once decompressed.
    """
    return _expand_single_archive(read_zip_bytes(read_single_file(path), sanitise_name(path.name)))


def read_zip_bytes(data: bytes, source_name: str) -> RawFiles:
    """Read an archive's bytes as ``read_zip`` does; ``source_name`` names it in messages."""
    if not data:
        raise UsageError(
            "%(where)s: is an empty file, expected a zip archive with robot.py and responder.py.", where=source_name
        )
    with _opened(data, source_name) as archive:
        entries = _check_entries(archive.infolist(), source_name)
        notes: list[str] = []
        top_names = {parts[0] for parts, _ in entries}
        if len(top_names) == 1 and all(len(parts) > 1 for parts, _ in entries):
            notes.append(f"The files were read from the folder {sanitise_name(next(iter(top_names)))} in it.")
            entries = [(parts[1:], info) for parts, info in entries]
        budget = _Budget(source_name)
        files: dict[str, bytes] = {}
        for parts, info in entries:
            if len(parts) > 1:
                raise UsageError(
                    "%(where)s: has %(name)s in a folder, %(expected)s.",
                    where=source_name,
                    name=sanitise_name("/".join(parts)),
                    expected=_EXPECTED_FLAT,
                )
            if parts[0] in files:
                raise _build_duplicate_error(source_name, sanitise_name(parts[0]))
            budget.count_file()
            try:
                files[parts[0]] = budget.join(parts[0], read_entry_chunks(archive, info))
            except UnreadableDataError:
                raise UsageError(
                    "%(where)s: %(name)s is damaged in the archive, expected one that unpacks without errors.",
                    where=source_name,
                    name=sanitise_name(parts[0]),
                ) from None
    return RawFiles(files, tuple(notes))


@contextlib.contextmanager
def _opened(data: bytes, source_name: str) -> Iterator[ZipFile]:
    with contextlib.ExitStack() as stack:
        try:
            # The limit also covers ignored entries and those of stored archives.
            archive = stack.enter_context(open_zip(BytesIO(data), 8 * MAX_FILES))
        except TooManyValuesError:
            raise UsageError(
                "%(where)s: has too many files, expected at most %(most)s.", where=source_name, most=MAX_FILES
            ) from None
        except UnreadableDataError:
            raise UsageError(
                "%(where)s: is not a zip archive that can be read, expected an ordinary .zip.", where=source_name
            ) from None
        yield archive


def _check_entries(infos: Iterable[ZipInfo], source_name: str) -> list[tuple[tuple[str, ...], ZipInfo]]:
    """Return the path parts of every relevant file. Malicious entries are rejected before any is read."""
    entries = []
    for info in infos:
        original = info.orig_filename.replace("\\", "/")
        parts = tuple(part for part in original.split("/") if part not in ("", "."))
        if original.startswith("/") or ".." in parts or any(len(p) > 1 and p[1] == ":" for p in parts[:1]):
            raise UsageError(
                "%(where)s: has an entry that leads outside (%(name)s), expected plain file names.",
                where=source_name,
                name=sanitise_name(original),
            )
        kind = stat.S_IFMT(info.external_attr >> 16)
        if kind == stat.S_IFLNK:
            raise UsageError(
                "%(where)s: contains a link (%(name)s), expected the file itself.",
                where=source_name,
                name=sanitise_name(original),
            )
        if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
            raise UsageError(
                "%(where)s: contains an entry that is not a file (%(name)s), expected files.",
                where=source_name,
                name=sanitise_name(original),
            )
        if info.flag_bits & (0x1 | 0x40 | 0x2000):
            raise UsageError(
                "%(where)s: is encrypted (%(name)s), expected a zip without a password.",
                where=source_name,
                name=sanitise_name(original),
            )
        if original.endswith("/") or kind == stat.S_IFDIR or not parts or _is_ignored(parts):
            continue
        for part in parts:
            _check_name(source_name, part)
        if info.compress_type not in PLAIN_COMPRESSION:
            raise UsageError(
                "%(where)s: %(name)s is compressed in an unusual way, expected an ordinary .zip.",
                where=source_name,
                name=sanitise_name(original),
            )
        entries.append((parts, info))
    return entries


def _is_ignored(parts: Iterable[str]) -> bool:
    return any(part.startswith(".") or part in _IGNORED_NAMES for part in parts)


def _check_name(source_name: str, name: str) -> None:
    try:
        length = len(name.encode())
    except UnicodeEncodeError:
        length = 0
    if not 0 < length <= _MAX_NAME_BYTES or any(unicodedata.category(c) == "Cc" for c in name):
        raise UsageError(
            "%(where)s: has a file name that cannot be used (%(name)s), expected printable characters, "
            "at most %(most)s bytes.",
            where=source_name,
            name=sanitise_name(name),
            most=_MAX_NAME_BYTES,
        )
    if "\\" in name or ":" in name:
        raise UsageError(
            "%(where)s: has a file name with a backslash or a colon in it (%(name)s), expected a name that every "
            "system can have: rename the file.",
            where=source_name,
            name=sanitise_name(name),
        )


def _list_folder(descriptor: int, source_name: str, notes: list[str]) -> tuple[list[str], list[str]]:
    """Return the names of regular files and of folders, sorted. Other entries are omitted with a note."""
    files, folders = [], []
    with os.scandir(descriptor) as entries:
        for number, entry in enumerate(entries):
            if number > 64 * MAX_FILES:
                raise UsageError(
                    "%(where)s: has too many files, expected at most %(most)s.", where=source_name, most=MAX_FILES
                )
            if _is_ignored([entry.name]):
                continue
            if entry.is_dir(follow_symlinks=False):
                folders.append(entry.name)
            elif entry.is_file(follow_symlinks=False):
                files.append(entry.name)
            elif entry.is_symlink():
                notes.append(f"{sanitise_name(entry.name)} is a link and was left out.")
            else:
                notes.append(f"{sanitise_name(entry.name)} is not a regular file and was left out.")
    return sorted(files), sorted(folders)


def _open_regular_file(source_name: str, name: str, folder: int | None) -> contextlib.AbstractContextManager[BinaryIO]:
    """Open a file without following links, and without blocking on a pipe."""
    try:
        descriptor = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, dir_fd=folder)
    except OSError as error:
        raise UsageError(
            "%(where)s: cannot be opened (%(reason)s), expected a readable file.",
            where=sanitise_name(source_name),
            reason=error.strerror,
        ) from None
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise UsageError(
            "%(where)s: is not a regular file, expected a readable file.", where=sanitise_name(source_name)
        )
    return os.fdopen(descriptor, "rb")
