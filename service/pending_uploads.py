"""Uploads that wait for confirmation. They are kept in the home folder for a day, or until the sender decides.

``web/batch_uploads.py`` reads them. The number of uploads is limited for each sender and in total.
"""

from __future__ import annotations

import secrets
import shutil
import time
import unicodedata
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter

from sim.errors import UsageError
from sim.readers.json_text import read_json
from submissions.raw_files import UploadedFile, sanitise_name
from submissions.student_identity import RejectedSubmission

_RETENTION_SECONDS = 24 * 3600
_UNREADABLE_SECONDS = 60
_MAX_UPLOADS_PER_PERSON, _MAX_UPLOADS = 3, 30
_MAX_FILES = 1000
_MAX_NAME_LENGTH = 200
_METADATA_FILE = "upload.json"
_REMOVED = "this upload was removed, because too many uploads are waiting for confirmation; upload the files again"


@dataclass(frozen=True, slots=True)
class ExpectedSubmission:
    """A submission that would be accepted, with the remarks to show before confirming."""

    student: str
    name: str
    assignment: str
    source: str
    missing: str = ""  # the file of a missing part, or empty
    enrolled: bool = True
    known: bool = False
    copied: bool = False
    empty: str = ""  # an empty file of the submission, or an empty string


@dataclass(frozen=True, slots=True)
class PendingUpload:
    """One upload, with its accepted and rejected submissions."""

    id: str
    person_id: int
    course_id: int
    name: str
    assignment: str
    people: str  # file name of the table of people; empty without a table
    file: str  # file name of the zip; empty if the submissions are single files in a folder
    expected: tuple[ExpectedSubmission, ...] = ()
    refusals: tuple[RejectedSubmission, ...] = ()


_METADATA_ADAPTER = TypeAdapter(PendingUpload)


class PendingUploads:
    """The uploads in one home folder."""

    def __init__(self, home: Path) -> None:
        self._folder = home / "uploads"

    def begin(self, person_id: int, course_id: int, assignment: str) -> PendingUpload:
        """Create an empty upload, after removing expired uploads and the sender's oldest ones over the limit.

        If too many uploads of all senders are waiting, the oldest one of the sender with the most is removed.
        """
        self._folder.mkdir(mode=0o700, exist_ok=True)
        uploads = self._list_recent()
        own_folders = [upload for upload in uploads if upload.person_id == person_id]
        for upload in own_folders[: max(0, len(own_folders) - _MAX_UPLOADS_PER_PERSON + 1)]:
            self.remove(upload)
            uploads.remove(upload)
        while len(uploads) >= _MAX_UPLOADS:
            counts = Counter(upload.person_id for upload in uploads)
            oldest_upload = max(uploads, key=lambda upload: counts[upload.person_id])
            self.remove(oldest_upload)
            uploads.remove(oldest_upload)
        upload_record = PendingUpload(secrets.token_hex(16), person_id, course_id, "", assignment, "", "")
        (self._folder / upload_record.id).mkdir(mode=0o700)
        self.write(upload_record)
        return upload_record

    def write(self, upload: PendingUpload) -> None:
        """Save the metadata of an upload. Raises UsageError if the upload was removed meanwhile."""
        try:
            (self._folder / upload.id / _METADATA_FILE).write_bytes(_METADATA_ADAPTER.dump_json(upload))
        except FileNotFoundError:
            raise UsageError(_REMOVED) from None

    def find(self, upload_id: str, person_id: int, course_id: int) -> PendingUpload | None:
        """Return an upload of this sender to this course, or None if it does not exist or has expired."""
        upload = self._read_metadata(upload_id) if upload_id.isalnum() else None
        if upload is None or (upload.person_id, upload.course_id) != (person_id, course_id):
            return None
        return upload

    def list_waiting(self, person_id: int, course_id: int) -> list[PendingUpload]:
        """Return the uploads of this sender to this course that were read but neither confirmed nor discarded."""
        names = [path.name for path in self._folder.iterdir()] if self._folder.is_dir() else []
        uploads = [each for name in sorted(names) if (each := self.find(name, person_id, course_id)) is not None]
        return [each for each in uploads if each.expected or each.refusals]

    def remove(self, upload: PendingUpload) -> None:
        """Delete an upload."""
        shutil.rmtree(self._folder / upload.id, ignore_errors=True)

    def remove_course(self, course_id: int) -> None:
        """Delete all uploads to a course."""
        for upload in self._list_recent():
            if upload.course_id == course_id:
                self.remove(upload)

    def submissions_path(self, upload: PendingUpload) -> Path:
        """Return the path of the submissions: a zip, or a folder of files."""
        folder = self._folder / upload.id / "batch"
        return folder / upload.file if upload.file else folder

    def people_path(self, upload: PendingUpload) -> Path | None:
        """Return the path of the table of people, or None."""
        return self._folder / upload.id / "people" / upload.people if upload.people else None

    def store_files(self, upload: PendingUpload, files: Sequence[UploadedFile], subfolder: str) -> list[str]:
        """Copy files into a folder of the upload and return their names there.

        Raises:
            UsageError: There are too many files, a name is invalid or occurs twice, or the upload was removed.
        """
        if len(files) > _MAX_FILES:
            raise UsageError(f"{len(files)} files were uploaded, expected at most {_MAX_FILES}, or one zip of them")
        folder = self._folder / upload.id / subfolder
        try:
            folder.mkdir(mode=0o700)
            return [_store_file(folder, file) for file in files]
        except FileNotFoundError:
            raise UsageError(_REMOVED) from None

    def _list_recent(self) -> list[PendingUpload]:
        """Return the uploads, oldest first, after removing expired ones; other threads may remove uploads meanwhile."""
        recent_uploads = []
        for path in self._folder.iterdir() if self._folder.is_dir() else ():
            age = time.time() - _read_time(path)
            upload = self._read_metadata(path.name)
            # A folder without metadata may belong to an upload that is being created at this moment.
            if age > (_UNREADABLE_SECONDS if upload is None else _RETENTION_SECONDS):
                shutil.rmtree(path, ignore_errors=True)
            elif upload is not None:
                recent_uploads.append((age, upload))
        return [upload for _, upload in sorted(recent_uploads, key=lambda each: -each[0])]

    def _read_metadata(self, upload_id: str) -> PendingUpload | None:
        try:
            return _METADATA_ADAPTER.validate_python(
                read_json((self._folder / upload_id / _METADATA_FILE).read_bytes())
            )
        except (OSError, ValueError):
            return None


def _store_file(folder: Path, file: UploadedFile) -> str:
    name = clean_file_name(file)
    try:
        with (folder / name).open("xb") as sink:
            shutil.copyfileobj(file.stream, sink)
    except FileExistsError:
        raise UsageError(
            f"two files have the name {sanitise_name(name)}, expected a different name for each student"
        ) from None
    return name


def _read_time(path: Path) -> float:
    """Return when a path was changed, in seconds; the current time if it no longer exists."""
    try:
        return path.stat().st_mtime
    except FileNotFoundError:
        return time.time()


def clean_file_name(file: UploadedFile) -> str:
    """Return a safe file name without folders. Raises UsageError if it is empty or too long."""
    name = "".join("?" if unicodedata.category(c)[0] == "C" else c for c in file.flat_name).strip().lstrip(".")
    if not name:
        raise UsageError("a file without a name was uploaded, expected a name that identifies its student")
    if len(name.encode()) > _MAX_NAME_LENGTH:
        raise UsageError(f"the name {sanitise_name(name)} is too long, expected at most {_MAX_NAME_LENGTH} bytes")
    return name
