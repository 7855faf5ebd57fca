"""The gradebook: one row for each student, the attempt that counts in each cell, and the same from API and command."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from decimal import Decimal
from typing import Any

import pytest
from starlette.testclient import TestClient

import report_builders
from acting import machine, service_on
from builders import grading_request
from service.operations import gradebook, policies
from service.operations.errors import NotFound
from service.operations.gradebook import GradebookRequest
from service.store.batches import intake
from service.store.courses import open_assignments
from service.store.courses.assignment_versions import freeze_assignment
from service.store.states import CountedAttempt
from submissions.assignment.reader import find_assignment
from web import Web, grade_all, submit, words

PATH = "/courses/1/gradebook"
FULL = report_builders.faulty_grade()


def _grade(marks: str) -> Any:
    criterion = replace(FULL.criteria[0], marks=Decimal(marks), max_marks=Decimal(6))
    return replace(FULL, criteria=(criterion,))


def _submit(web: Web, who: str, marks: str | None, assignment: str = "echo-responder", text: str = "") -> None:
    request = grading_request(who, f"print({who + text + str(marks)!r})\n", find_assignment(assignment))
    intake.accept_batch(web.store, f"{who} {text}", [request], (), course="default", max_attempts=3)
    if marks is not None:
        grade_all(web, _grade(marks))


@pytest.fixture
def course(web: Web, grace: TestClient) -> TestClient:
    """Return the browser of an instructor whose course has four students and two assignments."""
    people = b"id,name\nada,\xc3\x81da Lovelace\nbob,Bob\ncyd,Cyd\nzoe,Zo\xc3\xab\n"
    submit(grace, "/courses/1/people/table", files={"file": ("class.csv", people)})
    with web.store.transaction() as session:
        for name in ("echo-responder", "json-queue"):
            open_assignments.prepare_assignment(session, 1, freeze_assignment(find_assignment(name)))
    _submit(web, "ada", "6")
    _submit(web, "ada", "2", text="worse")
    _submit(web, "bob", "4.5")
    _submit(web, "bob", "3", "json-queue")
    _submit(web, "cyd", None)
    return grace


def _rows(page_text: str) -> list[str]:
    body = page_text[page_text.index("<tbody") : page_text.index("</tbody")]
    return [words(f"<main>{row}") for row in body.split("<tr>")[1:]]


def test_each_student_has_a_row_and_each_cell_the_attempt_that_counts(course: TestClient) -> None:
    assert _rows(course.get(PATH).text) == [
        "ada Áda Lovelace 2 / 6",
        "bob Bob 4.5 / 6 3 / 6",
        "cyd Cyd queued",
        "zoe Zoë",
    ]


def test_the_best_attempt_counts_if_the_course_says_so(web: Web, course: TestClient) -> None:
    policies.set_counted_attempt(service_on(web.store), machine(), 1, CountedAttempt.BEST)
    assert _rows(course.get(PATH).text)[0] == "ada Áda Lovelace 6 / 6"


@pytest.mark.long
@pytest.mark.parametrize(
    ("query", "students"),
    [
        ("sort=-student", "zoe cyd bob ada"),
        ("sort=name", "ada bob cyd zoe"),
        ("sort=-echo-responder", "bob ada zoe cyd"),
        ("sort=json-queue", "ada cyd zoe bob"),
        ("sort=nonsense", "ada bob cyd zoe"),
        ("q=ada lov", "ada"),
        ("q=ZOE", "zoe"),
        ("q=nobody", "No"),
        ("page=9", "ada bob cyd zoe"),
    ],
)
def test_it_is_sorted_and_searched(course: TestClient, query: str, students: str) -> None:
    assert [row.split()[0] for row in _rows(course.get(f"{PATH}?{query}").text)] == students.split()


@pytest.mark.long
def test_the_table_the_api_and_the_command_have_the_same_marks(web: Web, course: TestClient) -> None:
    table = list(csv.DictReader(io.StringIO(course.get(f"{PATH}/table").text.removeprefix("\ufeff"))))
    assert [(row["student"], row["marks: echo-responder"], row["max_marks: json-queue"]) for row in table] == [
        ("ada", "2", ""),
        ("bob", "4.5", "6"),
        ("cyd", "", ""),
        ("zoe", "", ""),
    ]
    token = web.token(web.instructor(), "read")
    first = web.browser().get(f"/api/v1{PATH}?limit=3", headers=token).json()
    rest = web.browser().get(f"/api/v1{PATH}", headers=token, params={"after": first["next"]}).json()
    lines = [*first["items"], *rest["items"]]
    assert (len(first["items"]), rest["next"]) == (3, None)
    whole = gradebook.show_whole(service_on(web.store), machine(), 1)
    for row, shape, line in zip(table, sorted(lines, key=lambda each: each["id"]), whole.lines, strict=True):
        assert row["student"] == shape["id"] == line.student.id
        for cell in shape["grades"]:
            own_cell = line.cells[cell["assignment"]]
            assert cell["marks"] == (None if own_cell.marks is None else float(own_cell.marks))
            assert row[f"marks: {cell['assignment']}"] == ("" if cell["marks"] is None else f"{cell['marks']:g}")


@pytest.mark.long
def test_assignments_with_hidden_names_are_left_out(web: Web, course: TestClient) -> None:
    with web.store.transaction() as session:
        open_assignments.hide_names(session, 1, "json-queue", names_hidden=True)
    page_text = words(course.get(PATH).text)
    assert "Names are hidden during marking, so these assignments are left out: json-queue." in page_text
    assert "3 / 6" not in page_text
    assert "json-queue" not in course.get(f"{PATH}/table").text
    token = web.token(web.instructor(), "read")
    assert "json-queue" not in web.browser().get(f"/api/v1{PATH}", headers=token).text
    # Operators' commands show every name.
    whole = gradebook.show_whole(service_on(web.store), machine(), 1)
    assert [column.assignment for column in whole.columns] == ["echo-responder", "json-queue"]


@pytest.mark.long
def test_it_is_for_the_instructors_of_the_course_only(web: Web, course: TestClient) -> None:
    stranger = web.instructor("linus", "other")
    assert web.browser(stranger).get(PATH).status_code == 404
    assert web.browser(web.student("bea")).get(PATH).status_code == 404
    with pytest.raises(NotFound):
        gradebook.show_page(service_on(web.store), replace(machine(), operator=False), 1, GradebookRequest())
