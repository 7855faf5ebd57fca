"""Reader of a folder, zip or roster of submissions, which runs before anything is queued.

A bad row is reported and does not affect other rows. This module stores nothing.
"""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

from sim.errors import UsageError
from submissions.archive_extraction import unzip
from submissions.assignment.definition import Assignment
from submissions.assignment.folder import list_catalogue_ids
from submissions.assignment.reader import find_assignment, find_in_catalogue, read_assignment
from submissions.bundle import build_submission, read_submission
from submissions.downloads import IGNORED, DownloadedFiles, is_student_folder, list_student_files
from submissions.grading_request import GradingRequest
from submissions.part_fitting import fit_parts
from submissions.raw_files import read_paths, sanitise_name
from submissions.roster import RosterRow, read_roster, resolve_file
from submissions.student_identity import People, RejectedSubmission, Student
from submissions.student_names import MAX_NAME_LENGTH, describe_look_alikes, find_look_alikes, normalise_name
from submissions.submission import Submission

_log = logging.getLogger(__name__)
_PARTS = {"robot.py", "program.py", "responder.py"}
_MAX_ENTRIES = 50_000
_MAX_BYTES = 4_000_000_000
#: Limit on the unpacked size of a zip, relative to its size. Text compresses to 10-20 %, zeros to 0.1 %.
_ALWAYS_BYTES, _MAX_TIMES = 50_000_000, 30


@dataclass(frozen=True, slots=True)
class BatchContents:
    """Contents of a batch: submissions that can be graded, and rejected submissions."""

    grading_requests: tuple[GradingRequest, ...]
    refusals: tuple[RejectedSubmission, ...]


@dataclass(frozen=True, slots=True)
class _BatchRow:
    """One row: its displayed name, its student as written, and a function that reads it or raises UsageError."""

    name: str
    student: Student
    assignment: str
    read: Callable[[], GradingRequest]
    problem: str = ""


def read_batch(path: Path, assignment: Assignment | None, people: People | None) -> BatchContents:
    """Read every submission of a folder, zip or CSV roster.

    A folder or zip can be a download from Moodle, Gradescope or nbgrader. Otherwise it contains a subfolder, a .py or a
    .zip for each student. Without ``assignment``, each submission names its own. A roster names students and files;
    ``assignment`` applies to rows that name none. Students are looked up in ``people``.

    Raises:
        UsageError: ``path`` itself cannot be used.
    """
    if path.is_file() and path.suffix.lower() == ".csv":
        find = cache(partial(_find_roster_assignment, path.parent))
        return _read_rows(
            _build_row(
                sanitise_name(f"line {row.line}: {row.student.id}" if row.student.id else f"line {row.line}"),
                row.student,
                people if row.student.id else None,
                row.assignment or (assignment.id if assignment else ""),
                partial(_build_roster_request, path.parent, row, assignment, find),
                row.problem,
            )
            for row in read_roster(path)
        )
    with _opened(path) as folder:
        find_own = cache(find_in_catalogue)
        return _read_rows(
            _build_row(
                found.source,
                found.student,
                people,
                assignment.id if assignment else "",
                partial(_build_request, found, folder.name, assignment, find_own),
                found.problem,
                found.number,
            )
            for found in _list_submissions(folder, assignment)
        )


def _build_row(
    name: str,
    stated_student: Student,
    people: People | None,
    assignment: str,
    read_request: Callable[[Student], GradingRequest],
    problem: str,
    number: str = "",
) -> _BatchRow:
    student = stated_student
    try:
        student = people.find(stated_student, number) if people is not None else stated_student
    except UsageError as error:
        problem = problem or str(error)
    return _BatchRow(name, student, assignment, partial(read_request, student), problem)


def _read_rows(rows: Iterable[_BatchRow]) -> BatchContents:
    rows = list(rows)
    look_alikes = find_look_alikes(row.student.id for row in rows if row.student.id)
    outcomes: list[GradingRequest | str] = []
    for row in rows:
        try:
            if row.problem:
                raise UsageError(row.problem)
            if row.student.id in look_alikes:
                raise UsageError(
                    f"{describe_look_alikes(look_alikes[row.student.id])}; expected names that are clearly different."
                )
            outcomes.append(row.read())
        except UsageError as error:
            outcomes.append(" ".join(str(error).split()).removeprefix(f"{row.name}: "))
        except Exception:
            # An internal error with one submission must not reject a whole class.
            _log.exception("%s could not be read", row.name)
            outcomes.append(
                "cannot be read because of a fault in Robomark; its log has the details. Report this fault."
            )
    outcomes = _reject_duplicates(rows, outcomes)
    return BatchContents(
        tuple(each for each in outcomes if isinstance(each, GradingRequest)),
        tuple(
            RejectedSubmission(row.name, each, row.student, row.assignment)
            for row, each in zip(rows, outcomes, strict=True)
            if isinstance(each, str)
        ),
    )


