"""With names hidden, an instructor's answers do not depend on the students' names.

The routes are taken from the application, so that new routes are included.
"""

from __future__ import annotations

import base64
import io
import itertools
import re
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime

import pytest
from fastapi.routing import iter_route_contexts
from httpx2 import Response

from nameless_world import (
    IDLE,
    STUDENTS,
    NamelessCourse,
    make_nameless_course,
    names_of,
    rename_students,
)
from naming import is_named
from service.operations import moderation
from service.reports.formats import FORMATS
from service.store.courses.hidden_names import HiddenNames
from web import Web, web_in

API = "/api/v1"
_COURSE = "/courses/{course_id}"
_BATCH = f"{_COURSE}/batches/{{batch_id}}"
_EVERYBODY = (*STUDENTS, IDLE)
#: Membership of a course is no secret. These routes show it, and nothing about a student's submissions to assignments
#: with hidden names.
_WITH_NAMES = {f"{start}{_COURSE}/people{rest}" for start in ("", API) for rest in ("", "/{enrolment_id}")} | {
    f"{API}{_COURSE}/people/{{enrolment_id}}/data",
    *(f"{_COURSE}/gradebook{rest}" for rest in ("", "/table")),
    f"{API}{_COURSE}/gradebook",
}
#: Routes without data about students.
_OF_NO_STUDENT = {
    f"{_COURSE}/assignments/uploads/my-assignment.zip",
    f"{_COURSE}/batches/uploads/{{upload_id}}",
}
#: Routes that redirect to another page, or are withheld while names are hidden.
_WITHOUT_ANSWER = {
    f"{_COURSE}/assignments/uploads",
    f"{_COURSE}/people/table",
    f"{_COURSE}/people/{{enrolment_id}}/link",
    f"{API}{_COURSE}/submissions/{{submission_id}}/files",
    *(f"{start}{_COURSE}/grades/{{job_id}}/statement" for start in ("", API)),
}
_FORMATS = [f"?format={name}" for name, each in FORMATS.items() if each.worksheet is None and each.archive is None]
_SORTS = [f"?sort={way}{by}" for way in ("", "-") for by in ("student", "name", "assignment", "marks", "state")]
#: More queries for a route.
_QUERIES: Mapping[str, list[str]] = {
    _BATCH: _SORTS,
    f"{_BATCH}/export": _FORMATS,
    f"{API}{_BATCH}/export": _FORMATS,
    f"{API}{_BATCH}/grades": ["?limit=1"],
    f"{API}{_BATCH}/changes": ["?limit=1"],
    f"{API}{_COURSE}/appeals": ["?limit=1", "?answered=true"],
}
_NAME = re.compile(r"\{(\w+)(?::\w+)?\}")
#: All routes are requested twice.
pytestmark = pytest.mark.long


@dataclass(frozen=True, slots=True)
class Answers:
    """The answer of each path, by its route."""

    course: NamelessCourse
    before: Mapping[tuple[str, str], Response]
    after: Mapping[tuple[str, str], Response]


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Answers]:
    """Yield the answers of all routes before and after the students change names; labels move with the students."""
    labels = dict(zip(_EVERYBODY, ("Participant D", "Participant B", "Participant E", *"AC"), strict=True))
    with pytest.MonkeyPatch.context() as patch, web_in(tmp_path_factory.mktemp("home")) as web:
        course = make_nameless_course(web)

        def called(names: HiddenNames, assignment: str, student: str) -> str:
            return labels[student] if assignment in names.assignments else student

        patch.setattr(HiddenNames, "label_student", called)
        # Moderation sheets show when they were made.
        patch.setattr(moderation, "now", lambda _session: datetime(2026, 11, 27, tzinfo=UTC))
        page_reader = _PageReader(web, course)
        before = page_reader.everything()
        renamed = dict(zip(_EVERYBODY, reversed(_EVERYBODY), strict=True))
        with web.store.transaction() as session:
            rename_students(session, renamed)
        labels = {renamed[who]: label for who, label in labels.items()}
        yield Answers(course, before, page_reader.everything())


