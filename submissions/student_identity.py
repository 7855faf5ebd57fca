"""Identity of students: id, name, e-mail address, the course's table of people, and rejected submissions.

Files are handled elsewhere; ``student_names.py`` compares names.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from sim.errors import UsageError
from submissions.csv_table import CsvRow, read_csv
from submissions.raw_files import sanitise_name
from submissions.student_names import normalise_name
from submissions.suggestions import suggest_name

#: Column names in a table of people, here and in Moodle and Gradescope.
PERSON_COLUMNS: Mapping[str, Sequence[str]] = MappingProxyType(
    {
        "id": ("id", "student", "id number", "student id", "sid"),
        "name": ("name", "full name"),
        "email": ("email", "email address"),
    }
)
_COLUMNS = {
    **PERSON_COLUMNS,
    "first": ("first name",),
    "last": ("last name", "surname"),
    "identifier": ("identifier",),
}
#: Maximum number of people to enrol at once: SQLite has one writer, so all courses wait until they are enrolled.
MAX_PEOPLE = 5000
#: Moodle's name for every student if names are hidden from markers.
HIDDEN_NAME = "Participant"


@dataclass(frozen=True, slots=True)
class Student:
    """A student of a course: the course's id, and optional name and address. Unknown fields are empty."""

    id: str = ""
    name: str = ""
    email: str = ""


UNKNOWN_STUDENT = Student()


@dataclass(frozen=True, slots=True)
class RejectedSubmission:
    """A rejected submission of a batch: the submitted name, the reason, and the student if known."""

    source: str
    reason: str
    student: Student = UNKNOWN_STUDENT
    assignment: str = ""

    @property
    def sentence(self) -> str:
        """The submitted name and the reason, for display beside the student."""
        return f"{self.source}: {self.reason}" if self.source != self.student.id else self.reason


@dataclass(frozen=True, slots=True)
class People:
    """The people of a course by their names in other systems. A name can belong to several people."""

    file: str
    by_number: Mapping[str, Student]  # Moodle's number of a person in one assignment
    by_name: Mapping[str, tuple[Student, ...]]

    def find(self, stated_student: Student, number: str = "") -> Student:
        """Return the person with this identity, optionally by a number from another system.

        Raises:
            UsageError: No person matches, or several do.
        """
        full_names = {
            _normalise_key(each): each
            for each in (stated_student.id, stated_student.email, stated_student.name)
            if each
        }
        numbered_student = self.by_number.get(number)
        if numbered_student is not None:
            if stated_student.name in ("", HIDDEN_NAME) or _normalise_key(stated_student.name).endswith(
                _normalise_key(numbered_student.name)
            ):
                return numbered_student
            raise UsageError(
                f"{self.file} has {sanitise_name(numbered_student.name)} as Participant {number}, not "
                f"{sanitise_name(stated_student.name)}; expected the table of this assignment."
            )
        # With group submissions, Moodle puts the group before the name: Group 1-Ada.
        for key in (*full_names, *(key.partition("-")[2] for key in full_names)):
            candidates = self.by_name.get(key, ())
            if len(candidates) == 1:
                return candidates[0]
            if candidates:
                raise UsageError(
                    f"{len(candidates)} people in {self.file} are called {sanitise_name(full_names.get(key, key))}, "
                    "expected a table that distinguishes them by the Identifier of Moodle's worksheet, or by id."
                )
        name = stated_student.name or stated_student.id
        hint = suggest_name(name, {each.name or each.id for several in self.by_name.values() for each in several})
        raise UsageError(f"{sanitise_name(name)} is not in {self.file}, expected one of its people{hint or '.'}")


def read_people(path: Path) -> People:
    """Read the people in a CSV file, for example Moodle's offline grading worksheet.

    Raises:
        UsageError: The file is not such a table, or has more than ``MAX_PEOPLE`` rows.
    """
    table = read_csv(path, _COLUMNS, "id, name, email")
    if not table.columns & {"id", "name", "email", "first", "last"}:
        raise UsageError(f"{path.name}: has no column id, name or email in its first line, expected one of them.")
    if len(table.rows) > MAX_PEOPLE:
        raise UsageError(
            f"{path.name}: has {len(table.rows)} people, expected at most {MAX_PEOPLE}; split it into several tables."
        )
    numbers: dict[str, Student] = {}
    students_by_name: dict[str, list[Student]] = {}
    for row, student in _read_students(table.rows, path.name):
        if number := re.search(r"\d+$", row.cells.get("identifier", "")):
            numbers[number[0]] = student
        for key in {_normalise_key(each) for each in (student.id, student.email, student.name) if each}:
            students_by_name.setdefault(key, []).append(student)
    return People(path.name, numbers, {key: tuple(several) for key, several in students_by_name.items()})


def list_known_students(people: People) -> list[Student]:
    """Return every person once, in the order of the table."""
    return list(dict.fromkeys(each for several in people.by_name.values() for each in several))


def make_unique_ids(names: Iterable[tuple[str, str]]) -> list[str]:
    """Return an id for each (name, number): the name, with the number added if others have the same name."""
    names = list(names)
    times = Counter(name for name, _ in dict.fromkeys(names))
    return [f"{name} ({number})" if name and times[name] > 1 else name for name, number in names]


def _read_students(rows: Sequence[CsvRow], file: str) -> Iterator[tuple[CsvRow, Student]]:
    """Yield every person with an id: the given id, or the name, with address or number added if it is not unique."""
    for row in rows:
        if row.problem:
            raise UsageError(f"{file}: line {row.line} {row.problem}")
    names = [normalise_name(row.cells.get("name", "")) or _join_names(row) for row in rows]
    emails = [row.cells.get("email", "") for row in rows]
    suffixes = [
        emails[place] or re.sub(r"\D", "", row.cells.get("identifier", "")) or f"line {row.line}"
        for place, row in enumerate(rows)
    ]
    generated_ids = make_unique_ids(zip(names, suffixes, strict=True))
    ids = [row.cells.get("id") or generated_ids[place] or emails[place] for place, row in enumerate(rows)]
    lines: dict[str, list[str]] = {}
    for row, student_id in zip(rows, ids, strict=True):
        lines.setdefault(_normalise_key(student_id), []).append(str(row.line))
    for row, student_id, name, email in zip(rows, ids, names, emails, strict=True):
        if not student_id:
            raise UsageError(f"{file}: line {row.line} has no id, name or e-mail address, expected one of them.")
        if len(lines[_normalise_key(student_id)]) > 1:
            raise UsageError(
                f"{file}: lines {' and '.join(lines[_normalise_key(student_id)][:5])}: {sanitise_name(student_id)} is "
                "the id of several students, expected a different id for each."
            )
        yield row, Student(student_id, name, email)


def _join_names(row: CsvRow) -> str:
    return normalise_name(f"{row.cells.get('first', '')} {row.cells.get('last', '')}")


def _normalise_key(text: str) -> str:
    return normalise_name(text).casefold()
