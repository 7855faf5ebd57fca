"""The gradebook of a course: its students by its assignments, with the grade of each that counts.

Assignments whose names are hidden are left out, so that the gradebook tells nobody who submitted to them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from types import MappingProxyType
from typing import Any

from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.operations.exports import Download
from service.operations.lookup import require_course
from service.page_rows import select_page
from service.reports.display_text import format_decimal
from service.reports.formats.csv_output import render_safe_csv
from service.search_text import fold_text
from service.store.courses import open_assignments
from service.store.grades.gradebook import GradebookCell as GradebookCell
from service.store.grades.gradebook import list_submitted_assignments, load_cells
from service.store.people import membership
from service.store.people.membership import Member
from service.store.states import Role
from submissions.raw_files import sanitise_name

_PAGE_SIZE = 100


@dataclass(frozen=True, slots=True)
class GradebookRequest:
    """Search, order and page of a gradebook. ``sort`` is ``student``, ``name`` or the id of an assignment."""

    text: str = ""
    sort: str = "student"
    descending: bool = False
    page: int = 1


@dataclass(frozen=True, slots=True)
class GradebookColumn:
    """An assignment. The title is its id, and the maximum None, if it is not in the course's list."""

    assignment: str
    title: str
    max_marks: Decimal | None


@dataclass(frozen=True, slots=True)
class GradebookLine:
    """A student with a cell for each assignment that they submitted to, by assignment."""

    student: Member
    cells: Mapping[str, GradebookCell]


@dataclass(frozen=True, slots=True)
class Gradebook:
    """Columns and lines, with the assignments that are left out because their names are hidden."""

    columns: tuple[GradebookColumn, ...]
    lines: tuple[GradebookLine, ...]
    hidden: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class GradebookPage(Gradebook):
    """One of the ``pages`` of the ``found`` students that match a search."""

    found: int
    page: int
    pages: int


@dataclass(frozen=True, slots=True)
class _Frame:
    """What all views of a gradebook need: the columns, and the hidden assignments."""

    columns: tuple[GradebookColumn, ...]
    hidden: frozenset[str]


def show_page(service: Service, actor: Actor, course_id: int, request: GradebookRequest) -> GradebookPage:
    """Return the requested page of the students that match, or the last page if there are fewer. Raises NotFound."""
    with service.store.reading() as session:
        frame = _load_frame(session, actor, course_id)
        students = [each for each in _list_students(session, course_id) if each.matches(request.text)]
        students.sort(key=_build_sort_key(session, frame, students, request.sort), reverse=request.descending)
        shown = select_page(students, request.page, _PAGE_SIZE)
        lines = _load_lines(session, frame, shown.rows)
    return GradebookPage(frame.columns, lines, tuple(sorted(frame.hidden)), len(students), shown.page, shown.pages)


def show_after(service: Service, actor: Actor, course_id: int, enrolment_id: int, limit: int) -> Gradebook:
    """Return at most ``limit`` students who were enrolled after this enrolment. Raises NotFound."""
    with service.store.reading() as session:
        frame = _load_frame(session, actor, course_id)
        students = membership.list_members_after(session, course_id, enrolment_id, limit, Role.STUDENT)
        lines = _load_lines(session, frame, students)
    return Gradebook(frame.columns, lines, tuple(sorted(frame.hidden)))


def show_whole(service: Service, actor: Actor, course_id: int) -> Gradebook:
    """Return all students, ordered by id. Raises NotFound."""
    with service.store.reading() as session:
        frame = _load_frame(session, actor, course_id)
        students = _list_students(session, course_id)
        lines = _load_lines(session, frame, students)
    return Gradebook(frame.columns, lines, tuple(sorted(frame.hidden)))


def download_table(service: Service, actor: Actor, course_id: int) -> Download:
    """Return the whole gradebook as comma-separated values: marks and maximum for each assignment. Raises NotFound."""
    with service.store.reading() as session:
        course = require_course(session, actor, course_id, Role.INSTRUCTOR).name
    gradebook = show_whole(service, actor, course_id)
    name = f"{sanitise_name(course) or course_id}-gradebook.csv"
    return Download(name, "text/csv; charset=utf-8", render_table(gradebook).encode())


def render_table(gradebook: Gradebook) -> str:
    """Return a gradebook as comma-separated values. Cells without marks that count are empty."""
    names = [column.assignment for column in gradebook.columns]
    header = ["student", "name", "email", *(f"{title}: {name}" for name in names for title in ("marks", "max_marks"))]
    return render_safe_csv([header, *(_format_line(line, names) for line in gradebook.lines)])


def _format_line(line: GradebookLine, names: Sequence[str]) -> list[str]:
    cells = [line.cells.get(name) for name in names]
    marks = [
        text
        for cell in cells
        for text in (
            ("", "")
            if cell is None or cell.marks is None
            else (format_decimal(cell.marks), format_decimal(cell.max_marks))
        )
    ]
    return [line.student.id, line.student.name, line.student.email, *marks]


def _load_frame(session: Session, actor: Actor, course_id: int) -> _Frame:
    require_course(session, actor, course_id, Role.INSTRUCTOR)
    hidden = frozenset[str]()
    if not actor.is_machine:
        hidden = open_assignments.load_anonymous_assignments(session, course_id)
    listed = {each.assignment: each for each in open_assignments.list_assignments(session, course_id)}
    names = sorted({*listed, *list_submitted_assignments(session, course_id)} - hidden)
    columns = [
        GradebookColumn(name, listed[name].title, listed[name].max_marks)
        if name in listed
        else GradebookColumn(name, name, None)
        for name in names
    ]
    return _Frame(tuple(columns), hidden)


def _list_students(session: Session, course_id: int) -> list[Member]:
    return [each for each in membership.list_members(session, course_id) if each.role is Role.STUDENT]


def _load_lines(session: Session, frame: _Frame, students: Sequence[Member]) -> tuple[GradebookLine, ...]:
    cells: dict[int, dict[str, GradebookCell]] = {each.enrolment_id: {} for each in students}
    for cell in load_cells(session, list(cells), frame.hidden):
        cells[cell.enrolment_id][cell.assignment] = cell
    return tuple(GradebookLine(each, MappingProxyType(cells[each.enrolment_id])) for each in students)


def _build_sort_key(session: Session, frame: _Frame, students: Sequence[Member], sort: str) -> Callable[[Member], Any]:
    """Return the sort key of a student. Students without marks in an assignment are those with the least."""
    if sort in {column.assignment for column in frame.columns}:
        cells = load_cells(session, [each.enrolment_id for each in students], frame.hidden, sort)
        shares = {cell.enrolment_id: cell.share for cell in cells}
        return lambda student: (shares.get(student.enrolment_id, Decimal(-1)), student.id)
    if sort == "name":
        return lambda student: (fold_text(student.name), student.id)
    return lambda student: (fold_text(student.id), student.id)
