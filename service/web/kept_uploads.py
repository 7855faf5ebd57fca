"""What was uploaded and is not taken in yet: kept in the home for a day, until its sender says yes or no.

What of it would be taken in is ``batch_uploads.py``'s to say. A sender has a few at a time, all senders together some.
"""

from __future__ import annotations

import secrets
import shutil
import time
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter

from sim.errors import UsageError
from sim.readers.json_text import read_json
from submissions.raw_files import SentFile, shown
from submissions.student_identity import Refusal

_KEPT_SECONDS = 24 * 3600
_MOST_OF_ONE, _MOST_OF_ALL = 3, 30
_MOST_FILES = 1000
_LONGEST_NAME = 200
_NOTE = "upload.json"


@dataclass(frozen=True, slots=True)
class ExpectedSubmission:
    """A submission that would be taken in, and what is to be known of it first."""

    student: str
    name: str
    assignment: str
    source: str
    missing: str = ""  # the file of the part that it lacks
    enrolled: bool = True
    known: bool = False
    copied: bool = False
    empty: str = ""  # a file of it that has nothing in it


@dataclass(frozen=True, slots=True)
class KeptUpload:
    """One upload, and what would come of it."""

    id: str
    person_id: int
    course_id: int
    name: str
    assignment: str
    people: str  # the name of the table of people; empty where there is none
    file: str  # what the submissions are in; empty: in a folder
    expected: tuple[ExpectedSubmission, ...] = ()
    refusals: tuple[Refusal, ...] = ()


_NOTES = TypeAdapter(KeptUpload)


class KeptUploads:
    """The uploads in one home."""

    def __init__(self, home: Path) -> None:
        self._folder = home / "uploads"

    def begin(self, person_id: int, course_id: int, assignment: str) -> KeptUpload:
        """A new place; what is too old goes, and of one sender the oldest beyond a few.

        Raises UsageError where others have filled all places.
        """
        self._folder.mkdir(mode=0o700, exist_ok=True)
        own = []
        kept = sorted(self._folder.iterdir(), key=lambda path: path.stat().st_mtime)
        for path in kept:
            note = self._read(path.name)
            if note is None or path.stat().st_mtime < time.time() - _KEPT_SECONDS:
                self._remove_begun(path)
            elif note.person_id == person_id:
                own.append(path)
        for path in own[: max(0, len(own) - _MOST_OF_ONE + 1)]:
            shutil.rmtree(path, ignore_errors=True)
        if len(list(self._folder.iterdir())) >= _MOST_OF_ALL:
            raise UsageError("too many uploads wait to be confirmed here; try again later")
        made = KeptUpload(secrets.token_hex(16), person_id, course_id, "", assignment, "", "")
        (self._folder / made.id).mkdir(mode=0o700)
        self.write(made)
        return made

    def write(self, upload: KeptUpload) -> None:
        """Note what is known of an upload."""
        (self._folder / upload.id / _NOTE).write_bytes(_NOTES.dump_json(upload))

    def find(self, upload_id: str, person_id: int, course_id: int) -> KeptUpload | None:
        """An upload of this sender to this course; None where there is none, or not any more."""
        found = self._read(upload_id) if upload_id.isalnum() else None
        if found is None or (found.person_id, found.course_id) != (person_id, course_id):
            return None
        return found

    def waiting(self, person_id: int, course_id: int) -> list[KeptUpload]:
        """Those of this sender to this course that were looked at and are neither taken in nor discarded."""
        names = [path.name for path in self._folder.iterdir()] if self._folder.is_dir() else []
        found = [each for name in sorted(names) if (each := self.find(name, person_id, course_id)) is not None]
        return [each for each in found if each.expected or each.refusals]

    def remove(self, upload: KeptUpload) -> None:
        """Forget it."""
        shutil.rmtree(self._folder / upload.id, ignore_errors=True)

    def submissions(self, upload: KeptUpload) -> Path:
        """Where its submissions are: a zip, or a folder of files."""
        folder = self._folder / upload.id / "batch"
        return folder / upload.file if upload.file else folder

    def people(self, upload: KeptUpload) -> Path | None:
        """Where its table of people is, if it has one."""
        return self._folder / upload.id / "people" / upload.people if upload.people else None

    def lay(self, upload: KeptUpload, files: Sequence[SentFile], into: str) -> list[str]:
        """Copy what was sent into a folder of the upload; the names they have there.

        Raises UsageError for a name that is none, or is there twice.
        """
        if len(files) > _MOST_FILES:
            raise UsageError(f"{len(files)} files were sent, expected at most {_MOST_FILES}, or one zip of them")
        folder = self._folder / upload.id / into
        folder.mkdir(mode=0o700)
        names = []
        for file in files:
            name = file_name(file)
            try:
                with (folder / name).open("xb") as sink:
                    shutil.copyfileobj(file.stream, sink)
            except FileExistsError:
                raise UsageError(f"two files are called {shown(name)}, expected a name for each student") from None
            names.append(name)
        return names

    def _read(self, upload_id: str) -> KeptUpload | None:
        try:
            return _NOTES.validate_python(read_json((self._folder / upload_id / _NOTE).read_bytes()))
        except (OSError, ValueError):
            return None

    def _remove_begun(self, path: Path) -> None:
        # What has no note yet may be another's that is being made this moment.
        if path.stat().st_mtime < time.time() - 60:
            shutil.rmtree(path, ignore_errors=True)


def file_name(sent: SentFile) -> str:
    """A name that lies in its folder and nowhere else. Raises UsageError where there is none, or it is too long."""
    name = "".join("?" if unicodedata.category(c)[0] == "C" else c for c in sent.flat_name).strip().lstrip(".")
    if not name:
        raise UsageError("a file without a name was sent, expected one that names its student")
    if len(name.encode()) > _LONGEST_NAME:
        raise UsageError(f"the name {shown(name)} is too long, expected at most {_LONGEST_NAME} bytes")
    return name