def _reject_duplicates(
    rows: Sequence[_BatchRow], outcomes: Sequence[GradingRequest | str]
) -> list[GradingRequest | str]:
    """Keep one submission per student and assignment. If several differ, reject all of them."""
    groups: dict[tuple[str, str], dict[int, GradingRequest]] = {}
    for index, outcome in enumerate(outcomes):
        if isinstance(outcome, GradingRequest):
            groups.setdefault((outcome.submission.student, outcome.assignment.id), {})[index] = outcome
    remaining = list(outcomes)
    for (_, assignment), duplicates in groups.items():
        first_index, *other_indexes = duplicates
        if len({each.submission.sha256 for each in duplicates.values()}) == 1:
            sentence = (
                f"{rows[first_index].name} is already this student's submission for {assignment}; this one is left out."
            )
            for index in other_indexes:
                remaining[index] = sentence
            continue
        for index, other_index in ((first_index, other_indexes[0]), *((other, first_index) for other in other_indexes)):
            remaining[index] = (
                f"{rows[other_index].name} is this student's submission for {assignment}, too, "
                "and not the same; expected one."
            )
    return remaining


def _build_request(
    download: DownloadedFiles,
    folder: str,
    requested_assignment: Assignment | None,
    find: Callable[[str], Assignment],
    student: Student,
) -> GradingRequest:
    length = len(normalise_name(student.id))
    if not 0 < length <= MAX_NAME_LENGTH:
        raise UsageError(f"has a student's name of {length} characters, expected from 1 to {MAX_NAME_LENGTH}.")
    submission, assignment = (
        _read_student_submission(download, folder, requested_assignment, student),
        requested_assignment,
    )
    if assignment is None:
        if submission.assignment is None:
            raise UsageError("has no assignment; name it with -a or in its submission.toml.")
        assignment = find(submission.assignment)
        submission = fit_parts(submission, assignment.parts)
    return GradingRequest(submission, assignment, download.source, download.submitted_at, student)


def _read_student_submission(
    download: DownloadedFiles, folder: str, requested_assignment: Assignment | None, student: Student
) -> Submission:
    parts = None if requested_assignment is None else requested_assignment.parts
    if isinstance(download.files, Path):
        return read_submission(download.files, student=student.id, required_parts=parts)
    raw = read_paths(download.files, download.source)
    return build_submission(raw, download.source, student.id, download.assignment or folder, parts)


def _build_roster_request(
    folder: Path,
    row: RosterRow,
    requested_assignment: Assignment | None,
    find: Callable[[str], Assignment],
    student: Student,
) -> GradingRequest:
    if not row.assignment and requested_assignment is None:
        raise UsageError("has no assignment; name it with -a or in a column assignment.")
    path = resolve_file(folder, row.file)
    assignment = find(row.assignment) if row.assignment or requested_assignment is None else requested_assignment
    submission = read_submission(path, student=student.id, required_parts=assignment.parts)
    return GradingRequest(submission, assignment, sanitise_name(row.file), row.submitted_at, student)


def _find_roster_assignment(folder: Path, name: str) -> Assignment:
    """Read a catalogue assignment by its id, or an assignment folder relative to the roster."""
    if name in list_catalogue_ids():
        return find_assignment(name)
    path = resolve_file(folder, name)
    return read_assignment(path) if path.is_dir() else find_assignment(name)


def _list_submissions(folder: Path, requested_assignment: Assignment | None) -> list[DownloadedFiles]:
    """Return the submissions in a folder. If a platform exported several assignments, select the requested one."""
    downloads = list_student_files(folder)
    parts = [entry.name for entry in folder.iterdir() if entry.name.lower() in _PARTS]
    if parts:
        raise UsageError(
            f"{folder.name}: has {min(parts)} in it, so it looks like one submission; a batch is a folder with a "
            "subfolder, .py or .zip for each student (one submission is graded with robomark grade)."
        )
    if not downloads:
        raise UsageError(f"{folder.name}: is empty, expected a subfolder, .py or .zip for each student.")
    assignment_ids = dict.fromkeys(each.assignment for each in downloads)
    if requested_assignment is None or len(assignment_ids) == 1:
        return downloads
    if requested_assignment.id not in assignment_ids:
        raise UsageError(
            f"{folder.name}: has submissions for {', '.join(map(sanitise_name, list(assignment_ids)[:5]))}, expected "
            f"for {requested_assignment.id}, or for one assignment alone."
        )
    return [each for each in downloads if each.assignment == requested_assignment.id]


@contextmanager
def _opened(path: Path) -> Iterator[Path]:
    if path.is_dir():
        yield path
    elif path.is_file() and path.suffix.lower() == ".zip":
        with tempfile.TemporaryDirectory(prefix="robomark-batch-") as name:
            # The folder has the name of the zip, for use in messages and as the assignment's name.
            folder = Path(name) / (path.stem or "batch")
            folder.mkdir()
            unzip(path, folder, _MAX_ENTRIES, min(_MAX_BYTES, _ALWAYS_BYTES + _MAX_TIMES * path.stat().st_size))
            yield _enter_only_folder(folder)
    elif not path.exists():
        raise UsageError(f"{path}: does not exist, expected a folder or a .zip of submissions, or a .csv roster.")
    else:
        raise UsageError(
            f"{path}: is neither a folder nor a .zip nor a .csv, expected one with a submission for each student."
        )


def _enter_only_folder(folder: Path) -> Path:
    """Return the only subfolder, if an archive has one around all submissions. A single student's folder is kept."""
    entries = [entry for entry in folder.iterdir() if entry.name not in IGNORED]
    if len(entries) != 1 or not entries[0].is_dir():
        return folder
    files = {entry.name.lower() for entry in entries[0].iterdir()}
    return folder if files & _PARTS or is_student_folder(entries[0]) else entries[0]