class _PageReader:
    """An instructor's browser and program."""

    def __init__(self, web: Web, course: NamelessCourse) -> None:
        self._web, self._course = web, course
        self._browser, self._program = web.browser(course.grace), web.browser()
        self._token = web.token(course.grace, "read", "submit", "mark", "manage")

    def everything(self) -> dict[tuple[str, str], Response]:
        return {(route, path): self._get(path) for route in _routes(self._web) for path in self._paths(route)}

    def _get(self, path: str) -> Response:
        return self._program.get(path, headers=self._token) if path.startswith(API) else self._browser.get(path)

    def _paths(self, route: str) -> Iterator[str]:
        parts = [self._course.values[name] for name in _NAME.findall(route)]
        for values in itertools.product(*parts):
            path = _NAME.sub("%s", route) % values
            yield path
            yield from (path + query for query in _QUERIES.get(route, ()))


def _routes(web: Web) -> list[str]:
    """Return the routes for instructors of a course, except those without data about students."""
    paths = {str(each.path) for each in iter_route_contexts(web.app.routes) if "GET" in (each.methods or ())}
    return sorted(
        path
        for path in paths
        if path.removeprefix(API).startswith(_COURSE) and "/mine" not in path and path not in _OF_NO_STUDENT
    )


def _content(answer: Response) -> bytes | dict[str, bytes]:
    """Return the answer without the creation time of zips."""
    if not answer.content.startswith(b"PK"):
        return answer.content
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def _texts(answer: Response) -> str:
    """Return all texts of an answer, including cursors of the next page."""
    content = _content(answer)
    members = content if isinstance(content, dict) else {"": content}
    places = re.findall(r'"next":"([\w-]+)"', answer.text)
    parts = [base64.urlsafe_b64decode(place + "=" * (-len(place) % 4)) for place in places]
    header = " ".join(answer.headers.values())
    return "\n".join([header, *members, *(data.decode("utf-8", "replace") for data in (*members.values(), *parts))])


def test_every_route_answers(answers: Answers) -> None:
    answered = {route for (route, _), answer in answers.before.items() if answer.status_code == 200}
    assert {route for route, _ in answers.before} - answered == _WITHOUT_ANSWER


def test_no_answer_depends_on_the_names(answers: Answers) -> None:
    differences = {
        route
        for (route, path), answer in answers.before.items()
        if route not in _WITH_NAMES and _content(answer) != _content(answers.after[route, path])
    }
    assert differences == set()


def test_no_other_answer_has_a_name(answers: Answers) -> None:
    names = [name for who in _EVERYBODY for name in names_of(who)]
    leaks = {
        (route, name)
        for (route, _), answer in answers.before.items()
        if route not in _WITH_NAMES
        for name in names
        if is_named(name, _texts(answer))
    }
    assert leaks == set()


def test_answers_with_names_share_no_value_with_rows_without(answers: Answers) -> None:
    """A time, size, number, id or hash that occurs in both would identify the student of a row."""
    values = {key: _values(answer) for key, answer in answers.before.items()}
    named = {key: texts for key, texts in values.items() if key[0] in _WITH_NAMES}
    nameless = set().union(*(texts for key, texts in values.items() if key not in named))
    known = {each for who in _EVERYBODY for each in _in_text(" ".join(names_of(who)))}
    for route in {route for route, _ in named if "{enrolment_id}" in route}:
        known |= set.intersection(*(texts for key, texts in named.items() if key[0] == route))
    assert {(route, value) for (route, _), texts in named.items() for value in (texts - known) & nameless} == set()


def _values(answer: Response) -> set[str]:
    """Return the values in an answer. In a zip, only data about the student, because equal work has equal reports."""
    content = _content(answer)
    return _in_text(answer.text if isinstance(content, bytes) else content.get("student.json", b"").decode())


def _in_text(text: str) -> set[str]:
    """Return the identifying parts of a text: longer words with a digit, and the beginnings of times."""
    words = {word for word in re.findall(r"[\w.:+-]+", text) if len(word) > 4 and any(map(str.isdigit, word))}
    return words | {word[:19] for word in words if re.match(r"\d{4}-\d\d-\d\dT", word)}
