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

    def find(self, written: Student, number: str = "") -> Student:
        """Return the person with this identity, optionally by a number from another system.

        Raises:
            UsageError: No person matches, or several do.
        """
        whole = {_normalise_key(each): each for each in (written.id, written.email, written.name) if each}
        known = self.by_number.get(number)
        if known is not None:
            if written.name in ("", HIDDEN_NAME) or _normalise_key(written.name).endswith(_normalise_key(known.name)):
                return known
            raise UsageError(
                f"{self.file} has {sanitise_name(known.name)} as Participant {number}, not "
                f"{sanitise_name(written.name)}; expected "
                "the table of this assignment."
            )
        # With group submissions, Moodle puts the group before the name: Group 1-Ada.
        for key in (*whole, *(key.partition("-")[2] for key in whole)):
            found = self.by_name.get(key, ())
            if len(found) == 1:
                return found[0]
            if found:
                raise UsageError(
                    f"{len(found)} people in {self.file} are called {sanitise_name(whole.get(key, key))}, "
                    "expected a table "
                    "that distinguishes them by the Identifier of Moodle's worksheet, or by id."
                )
        name = written.name or written.id
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
    called: dict[str, list[Student]] = {}
    for row, student in _read_students(table.rows, path.name):
        if number := re.search(r"\d+$", row.cells.get("identifier", "")):
            numbers[number[0]] = student
        for key in {_normalise_key(each) for each in (student.id, student.email, student.name) if each}:
            called.setdefault(key, []).append(student)
    return People(path.name, numbers, {key: tuple(several) for key, several in called.items()})


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
    others = [
        emails[place] or re.sub(r"\D", "", row.cells.get("identifier", "")) or f"line {row.line}"
        for place, row in enumerate(rows)
    ]
    usual = make_unique_ids(zip(names, others, strict=True))
    ids = [row.cells.get("id") or usual[place] or emails[place] for place, row in enumerate(rows)]
    lines: dict[str, list[str]] = {}
    for row, own in zip(rows, ids, strict=True):
        lines.setdefault(_normalise_key(own), []).append(str(row.line))
    for row, own, name, email in zip(rows, ids, names, emails, strict=True):
        if not own:
            raise UsageError(f"{file}: line {row.line} has no id, name or e-mail address, expected one of them.")
        if len(lines[_normalise_key(own)]) > 1:
            raise UsageError(
                f"{file}: lines {' and '.join(lines[_normalise_key(own)][:5])}: {sanitise_name(own)} is the id of "
                "several students, "
                "expected a different id for each."
            )
        yield row, Student(own, name, email)


def _join_names(row: CsvRow) -> str:
    return normalise_name(f"{row.cells.get('first', '')} {row.cells.get('last', '')}")


def _normalise_key(text: str) -> str:
    return normalise_name(text).casefold()
